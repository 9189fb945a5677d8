"""Signed distances: within slices to the border of what they show, and on a grid of pixels and levels.

The border of a mask is that of its pixels, so that nothing that a slice shows is too thin to have an inside.
Distances are in mm, negative inside; positions are in the plane's mm and height in mm, as everywhere in
`cccd.surface`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from cccd.containers import Curves, Sections
from cccd.errors import InputError
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, SingleArray
from cccd.geometry.distance import to_mask, to_polygons
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.geometry.polygons import RaggedPolygons
from cccd.geometry.raster import rasterise_layers

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


#: Distances reach this many pixels beyond what is inside: as far as the network distinguishes them.
MARGIN_PIXELS = 9


@dataclass(frozen=True, eq=False)
class Borders:
    """What slices show, as distances to its border.

    Attributes
    ----------
    slices : (S,) int64
        Source slices on which anything is, ascending.
    distance : (S, I, J) float32
        Within the slice, in mm, negative inside.
    origin : (2,) int64
        Source ``(i, j)`` of ``distance[0, 0, 0]``.
    areas : (S,) float64
        mm^2 inside.
    exact : bool
        Whether the border is known below the pixel: of contours and probabilities, not of masks.
    """

    slices: IntArray
    distance: SingleArray
    origin: IntArray
    areas: FloatArray
    exact: bool

    @property
    def inside(self) -> BoolArray:
        """Pixels (S, I, J) whose centres are inside."""
        return self.distance < 0

    def without(self, parts: BoolArray, spacing: FloatArray, side: int = 1) -> Borders:
        """Leave out some of the pixels (S, I, J) inside, whole parts of slices, or fill cavities (side -1).

        ``spacing`` (2,) are the edges of a pixel in mm.
        """
        distance, areas = np.float32(side) * self.distance, self.areas.copy()
        for number in np.flatnonzero(parts.any(axis=(1, 2))):
            gone, plane = parts[number], distance[number]
            areas[number] -= side * np.count_nonzero(gone) * float(spacing.prod())
            stays = (plane < 0) & ~gone
            if stays.any():
                others = to_mask(stays, spacing)
                nearer = to_mask(gone, spacing) <= others
                plane[nearer] = others[nearer]
            else:
                plane[:] = float(np.linalg.norm(gone.shape * spacing))
        distance *= np.float32(side)
        shown = (distance < 0).any(axis=(1, 2))
        return Borders(self.slices[shown], distance[shown], self.origin, areas[shown], self.exact)


def find_borders(sections: Sections, reach: IntArray | None = None) -> Borders:
    """Measure the distances of every slice.

    Parameters
    ----------
    sections : Sections
        A mask's pixels are their own border. Curves through the centres of pixels stand for these pixels;
        any others are the border itself.
    reach : (2, 2) int64, optional
        First and last source ``(i, j)`` that the distances shall reach beyond what is inside.

    Raises
    ------
    InputError
        Nothing is inside anything.
    """
    if sections.mask is not None:
        origin = np.asarray(sections.mask_origin)
        return _of_mask(sections.mask, origin, sections.curves.frame.pixel_spacing, reach)
    curves = sections.curves
    if len(curves) == 0:
        raise InputError("curves", "there is no closed curve", "check the mask or the boundary maps")
    first = np.floor(curves.points.min(axis=0)).astype(np.int64)
    size = np.ceil(curves.points.max(axis=0)).astype(np.int64) + 1 - first
    slices, layer = np.unique(curves.slice, return_inverse=True)
    polygons = RaggedPolygons(curves.points - first, curves.offsets)
    inside = rasterise_layers(polygons, layer, (len(slices), int(size[0]), int(size[1])))
    if not inside.any():
        raise InputError(
            "curves", "no curve goes around the centre of a pixel", "check the contours and the grid"
        )
    if through_pixel_centres(curves):
        found = _of_mask(inside, np.array([0, *first]), curves.frame.pixel_spacing, reach)
        return replace(found, slices=slices[found.slices].astype(np.int64))
    return _of_polygons(curves, slices.astype(np.int64), layer, reach)


def through_pixel_centres(curves: Curves) -> bool:
    """Report whether these are pixel chains (every point an integer), not drawn contours."""
    return bool(np.array_equal(curves.points, np.rint(curves.points)))


def _of_mask(mask: BoolArray, origin: IntArray, spacing: FloatArray, reach: IntArray | None) -> Borders:
    """Distances to the borders of a mask's pixels (S, I, J), whose first voxel is the source's ``origin``."""
    layers = np.flatnonzero(mask.any(axis=(1, 2)))
    if len(layers) == 0:
        raise InputError("curves", "there is no closed curve", "check the mask or the boundary maps")
    inside = mask.any(axis=0)
    rows, columns = np.flatnonzero(inside.any(axis=-1)), np.flatnonzero(inside.any(axis=0))
    ends = np.array([[rows[0], columns[0]], [rows[-1], columns[-1]]]) + origin[1:]
    first, last = _around(ends, reach)
    size = last + 1 - first
    at, skipped = np.maximum(origin[1:] - first, 0), np.maximum(first - origin[1:], 0)
    distance = np.empty((len(layers), *size), np.float32)
    plane = np.zeros(size, np.bool_)
    for number, layer in enumerate(layers):
        seen = mask[layer, skipped[0] :, skipped[1] :][: size[0] - at[0], : size[1] - at[1]]
        plane[at[0] : at[0] + seen.shape[0], at[1] : at[1] + seen.shape[1]] = seen
        distance[number] = to_mask(plane, spacing)
    areas = np.count_nonzero(mask[layers], axis=(1, 2)) * float(spacing.prod())
    return Borders((layers + origin[0]).astype(np.int64), distance, first, areas, False)


def _of_polygons(curves: Curves, slices: IntArray, layer: IntArray, reach: IntArray | None) -> Borders:
    """Distances to polygons that are the border."""
    ends = np.stack([np.floor(curves.points.min(axis=0)), np.ceil(curves.points.max(axis=0))])
    first, last = _around(ends.astype(np.int64), reach)
    spacing = curves.frame.pixel_spacing
    rows, columns = map(int, last + 1 - first)
    moved = RaggedPolygons(np.asarray(curves.points - first, float), curves.offsets)
    inside = rasterise_layers(moved, layer, (len(slices), rows, columns))
    in_mm = RaggedPolygons(moved.points * spacing, curves.offsets)
    distance = np.empty(inside.shape, np.float32)
    for number in range(len(slices)):
        here = layer == number
        own = in_mm.take(here)
        distance[number] = to_polygons(inside[number], own, spacing)
    areas = np.abs(in_mm.signed_areas) * np.where(curves.hole, -1.0, 1.0)
    return Borders(slices, distance, first, np.bincount(layer, areas, len(slices)).astype(float), True)


def _around(ends: IntArray, reach: IntArray | None) -> tuple[IntArray, IntArray]:
    """First and last source (i, j) of distances around what lies between two (2, 2)."""
    low, high = ends if reach is None else (np.minimum(ends[0], reach[0]), np.maximum(ends[1], reach[1]))
    return low - MARGIN_PIXELS, high + MARGIN_PIXELS
