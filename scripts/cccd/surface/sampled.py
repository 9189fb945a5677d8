"""The organ's boundary as signed distances on a grid of the slices' pixels and of levels between the slices.

Distances are in mm, negative inside; positions are in the plane's mm and height in mm, as everywhere in
`cccd.surface`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from cccd.geometry.arrays import FloatArray, IntArray, SingleArray
from cccd.geometry.distance import to_mask
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh

#: The surface does not run through the grid's nodes, but at least this share of a pixel beside them.
NODE_MARGIN = 1e-2


@dataclass(frozen=True, eq=False)
class SampledDistance:
    """Signed distances at the nodes of a grid, linear between them.

    Attributes
    ----------
    values : (L, I, J) float32
        mm, negative inside.
    z : (L,) float64
        Heights of the levels in mm, ascending.
    spacing : (2,) float64
        mm per pixel along i and j.
    ends : (float, float)
        Heights at which the scan cuts the organ below and above; infinite where it does not.
    """

    values: SingleArray
    z: FloatArray
    spacing: FloatArray
    ends: tuple[float, float]

    @property
    def pixel(self) -> float:
        """Edge length of a pixel in mm (the geometric mean of its two)."""
        return float(np.sqrt(self.spacing.prod()))

    @property
    def level_step(self) -> float:
        """Distance between levels in mm."""
        return float(np.median(np.diff(self.z))) if len(self.z) > 1 else self.pixel

    def __call__(self, points: FloatArray) -> FloatArray:
        """Distances (P,) in mm at points (P, 3); beyond the grid they grow."""
        index = np.empty((3, len(points)))
        index[0] = np.interp(points[:, 2], self.z, np.arange(len(self.z)))
        index[1:] = (points[:, :2] / self.spacing).T
        beyond = np.maximum(np.maximum(self.z[0] - points[:, 2], points[:, 2] - self.z[-1]), 0.0)
        return beyond + ndimage.map_coordinates(self.values, index, order=1, mode="nearest", output=float)

    def zero_surface(self) -> Mesh:
        """Mesh the surface at distance zero: closed, oriented outwards, not cut where the scan ends.

        Raises
        ------
        ValueError
            When no distance is negative.
        """
        values = np.pad(self.values, 1, constant_values=np.float32(self.pixel))
        margin = np.float32(NODE_MARGIN * self.pixel)
        values = np.copysign(np.maximum(np.abs(values), margin), values)
        mesh = ScalarGrid(values, np.eye(4), (-1, -1, -1)).isosurface(0.0)
        levels = np.arange(-1, len(self.z) + 1)
        heights = np.concatenate([[self.z[0] - self.level_step], self.z, [self.z[-1] + self.level_step]])
        vertices = np.empty_like(mesh.vertices)
        vertices[:, :2] = mesh.vertices[:, 1:] * self.spacing
        vertices[:, 2] = np.interp(mesh.vertices[:, 0], levels, heights)
        return Mesh(vertices, mesh.faces).outwards()


def distance_to_part(distance: SingleArray, parts: IntArray, number: int, spacing: FloatArray) -> SingleArray:
    """Signed distances (I, J) in mm to one of a plane's connected parts.

    Parameters
    ----------
    distance : (I, J) float32
        To all parts, negative inside.
    parts : (I, J) int64
        Their numbers, 0 outside.
    number : int
    spacing : (2,) float64
        mm per pixel.
    """
    others = (parts > 0) & (parts != number)
    if not others.any():
        return distance
    own = to_mask(parts == number, spacing)
    return np.where(own <= to_mask(others, spacing), distance, own)


def sampled(plane: SingleArray, places: FloatArray) -> SingleArray:
    """Values (N,) of a plane (I, J) at places (N, 2) in pixels; beyond it, of its border."""
    return np.asarray(ndimage.map_coordinates(plane, places.T, np.float32, order=1, mode="nearest"))
