"""The organ's boundary as signed distances on a grid of the slices' pixels and of levels between the slices.

What the spline surface is fitted to. Distances are in mm, negative inside; positions are in the plane's mm
and height in mm, as everywhere in `cccd.surface`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.sparse import csr_array

from cccd.geometry.arrays import FloatArray, SingleArray
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.surface.stack import SliceStack
from cccd.surface.target import TargetField, smoothing_weights

__all__ = ["SampledDistance"]

#: The surface does not run through the grid's nodes, but at least this share of a pixel beside them.
NODE_MARGIN = 1e-4
#: Distances of more pixels count as this far.
FAR_PIXELS = 6.0
#: Slopes are taken between points so many pixels before and behind.
SLOPE_PIXELS = 0.5


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

    @classmethod
    def of(cls, stack: SliceStack) -> SampledDistance:
        """Sample what the slices tell, smoothed by as much as pixels and slices have steps."""
        target = stack.target
        outlines = target if isinstance(target, TargetField) else target.outlines
        z, spacing = outlines.z, outlines.spacing
        if target is outlines:
            planes = _in_space(np.stack(outlines.planes), z, FAR_PIXELS * stack.pixel)
            values = _smoothed(planes, z, outlines.knot, stack.pixel)
        else:
            shape = outlines.planes[0].shape
            pixels = np.indices(shape).reshape(2, -1).T * spacing
            planes = [target(np.column_stack([pixels, np.full(len(pixels), h)])).reshape(shape) for h in z]
            values = np.stack(planes).astype(np.float32)
        return cls(values, z, spacing, stack.cut_heights)

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

    def slopes(self, points: FloatArray, directions: FloatArray) -> FloatArray:
        """How fast (P,) distances grow at points (P, 3) along unit vectors (P, 3)."""
        step = SLOPE_PIXELS * self.pixel * directions
        return (self(points + step) - self(points - step)) / (2 * SLOPE_PIXELS * self.pixel)

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


def _in_space(planes: SingleArray, z: FloatArray, far: float) -> SingleArray:
    """Turn distances within planes (L, I, J) into ones in space, to first order, of at most ``far`` mm."""
    if len(z) == 1:
        return planes
    rise = np.abs(np.diff(planes, axis=0)) / np.diff(z).astype(np.float32)[:, None, None]
    slope = np.minimum(np.concatenate([rise[:1], rise]), np.concatenate([rise, rise[-1:]]))
    return np.clip(planes / np.sqrt(1 + slope**2), -far, far).astype(np.float32)


def _smoothed(planes: SingleArray, z: FloatArray, knot: float, pixel: float) -> SingleArray:
    """Planes (L, I, J) smoothed by a kernel that takes the steps of pixels and slices off them."""
    taps = np.arange(-int(2 * knot), int(2 * knot) + 1)
    across = smoothing_weights(taps / knot)
    for axis in (1, 2):
        planes = ndimage.correlate1d(planes, (across / across.sum()).astype(np.float32), axis, mode="nearest")
    if len(z) == 1:
        return planes
    thickness = np.minimum(np.gradient(z), knot * pixel)
    along = smoothing_weights((z[:, None] - z) / (knot * pixel)) * thickness
    along = csr_array((along / along.sum(axis=1, keepdims=True)).astype(np.float32))
    return np.asarray(along @ planes.reshape(len(z), -1), np.float32).reshape(planes.shape)
