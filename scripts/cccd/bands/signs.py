"""What tells at a vertex how far the surface may be off: slices, slope, curvature, two interpolations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from cccd.geometry.arrays import FloatArray, IntArray, SingleArray
from cccd.geometry.distance import to_mask
from cccd.geometry.mesh import Mesh

__all__ = ["SIGNS", "Signs", "Slices"]

#: The signs of a side of a vertex, in the columns' order; lengths are in pixels, most as logarithms.
SIGNS = (
    "gap",  # between the slices beside the vertex
    "slope",  # how far the slices lie apart along the normal, most in the middle of the gap
    "bend",  # second difference of distances across the slices, most in the middle of the gap
    "move",  # how far the contour moves from slice to slice
    "linear",  # off the linear interpolation of distances
    "pixels",  # off the linear interpolation of distances to the pixels' borders
    "curvature",
    "outside",  # how far outside the vertex lies on one of the slices beside
    "inside",  # how far inside
    "beyond",  # whether it lies beyond the first or last slice
    "organ_linear",  # means over the surface
    "organ_pixels",
    "organ_bend",
    "organ_curvature",
    "organ_size",  # volume by area, in slice distances
    "side_linear",  # the same with a sign: positive where the other surface lies on this side
    "side_pixels",
    "side_bend",
    "side_curvature",
    "side_end",  # beyond the last slice, facing away from it
    "side_slice",  # along the normal to the slice on this side
)
#: Lengths of no more than this many pixels tell nothing more.
LEAST_PIXELS = 0.05
#: Signed distances between two interpolations count up to so many pixels, bends up to so many.
MOST_PIXELS, MOST_BEND = 3.0, 6.0
#: Rounds of averaging the curvature with that of the neighbours.
CURVATURE_ROUNDS = 6
#: Along the normal a slice lies at most this many gaps away.
MOST_GAPS = 3.0
#: Walls and lids have no less of a normal along, or across, the slices.
LEAST_NORMAL = 0.05


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
    of_pixels : bool
        Whether distances are those to the borders of pixels.
    """

    z: FloatArray
    distance: SingleArray
    spacing: FloatArray
    of_pixels: bool = False

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


