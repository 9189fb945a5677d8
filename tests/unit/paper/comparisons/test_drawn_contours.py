"""Contours that came ordered (RTSTRUCT) run from no pixel to the next, and are compared all the same."""

import numpy as np

from cccd.containers import Curves, Frame, Structure
from cccd.geometry.arrays import concatenate_ragged
from cccd_paper.comparisons.corner_comparison import compare_corners
from cccd_paper.comparisons.paper_k import CCCD
from cccd_paper.settings import SliceChoice


def test_corners_of_drawn_contours():
    turn = np.linspace(0, 2 * np.pi, 70, endpoint=False)
    rings = [
        20 + radius * np.column_stack([np.cos(turn), 0.8 * np.sin(turn)]) for radius in (12.3, 13.1, 12.7)
    ]
    points, offsets = concatenate_ragged(rings)
    frame = Frame(np.diag([1.0, 1.0, 3.0, 1.0]), 2, (40, 40, 3))
    curves = Curves(points, offsets, np.arange(3, dtype=np.int32), np.zeros(3, bool), frame)
    structure = Structure("a", "drawn", frame, np.zeros(3, int), contours=curves)
    settings = SliceChoice(n_slices=1)
    table = compare_corners(structure, curves, settings)
    ours = table[(table["method"] == CCCD) & (table["parameters"] == "automatic")]
    assert (ours["DSC"] > 0.97).all()
