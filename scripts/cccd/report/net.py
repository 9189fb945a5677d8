"""What the report draws of a surface's control points: a spline's control mesh, or the nets of tubes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cccd.geometry.bsplines import Patch
from cccd.geometry.subdivision import ControlMesh, quad_edges

__all__ = ["ControlNet"]


class ControlNet(NamedTuple):
    """Control points and the lines between them.

    Attributes
    ----------
    points : (P, 3) float64
        mm RAS.
    edges : (E, 2) int64
        Each once.
    creases : (C, 2) int64
        Those along which the surface is sharp.
    """

    points: np.ndarray
    edges: np.ndarray
    creases: np.ndarray

    @classmethod
    def of(cls, bodies: Sequence[ControlMesh], patches: Sequence[Patch]) -> ControlNet:
        """Join closed splines, or where there is none the nets of tubes; there is one of either at least."""
        if bodies:
            parts = [(body.vertices, quad_edges(body.quads)[0], body.creases) for body in bodies]
        else:
            none = np.zeros((0, 2), np.int64)
            parts = [(patch.control_points.reshape(-1, 3), _grid_edges(patch), none) for patch in patches]
        starts = np.cumsum([0, *(len(points) for points, _, _ in parts)])
        return cls(
            np.concatenate([points for points, _, _ in parts]),
            np.concatenate([edges + start for (_, edges, _), start in zip(parts, starts, strict=False)]),
            np.concatenate([creases + start for (_, _, creases), start in zip(parts, starts, strict=False)]),
        )


def _grid_edges(patch: Patch) -> np.ndarray:
    """Edges (E, 2) of a patch's net, both ways, closed where the patch is."""
    number = np.arange(patch.weights.size).reshape(patch.weights.shape)
    lines = []
    for axis, closed in ((0, patch.closed_u), (1, patch.closed_v)):
        ends = np.stack([number, np.roll(number, -1, axis=axis)], axis=-1)
        last = number.shape[axis] if closed else -1
        lines.append(ends[:last].reshape(-1, 2) if axis == 0 else ends[:, :last].reshape(-1, 2))
    return np.concatenate(lines)
