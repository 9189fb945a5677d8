"""Values on a regular grid of space, and the surface where they reach a level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from cccd.geometry.arrays import FloatArray, RealArray
from cccd.geometry.mesh import Mesh

__all__ = ["ScalarGrid"]


@dataclass(frozen=True, eq=False)
class ScalarGrid:
    """Numbers at the nodes of a grid.

    Attributes
    ----------
    values : (A, B, C) array
    affine : (4, 4) float64
        ``position = affine @ (a, b, c, 1)`` for the index of a node.
    origin : (3,) int
        Index of the first node, where the values are a block of a larger grid.
    """

    values: RealArray
    affine: FloatArray
    origin: Sequence[int] | RealArray = (0, 0, 0)

    @classmethod
    def uniform(cls, values: RealArray, origin: Sequence[float] | FloatArray, spacing: float) -> ScalarGrid:
        """Lay a grid along the axes, its first node at ``origin`` (3,), nodes ``spacing`` apart."""
        affine = np.diag([spacing, spacing, spacing, 1.0])
        affine[:3, 3] = origin
        return cls(values, affine)

    def isosurface(self, level: float) -> Mesh:
        """Mesh the surface on which linear interpolation reaches a level (Lewiner et al. 2003).

        Faces are counter-clockwise seen from where values are larger: outwards for signed distances, and
        inwards for masks. Nothing is closed at the border of the grid.

        Raises
        ------
        ValueError
            When no value lies below, or none above the level.

        Examples
        --------
        >>> axis = np.linspace(-1, 1, 21)
        >>> distance = np.linalg.norm(np.meshgrid(axis, axis, axis), axis=0) - 0.8
        >>> ball = ScalarGrid.uniform(distance, (-1, -1, -1), 0.1).isosurface(0.0)
        >>> ball.is_closed_manifold, round(ball.volume / (4 / 3 * np.pi * 0.8**3), 2)
        (True, 0.99)
        """
        from skimage import measure  # loaded where there is something to mesh

        index, faces, _, _ = cast(Any, measure).marching_cubes(self.values, level)
        nodes: FloatArray = index.astype(float) + np.asarray(self.origin)
        return Mesh(nodes, faces.astype(np.int64)).transformed(self.affine)
