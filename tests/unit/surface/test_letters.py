"""Solid letters, sliced three ways: their contours branch, merge and have holes; genus and volume hold."""

import numpy as np
import pytest
from support.shapes import structure_of

from cccd import reconstruct
from cccd_datasets.implicit_solids import ImplicitFunction, sample_lattice
from cccd_datasets.phantoms import ORGANS
from cccd_workflow.surface_measures import measure_mesh

#: The axis of the letter (0 to its side, 1 through its plane, 2 upwards) along which it is sliced, and its
#: voxels; through its plane the strokes are no thicker than three slices of 5 mm.
STACKINGS = {"upright": (2, (2, 2, 5)), "on its side": (0, (2, 2, 5)), "lying": (1, (2, 2, 2))}


def sliced(letter: ImplicitFunction, axis: int, spacing: tuple[float, ...]):
    """Mask of a letter, 120 mm wide, with slices along one of its axes."""
    first, second = (other for other in range(3) if other != axis)
    step, shape = np.array(spacing, float), np.ceil(120 / np.array(spacing)).astype(int)

    def turned(points):
        return letter(points[np.argsort([first, second, axis])])

    return sample_lattice(turned, -60 + 0.3 * step, step, shape) < 0


@pytest.mark.parametrize(
    ("letter", "genus", "stacking"),
    [*(("A", 1, stacking) for stacking in STACKINGS), ("H", 0, "upright"), ("X", 0, "upright")],
)
def test_a_letter_keeps_its_genus_and_volume(letter, genus, stacking):
    axis, spacing = STACKINGS[stacking]
    anatomy = ORGANS[letter](np.random.default_rng(4))
    mask = sliced(anatomy.organ, axis, spacing)
    structure = structure_of(mask, spacing)
    surface = reconstruct(structure).lofted
    figures = measure_mesh(surface.mesh, structure, samples=2000)
    assert figures["closed_manifold"]
    assert figures["self_intersections"] == 0
    assert surface.report["bodies"] == 1
    assert figures["genus"] == genus
    assert abs(figures["volume_bias"]) < 0.015
