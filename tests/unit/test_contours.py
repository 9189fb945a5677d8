"""Three ways to ordered contours: what each gives, and what each says to a structure that is not its own."""

from pathlib import Path

import numpy as np
import pytest

from cccd.containers import Frame, Structure
from cccd.contours import take_contours, trace_contours
from cccd.errors import InputError
from cccd.settings.junctions import BoundarySettings
from cccd_junctions.boundary import extract_boundaries
from cccd_junctions.checkpoint import load_model
from cccd_junctions.ordering import order_contours

MODEL = Path(__file__).parents[2] / "workflow" / "models" / "junctions.pt"


def structure_of(stack=None, contours=None) -> Structure:
    """A structure whose slices (S, I, J) lie along the last axis, off the corner of its scan."""
    mask = None if stack is None else np.moveaxis(stack, 0, 2)
    return Structure(
        "a", "b", Frame(np.eye(4), 2, (99, 99, 99)), np.array([5, 6, 7]), mask=mask, contours=contours
    )


def discs(*radii) -> np.ndarray:
    i, j = np.indices((61, 61)) - 30
    return np.stack([i**2 + j**2 <= radius**2 for radius in radii])


@pytest.fixture(scope="module")
def model():
    return load_model(MODEL)


def test_a_mask_is_traced_and_an_empty_one_refused():
    assert trace_contours(structure_of(discs(9)))[1]["method"] == "traced mask"
    with pytest.raises(InputError, match="no slice has a closed boundary"):
        trace_contours(structure_of(np.zeros((2, 9, 9), bool)))


def test_contours_are_taken_as_they_are():
    drawn, _ = trace_contours(structure_of(discs(9, 12)))
    curves, report = take_contours(structure_of(contours=drawn))
    assert curves is drawn
    assert report == {"method": "contours as given"}


def test_the_network_orders_an_outline_as_it_is_traced(model):
    structure = structure_of(discs(12, 20, 16))
    exact, _ = trace_contours(structure)
    curves, report = order_contours(structure, extract_boundaries(structure, BoundarySettings()), model)
    np.testing.assert_array_equal(curves.offsets, exact.offsets)
    np.testing.assert_array_equal(curves.points, exact.points)
    np.testing.assert_array_equal(curves.slice, exact.slice)
    assert report["method"] == "GNN"
    assert report["pixels"] == len(exact.points)


def test_a_structure_on_the_wrong_way_is_told_so_in_one_line(model):
    masked = structure_of(discs(9, 12))
    drawn = structure_of(contours=trace_contours(masked)[0])
    boundaries = extract_boundaries(masked, BoundarySettings())
    for walk, problem in [
        (lambda: trace_contours(drawn), "there is no mask to trace"),
        (lambda: take_contours(masked), "there are no drawn contours"),
        (lambda: order_contours(drawn, boundaries, model), "its contours are drawn, and need no ordering"),
    ]:
        with pytest.raises(InputError) as caught:
            walk()
        assert str(caught.value) == (
            f"a/b: {problem}; its file has changed since the run was planned: run snakemake again"
        )
