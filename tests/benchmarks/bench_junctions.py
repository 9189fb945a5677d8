"""Junction decoding: boundary pixels to ordered curves, beside contour following of the filled mask."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from organ import make_organ

from cccd.boundary import extract_boundaries
from cccd.chaincode import trace_mask
from cccd.junctions import load_model, order_boundaries

TITLE = "Junction decoding"
SIZES = (8, 16, 32, 64)
MODEL = Path(__file__).parents[2] / "workflow" / "models" / "junctions.pt"


def prepare(slices: int, settings: dict) -> dict[str, Callable]:
    """Give the methods to time on an organ of so many slices."""
    organ = make_organ(slices)
    boundaries = extract_boundaries(organ, settings["boundaries"])
    stack = organ.stack("mask").astype(np.uint8)
    model = load_model(MODEL)
    return {
        "GNN and minimum cut": lambda: order_boundaries(boundaries, model, image=organ.stack("image")),
        "minimum cut alone": lambda: order_boundaries(boundaries, None),
        "our tracing of a mask": lambda: trace_mask(organ),
        "cv2.findContours of a mask": lambda: [
            cv2.findContours(layer, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE) for layer in stack
        ],
    }
