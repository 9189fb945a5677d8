"""Patches moved outwards or inwards by a little: their offset surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cccd.geometry.arrays import FloatArray
from cccd.geometry.bsplines import Patch, greville

__all__ = ["offset_patch"]


def offset_patch(patch: Patch, amount: float, axis: FloatArray) -> Patch:
    """Move a patch outwards, or with a negative amount inwards, by a little.

    Control points move by ``amount`` mm times the part, square to ``axis`` (3,), of the unit normal at their
    Greville parameters: plane sections stay plane, level and planar caps where they are.
    """
    normal = _normals_at_control_points(patch)
    across = normal - np.outer(normal @ axis, axis)
    across = across.reshape(patch.control_points.shape)
    outwards = patch.control_points - patch.control_points.mean(axis=0)
    side = np.sign(np.sum(across * outwards)) or 1.0
    return replace(patch, control_points=patch.control_points + side * amount * across)


def _normals_at_control_points(patch: Patch) -> FloatArray:
    """Return unit normals (nu * nv, 3) at the control points' Greville parameters; zero at a pole."""
    u = greville(patch.knots_u, patch.degree_u, patch.weights.shape[0])
    v = greville(patch.knots_v, patch.degree_v, patch.weights.shape[1])
    bu, slope_u = (patch.basis_u(u, order) for order in (0, 1))
    bv, slope_v = (patch.basis_v(v, order) for order in (0, 1))
    homogeneous = patch.homogeneous
    point, along_u, along_v = (
        np.einsum("au,bv,uvc->abc", around, along, homogeneous, optimize=True).reshape(-1, 4)
        for around, along in ((bu, bv), (slope_u, bv), (bu, slope_v))
    )
    # The quotient rule up to a factor: only the direction counts.
    su, sv = (point[:, 3:] * d[:, :3] - d[:, 3:] * point[:, :3] for d in (along_u, along_v))
    normal = np.cross(su, sv)
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.divide(normal, size, out=np.zeros_like(normal), where=size > 1e-9)
