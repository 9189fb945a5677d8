"""Values on a regular grid of space, and the surface where they reach a level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cccd.geometry.arrays import FloatArray, IntArray, RealArray
from cccd.geometry.mesh import Mesh, triangles_of, vtk


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
        """Mesh the surface on which linear interpolation reaches a level.

        These are marching cubes by flying edges (Schroeder et al. 2015): what two cubes share is cut alike
        from both sides, so inside the grid the mesh is closed, and no edge has more than two faces.

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
        if not np.any(self.values < level) or not np.any(self.values > level):
            raise ValueError(f"no surface: all values lie on one side of the level {level}")
        index, faces = _flying_edges(self.values, level)
        nodes: FloatArray = index + np.asarray(self.origin)
        return Mesh(nodes, faces).transformed(self.affine)


def _flying_edges(values: RealArray, level: float) -> tuple[FloatArray, IntArray]:
    """Vertices (P, 3) in nodes, and faces (F, 3) counter-clockwise where values (A, B, C) are larger."""
    image, filter_ = vtk("vtkCommonDataModel").vtkImageData(), vtk("vtkFiltersCore").vtkFlyingEdges3D()
    flat = np.ascontiguousarray(values).ravel()
    image.SetDimensions(values.shape[::-1])  # VTK's first axis is the one that runs fastest
    image.GetPointData().SetScalars(vtk("util.numpy_support").numpy_to_vtk(flat))
    filter_.SetInputData(image)
    filter_.SetValue(0, level)
    filter_.ComputeNormalsOff()
    filter_.ComputeScalarsOff()
    vertices, faces = triangles_of(filter_)
    return vertices[:, ::-1], faces
