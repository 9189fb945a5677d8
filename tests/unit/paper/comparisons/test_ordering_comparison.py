"""What the network makes of a traced mask's pixels."""

from pathlib import Path

import numpy as np
from support.shapes import structure_of

from cccd.settings.boundaries import BoundarySettings
from cccd.tracing import trace_mask
from cccd_junctions.boundary import extract_boundaries
from cccd_junctions.checkpoint import load_model
from cccd_paper.comparisons.ordering_comparison import compare_ordering

MODEL = Path(__file__).parents[4] / "workflow" / "models" / "junctions.pt"


def test_clean_outlines_are_ordered_as_they_are_traced():
    i, j = np.indices((61, 61)) - 30
    mask = np.stack([i**2 + j**2 <= radius**2 for radius in (12, 20, 16)], axis=2)
    structure = structure_of(mask)
    boundaries = extract_boundaries(structure, BoundarySettings())
    table = compare_ordering(structure, boundaries, trace_mask(structure), load_model(MODEL))
    (row,) = table.to_dict("records")
    assert row["dice"] == 1
    assert row["curves"] == row["curves_exact"] == 3
    assert row["unclosed"] == row["dropped"] == row["bridged"] == row["holes"] == 0
