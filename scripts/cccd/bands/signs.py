"""What can be seen at a vertex of a surface of how far off it may be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from cccd.geometry.arrays import FloatArray, SingleArray
from cccd.geometry.mesh import Mesh

#: The signs of a vertex, in the columns' order, as logarithms; lengths are in pixels.
SIGNS = (
    "slope",  # how far the slices lie apart along the normal, most in the middle of the gap
    "thick",  # through the organ along the normal
    "curvature",  # mean over the surface, times the distance between slices
)
#: Lengths of no more than this many pixels tell nothing more.
LEAST_PIXELS = 0.05
#: Steps in pixels along the normal on which the organ's other side is sought; it counts as far as the last.
STEPS = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 14.0, 16.0)


@dataclass(frozen=True, eq=False)
class Slices:
    """Signed distances on the slices.

    Attributes
    ----------
    z : (S,) float64
        Heights in mm, ascending.
    distance : (S, I, J) float32
        mm, negative inside.
    spacing : (2,) float64
        mm per pixel along i and j.
    """

    z: FloatArray
    distance: SingleArray
    spacing: FloatArray

    @property
    def pixel(self) -> float:
        """Edge length of a pixel in mm (the geometric mean of its two)."""
        return float(np.sqrt(self.spacing.prod()))

    @property
    def step(self) -> float:
        """Median distance of neighbouring slices in mm; a pixel's edge where there is one slice."""
        return float(np.median(np.diff(self.z))) if len(self.z) > 1 else self.pixel

    @property
    def ratio(self) -> float:
        """Distance between slices in pixels."""
        return self.step / self.pixel


def signs_of(mesh: Mesh, slices: Slices) -> FloatArray:
    """See what there is at the vertices of a closed mesh: (V, len(SIGNS)).

    Parameters
    ----------
    mesh : Mesh
        In the plane's mm and height, as the slices are.
    slices : Slices
    """
    z, points, normal = slices.z, mesh.vertices, mesh.vertex_normals
    below = np.searchsorted(z, points[:, 2], side="right").astype(np.int64) - 1
    ends = np.concatenate([[z[0] - slices.step], z, [z[-1] + slices.step]])
    low, high = ends[below + 1], ends[below + 2]
    gap = high - low
    share = np.clip((points[:, 2] - low) / gap, 0, 1)
    pixels = {
        "slope": 4 * share * (1 - share) * gap * np.abs(normal[:, 2]) / slices.pixel,
        "thick": _thickness(points, normal, slices),
        "curvature": np.full(len(points), mesh.curvature_per_area * slices.step),
    }
    return np.log(np.column_stack([pixels[name] for name in SIGNS]) + LEAST_PIXELS)


def _thickness(points: FloatArray, normal: FloatArray, slices: Slices) -> FloatArray:
    """Pixels (P,) from points on a surface along their normals through the organ, to its other side."""
    heights = np.arange(len(slices.z))
    found, nearer, held = np.full(len(points), STEPS[-1]), 0.0, np.zeros(len(points))
    for step in STEPS:
        there = points - step * slices.pixel * normal
        index = [np.interp(there[:, 2], slices.z, heights), *(there[:, :2] / slices.spacing).T]
        off = scipy.ndimage.map_coordinates(slices.distance, index, float, order=1, mode="nearest")
        off = np.maximum(off, np.maximum(slices.z[0] - there[:, 2], there[:, 2] - slices.z[-1]))
        out = (off > 0) & (found == STEPS[-1])
        share = np.divide(held, held + off, out=np.zeros(len(points)), where=out)
        found = np.where(out, nearer + share * (step - nearer), found)
        nearer, held = step, np.maximum(-off, 0)
    return found
