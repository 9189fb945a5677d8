"""What the report draws of a surface's control points: its control mesh."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

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
    def of(cls, bodies: Sequence[ControlMesh]) -> ControlNet:
        """Join closed splines, of which there is one at least."""
        parts = [(body.vertices, quad_edges(body.quads)[0], body.creases) for body in bodies]
        starts = np.cumsum([0, *(len(points) for points, _, _ in parts)])
        return cls(
            np.concatenate([points for points, _, _ in parts]),
            np.concatenate([edges + start for (_, edges, _), start in zip(parts, starts, strict=False)]),
            np.concatenate([creases + start for (_, _, creases), start in zip(parts, starts, strict=False)]),
        )
