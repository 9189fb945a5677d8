"""Scores of masks in 3D, as challenges have them: MONAI's."""

from __future__ import annotations

import numpy as np
import torch
from monai.metrics.utils import get_edge_surface_distance

from cccd.geometry.arrays import AnyArray
from cccd.metrics import dice
from cccd.volumes.grid import bounding_box

__all__ = ["volume_scores"]


def volume_scores(found: AnyArray, truth: AnyArray, spacing: AnyArray) -> dict[str, float]:
    """Dice, average symmetric surface distance and 95th percentile of the Hausdorff distance.

    Parameters
    ----------
    found, truth : (a, b, c) bool
    spacing : (3,) float
        mm.

    Returns
    -------
    dict
        ``dice``, ``assd_mm`` and ``hd95_mm``; distances between the masks' surface voxels, infinite where one
        of the masks is empty.

    Examples
    --------
    >>> mask = np.zeros((9, 9, 9), bool)
    >>> mask[2:6, 2:6, 2:6] = True
    >>> volume_scores(np.roll(mask, 1, axis=2), mask, np.array([1.0, 1.0, 3.0]))["hd95_mm"]
    3.0
    """
    if not (found.any() and truth.any()):
        same = float(found.any() == truth.any())
        return {"dice": same, "assd_mm": 0.0 if same else np.inf, "hd95_mm": 0.0 if same else np.inf}
    low, high = bounding_box(np.asarray(found | truth, bool))
    inside = tuple(slice(max(a - 1, 0), b + 2) for a, b in zip(low, high, strict=True))
    one, other = (torch.as_tensor(np.ascontiguousarray(mask[inside])) for mask in (found, truth))
    # MONAI makes both scores of the same distances, which take nearly all the time: measured once
    size = [float(mm) for mm in spacing]
    _, directed, _ = get_edge_surface_distance(one, other, spacing=size, symmetric=True)
    ways = [torch.as_tensor(distances).double().numpy() for distances in directed]
    return {
        "dice": float(dice(found, truth)),
        "assd_mm": float(np.concatenate(ways).mean()),
        "hd95_mm": max(float(np.percentile(way, 95)) for way in ways),
    }
