from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cccd_paper.comparisons.baselines.active_contours import CONTOURS
from cccd_paper.comparisons.baselines.corner_detectors import CORNER_DETECTORS
from cccd_paper.comparisons.baselines.decoders import DECODERS
from cccd_paper.comparisons.baselines.reconstructions import RECONSTRUCTIONS
from cccd_paper.comparisons.baselines.surfaces import SURFACES
from cccd_paper.comparisons.parameters import (
    BEST,
    CHAIN_BEST,
    CHAIN_GRID,
    GRID,
    PAPER_FIGURE_9,
    PAPER_TABLE_2,
    grid_points,
    open_edges,
    parameter_sets,
)
from cccd_paper.comparisons.pixel_corners import susan

ROOT = Path(__file__).parents[4]
CORNERS = {(15, 20), (15, 49), (44, 20), (44, 49)}


@pytest.fixture
def rectangle():
    image = np.zeros((60, 70), np.uint8)
    image[15:45, 20:50] = 200
    return image


@pytest.mark.parametrize(
    ("detector", "parameters"),
    [
        ("harris", {"block": 2, "aperture": 3, "k": 0.04, "threshold": 0.1, "radius": 2}),
        ("shi_tomasi", {"max_corners": 400, "quality": 0.1, "distance": 5}),
        ("fast", {"threshold": 10, "suppress": False}),
        ("susan", {}),
    ],
)
def test_a_rectangle_has_four_corners(rectangle, detector, parameters):
    found = CORNER_DETECTORS[detector].run(rectangle, **parameters)
    away = np.abs(found[:, None] - np.array(sorted(CORNERS))).max(2)
    assert (away.min(0) <= 1).all(), "each corner is found"
    assert (away.min(1) <= 3).all(), "nothing else is"


@pytest.mark.parametrize("detector", sorted(CORNER_DETECTORS))
def test_nothing_is_found_where_nothing_is(detector):
    flat = np.full((40, 50), 90, np.uint8)
    for parameters in parameter_sets(detector, "mask").values():
        assert CORNER_DETECTORS[detector].run(flat, **parameters).shape == (0, 2)


def test_susan_looks_at_differences_only(rectangle):
    np.testing.assert_array_equal(susan(rectangle), susan(255 - rectangle[:, :]))


def test_susan_turns_with_the_image(rectangle):
    turned = {(59 - j, i) for i, j in susan(np.rot90(rectangle, -1)).tolist()}
    assert turned == CORNERS


@pytest.mark.parametrize("detector", sorted(CORNER_DETECTORS))
def test_the_best_parameters_are_of_the_grid(detector):
    for image in ("mask", "outline", "grey"):
        assert BEST[image][detector] in list(grid_points(detector))
        assert not open_edges(detector, BEST[image][detector]), image


@pytest.mark.parametrize("detector", sorted(CHAIN_GRID))
def test_the_best_on_the_chain_code_lies_inside_its_grid(detector):
    assert CHAIN_BEST[detector] in list(grid_points(detector, CHAIN_GRID))
    assert not open_edges(detector, CHAIN_BEST[detector])


def test_an_end_of_a_grid_is_open_unless_nothing_lies_beyond():
    first = {name: axis[0] for name, axis in CHAIN_GRID["Medioni-Yasumoto"].items()}
    assert not open_edges("Medioni-Yasumoto", first)  # a step of 1, a displacement of 0
    last = {name: axis[-1] for name, axis in CHAIN_GRID["Medioni-Yasumoto"].items()}
    assert open_edges("Medioni-Yasumoto", last) == ["step", "displacement"]
    assert open_edges("fast", {"threshold": 60, "suppress": True}) == ["threshold"]
    assert open_edges("harris", BEST["mask"]["harris"] | {"threshold": 1e-7}) == ["threshold"]


def test_the_best_are_what_the_searches_found():
    """The committed table of the searches names these parameters, or others that are as good."""
    table = pd.read_csv(ROOT / "docs" / "measured" / "corner_grids.csv")
    found = table.set_index(["image", "detector"])["values"].to_dict()
    best = {(image, name): point for image, sets in BEST.items() for name, point in sets.items()}
    best |= {("chain code", name): point for name, point in CHAIN_BEST.items()}
    assert found == {
        key: ", ".join(f"{name} {value}" for name, value in point.items()) for key, point in best.items()
    }
    assert not table["edges"].any()


def test_the_registry_is_complete():
    assert set(CORNER_DETECTORS) == set(GRID) == {"harris", "shi_tomasi", "fast", "susan"}
    assert set(PAPER_FIGURE_9) == set(PAPER_TABLE_2) == {"harris", "shi_tomasi", "fast"}
    assert set(RECONSTRUCTIONS) == {
        "connect2d", "crawl", "nn_crust", "crust", "peel", "gathan", "sigdt", "hnn_crust", "tour",
    }  # fmt: skip
    assert set(CONTOURS) == {"corners", "grey"}
    for family in (CORNER_DETECTORS, RECONSTRUCTIONS, CONTOURS, SURFACES, DECODERS):
        assert all(callable(method.run) and method.title and method.note for method in family.values())
        assert len({method.title for method in family.values()}) == len(family)
    methods = [*CORNER_DETECTORS.values(), *RECONSTRUCTIONS.values(), *CONTOURS.values()]
    assert len({method.title for method in methods}) == len(methods)