@dataclass(frozen=True, eq=False)
class Signs:
    """The signs of a mesh's vertices.

    Attributes
    ----------
    outer, inner : (V, len(SIGNS)) float64
        On the outer and on the inner side of the surface.
    """

    outer: FloatArray
    inner: FloatArray

    @classmethod
    def of(cls, mesh: Mesh, slices: Slices) -> Signs:
        """See what there is at the vertices of a closed mesh in the plane's mm and height."""
        z, pixel, points, count = slices.z, slices.pixel, mesh.vertices, len(slices.z)
        normal = mesh.vertex_normals
        below = np.searchsorted(z, points[:, 2], side="right").astype(np.int64) - 1
        ends = np.concatenate([[z[0] - slices.step], z, [z[-1] + slices.step]])
        low, high = ends[below + 1], ends[below + 2]
        gap = high - low
        share = np.clip((points[:, 2] - low) / gap, 0, 1)
        middle = 4 * share * (1 - share)
        across = np.sqrt(np.maximum(1 - normal[:, 2] ** 2, LEAST_NORMAL**2))
        beyond = (below < 0) | (below == count - 1)

        plane = (points[:, :2] / slices.spacing).T

        def at(planes: SingleArray, k: IntArray) -> FloatArray:
            index = [np.clip(k, 0, count - 1), *plane]
            return ndimage.map_coordinates(planes, index, order=1, mode="nearest").astype(float)

        def between(lower: FloatArray, upper: FloatArray) -> FloatArray:
            return (1 - share) * lower + share * upper

        pixels = slices.distance
        if not slices.of_pixels:
            pixels = np.stack([to_mask(level < 0, slices.spacing) for level in slices.distance])
        before, lower, upper, after = (at(slices.distance, below + n) for n in (-1, 0, 1, 2))
        low_bend = np.where((below > 0) & ~beyond, before - 2 * lower + upper, 0.0) * across
        high_bend = np.where((below + 2 < count) & ~beyond, lower - 2 * upper + after, 0.0) * across
        bend = middle * np.maximum(np.abs(low_bend), np.abs(high_bend))
        curvature = _curvature(mesh)
        off = {
            "linear": between(lower, upper) * across / pixel,
            "pixels": between(at(pixels, below), at(pixels, below + 1)) * across / pixel,
            "bend": middle * between(low_bend, high_bend) / pixel,
            "curvature": curvature * middle * gap**2 / pixel,
        }
        most = {"linear": MOST_PIXELS, "pixels": MOST_PIXELS, "bend": MOST_BEND, "curvature": MOST_BEND}
        off = {name: np.clip(value, -most[name], most[name]) for name, value in off.items()}
        area = mesh.vertex_areas
        mean = _Mean(area / area.sum())
        both = {
            "gap": np.log(gap / pixel),
            "slope": _logarithm(middle * gap * np.abs(normal[:, 2]) / pixel),
            "bend": _logarithm(bend / pixel),
            "move": _logarithm(np.minimum(np.abs(upper - lower) * across, 4 * gap) / pixel),
            "linear": _logarithm(np.abs(off["linear"])),
            "pixels": _logarithm(np.abs(off["pixels"])),
            "curvature": _logarithm(np.abs(curvature) * gap),
            "outside": _logarithm(np.maximum(np.maximum(lower, upper), 0) / pixel),
            "inside": _logarithm(np.maximum(-np.minimum(lower, upper), 0) / pixel),
            "beyond": beyond.astype(float),
            "organ_linear": mean(np.abs(off["linear"])),
            "organ_pixels": mean(np.abs(off["pixels"])),
            "organ_bend": mean(np.minimum(bend, MOST_GAPS * gap) / pixel),
            "organ_curvature": mean(np.abs(curvature) * slices.step),
            "organ_size": mean(np.full(len(points), 3 * abs(mesh.volume) / mesh.area / slices.step)),
        }

        def side(way: int) -> FloatArray:
            upwards = way * normal[:, 2] > 0
            away = np.maximum(np.where(upwards, high - points[:, 2], points[:, 2] - low), 0)
            along = np.minimum(away / np.maximum(np.abs(normal[:, 2]), LEAST_NORMAL), MOST_GAPS * gap)
            # the other surface lies outside where its distance is negative
            signed = {f"side_{name}": -way * value for name, value in off.items()}
            end = {"side_end": way * beyond * np.abs(normal[:, 2]), "side_slice": _logarithm(along / pixel)}
            named = both | signed | end
            return np.column_stack([named[name] for name in SIGNS])

        return cls(side(1), side(-1))


@dataclass(frozen=True, eq=False)
class _Mean:
    """Logarithm of a mean over the surface, at every vertex; ``weights`` (V,) sum to one."""

    weights: FloatArray

    def __call__(self, values: FloatArray) -> FloatArray:
        return np.full(len(values), _logarithm(np.asarray(self.weights @ values)))


def _logarithm(pixels: FloatArray) -> FloatArray:
    return np.log(pixels + LEAST_PIXELS)


def _curvature(mesh: Mesh) -> FloatArray:
    """Mean of the normal curvatures (V,) along a vertex's edges in 1/mm, positive where it is convex."""
    start, end = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    way = mesh.vertices[end] - mesh.vertices[start]
    turn = mesh.vertex_normals[end] - mesh.vertex_normals[start]
    along = np.einsum("ec,ec->e", way, way)
    bent = np.divide(np.einsum("ec,ec->e", way, turn), along, out=np.zeros(len(way)), where=along > 0)
    count = np.maximum(np.bincount(start, minlength=len(mesh.vertices)), 1)
    mean = np.bincount(start, bent, len(mesh.vertices)) / count
    return mesh.averaged(mean, CURVATURE_ROUNDS)
