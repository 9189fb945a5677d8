"""Scores of masks in 3D, as challenges have them: MONAI's."""

from __future__ import annotations

import numpy as np
import torch
from monai.metrics.hausdorff_distance import compute_hausdorff_distance
from monai.metrics.surface_distance import compute_average_surface_distance

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
    pair = [torch.as_tensor(np.ascontiguousarray(mask[inside]))[None, None] for mask in (found, truth)]
    size = [float(mm) for mm in spacing]
    hd95 = compute_hausdorff_distance(*pair, include_background=True, percentile=95, spacing=size)
    assd = compute_average_surface_distance(*pair, include_background=True, symmetric=True, spacing=size)
    return {"dice": float(dice(found, truth)), "assd_mm": float(assd), "hd95_mm": float(hd95)}
