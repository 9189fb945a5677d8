"""Contours of a structure with what a run reports of them, without a network."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy

from cccd import contours
from cccd.containers import Curves, Structure
from cccd.geometry.arrays import connected_parts
from cccd.geometry.opencv import components


def trace_contours(structure: Structure) -> tuple[Curves, dict[str, Any]]:
    """Trace a mask as `cccd.contours.trace_contours` does; ``left_out``: see `left_out`; surfaces have it."""
    curves, mask = contours.trace_contours(structure), structure.required_stack("mask")
    method = "traced mask" if structure.probability is None else "level of probabilities"
    return curves, {"method": method, "left_out": left_out(mask, structure.stack_origin, curves)}


def take_contours(structure: Structure) -> tuple[Curves, dict[str, Any]]:
    """Take drawn contours as `cccd.contours.take_contours` does."""
    return contours.take_contours(structure), {"method": "contours as given"}


def left_out(mask: np.ndarray, origin: Sequence[int] | np.ndarray, curves: Curves) -> dict[str, int]:
    """Count what of a mask (S, I, J) its curves do not enclose.

    Returns
    -------
    dict
        ``components``: in-slice components (8-connected) too small to have a polygon;
        ``component_pixels``: their pixels; ``spur_pixels``: pixels of other components that lie on spurs
        or bridges one pixel wide; ``parts``: parts of the whole mask (26-connected) that have no polygon on
        any slice; ``part_voxels``: their voxels; ``voxels``: the mask's.
    """
    missing = mask & ~curves.rasterise(origin, mask.shape)
    small, spurs = np.zeros_like(mask), 0
    sizes: list[int] = []
    for k in np.flatnonzero(missing.any(axis=(1, 2))):
        labels, size = components(np.asarray(mask[k], np.uint8), connectivity=8)
        lost = np.bincount(labels[missing[k]], minlength=len(size))
        whole = (lost == size) & (lost > 0)
        small[k] = whole[labels]
        sizes += size[whole].tolist()
        spurs += int(lost[~whole].sum())
    parts = _apart(mask, small)
    return {
        "components": len(sizes),
        "component_pixels": sum(sizes),
        "spur_pixels": spurs,
        "parts": len(parts),
        "part_voxels": int(parts.sum()),
        "voxels": int(np.count_nonzero(mask)),
    }


def _apart(mask: np.ndarray, small: np.ndarray) -> np.ndarray:
    """Voxels (P,) of each part (26-connected) of a mask (S, I, J) that is made of small components alone."""
    at = np.argwhere(small)
    if not len(at):
        return np.zeros(0, int)
    kept = np.pad(mask & ~small, 1)
    near = np.any([kept[tuple((at + step).T)] for step in np.ndindex(3, 3, 3)], axis=0)
    one, other = scipy.spatial.cKDTree(at).query_pairs(1.8, output_type="ndarray").T  # a corner: sqrt(3)
    part = connected_parts(one, other, len(at))
    return np.bincount(part)[np.bincount(part, near) == 0]
