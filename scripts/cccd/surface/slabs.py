"""Surfaces of volumes that are larger than memory: slab by slab, joined without a seam.

Each slab is read with some slices more to either side. What is kept of it depends on none beyond these, so
that neighbours agree on the slice between them to the last bit. The surface is where the signed distances
vanish to which `cccd.surface.spline` fits its spline; it is not that spline, which is fitted as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from cccd.containers import Curves, Frame, Sections, Structure
from cccd.contours import trace_contours
from cccd.curves import describe_curves
from cccd.geometry.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    SingleArray,
    concatenate_ragged,
    split_ragged,
)
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.settings.curves import CurveSettings
from cccd.settings.surface import LoftSettings
from cccd.surface.outlines import Outlines, lofted_outlines
from cccd.surface.sampled import FAR_PIXELS, NODE_MARGIN, SampledDistance
from cccd.surface.stack import interpolate_slices

__all__ = ["LEAST_SLAB", "Piece", "Window", "find_window", "loft_slabs"]

#: Slices, and pixels, that a slab is read with to either side: distances depend on 3 slices or pixels beyond
#: theirs on an airway, and ends of parts on more.
_OVERLAP_SLICES, _OVERLAP_PIXELS = 12, 10.0

#: Fewer slices would be read several times over.
LEAST_SLAB = 8

#: Pixels around the organ in which distances are kept.
_MARGIN = 8

#: A plane cap where the scan cuts is this thick before it is made flat, in levels.
_CAP = 1e-6


@dataclass(frozen=True)
class Window:
    """Where an organ lies: slices ``first`` to ``last``, pixels ``low`` (2,) to ``high`` (2,), all included."""

    first: int
    last: int
    low: tuple[int, int]
    high: tuple[int, int]


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a surface, in mm RAS.

    Attributes
    ----------
    mesh : Mesh
        The part; open where it meets the next.
    numbers : (V,) int64
        Number of each vertex in the whole.
    fresh : (V,) bool
        Whether it has not been in a part before; these are numbered in their order.
    """

    mesh: Mesh
    numbers: IntArray
    fresh: BoolArray


#: Gives the organ (high - low, I, J) in slices ``low`` up to ``high``.
Reader = Callable[[int, int], BoolArray]


def find_window(read: Reader, slices: int, slab: int) -> Window | None:
    """Find where an organ lies, slab by slab; None where it is nowhere."""
    found: list[tuple[IntArray, IntArray]] = []
    for low in range(0, slices, slab):
        index = np.argwhere(read(low, min(low + slab, slices)))
        if len(index):
            index[:, 0] += low
            found.append((index.min(axis=0), index.max(axis=0)))
    if not found:
        return None
    low = np.min([first for first, _ in found], axis=0)
    high = np.max([last for _, last in found], axis=0)
    return Window(int(low[0]), int(high[0]), (int(low[1]), int(low[2])), (int(high[1]), int(high[2])))


def loft_slabs(
    read: Reader, frame: Frame, window: Window, slab: int, fitting: CurveSettings, lofting: LoftSettings
) -> Iterator[Piece]:
    """Make the surface of an organ, slab by slab.

    Parameters
    ----------
    read : callable
        Gives the organ (high - low, I, J) in slices ``low`` up to ``high``.
    frame : Frame
        Of the whole volume; slices run along its ``slice_axis``, which is 0.
    window : Window
        Where the organ lies, see `find_window`.
    slab : int
        Slices of a slab; the surface does not depend on it.
    fitting, lofting
        Sections ``curves`` and ``surface`` of the configuration.

    Yields
    ------
    Piece
        Together they are one closed surface, but for parts smaller than ``surface.smallest_part_voxels``.
    """
    pixel = float(np.sqrt(frame.pixel_spacing.prod()))
    overlap = max(_OVERLAP_SLICES, int(np.ceil(_OVERLAP_PIXELS * pixel / frame.slice_spacing)))
    smallest = lofting.smallest_part_voxels
    shared: SingleArray | None = None
    seam = _Seam()
    for low in range(window.first, window.last + 1, slab):
        high = low + slab
        first, last = max(low - overlap, 0), min(high + overlap, frame.shape[0])
        mask = _without_small(read(first, last), smallest, (first == 0, last == frame.shape[0]))
        levels = _levels(mask, first, frame, window, fitting, lofting)
        top = None if high > window.last else high * frame.slice_spacing
        z, values = levels.between(None if shared is None else low * frame.slice_spacing, top, shared)
        shared = None if top is None else values[-1]
        piece = seam.joined(z, values, window, frame)
        if piece is not None:
            yield piece


def _without_small(mask: BoolArray, least: float, is_end: tuple[bool, bool]) -> BoolArray:
    """Leave out parts of fewer voxels that lie wholly in the slab."""
    parts, count = ndimage.label(mask, ndimage.generate_binary_structure(3, 3))
    size = np.bincount(parts.ravel(), minlength=count + 1)
    kept = size >= least
    for layer, ends in ((parts[0], is_end[0]), (parts[-1], is_end[1])):
        if not ends:
            kept[layer] = True
    kept[0] = False
    return kept[parts]


# Distances --------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Levels:
    """Signed distances (L, I, J) in mm in a window, on levels at heights (L,)."""

    z: FloatArray
    values: SingleArray
    far: float

    def at(self, height: float) -> SingleArray:
        """Distances (I, J) at a height, linear between levels; far outside beyond them."""
        above = int(np.searchsorted(self.z, height))
        if above < len(self.z) and self.z[above] == height:
            return self.values[above]
        if not 0 < above < len(self.z):
            return np.full(self.values.shape[1:], self.far, np.float32)
        share = np.float32((height - self.z[above - 1]) / (self.z[above] - self.z[above - 1]))
        return self.values[above - 1] * (1 - share) + self.values[above] * share

    def between(
        self, low: float | None, high: float | None, shared: SingleArray | None
    ) -> tuple[FloatArray, SingleArray]:
        """Take the levels between two heights, and those at them; ``shared`` is the one at the lower."""
        inside = np.ones(len(self.z), bool)
        if low is not None:
            inside &= self.z > low
        if high is not None:
            inside &= self.z < high
        z, values = [self.z[inside]], [self.values[inside]]
        if low is not None and shared is not None:
            z, values = [np.array([low]), *z], [shared[None], *values]
        if high is not None:
            z, values = [*z, np.array([high])], [*values, self.at(high)[None]]
        return np.concatenate(z), np.concatenate(values)


def _levels(
    mask: BoolArray, first: int, frame: Frame, window: Window, fitting: CurveSettings, lofting: LoftSettings
) -> _Levels:
    """Distances of a slab whose first slice is ``first``, closed by levels outside at both ends."""
    shape = tuple(high - low + 1 + 2 * _MARGIN for low, high in zip(window.low, window.high, strict=True))
    far = FAR_PIXELS * float(np.sqrt(frame.pixel_spacing.prod()))
    if not mask.any():
        return _Levels(np.zeros(0), np.zeros((0, *shape), np.float32), far)
    structure = Structure("slab", "slab", frame, np.array([first, 0, 0]), mask=mask)
    curves, _ = trace_contours(structure)
    outlines = _outlines_by_slice(curves, fitting, lofting)
    stack = interpolate_slices(outlines, Sections(curves), lofting)
    distance = SampledDistance.of(stack)
    z, values = _capped(distance, far)
    start = stack.origin - np.array(window.low) + _MARGIN
    placed = np.full((len(z), *shape), far, np.float32)
    ours, theirs = zip(
        *(
            (slice(max(a, 0), min(a + n, m)), slice(max(-a, 0), min(n, m - a)))
            for a, n, m in zip(start.tolist(), values.shape[1:], shape, strict=True)
        ),
        strict=True,
    )
    placed[(slice(None), *ours)] = values[(slice(None), *theirs)]
    return _Levels(z, placed, far)


def _outlines_by_slice(curves: Curves, fitting: CurveSettings, lofting: LoftSettings) -> Outlines:
    """Fit splines to each slice by itself: fitted together, they differ in rounding from slab to slab."""
    parts: list[Outlines] = []
    for number in np.unique(curves.slice):
        own = curves.slice == number
        polygons = curves.polygons.take(own)
        slice_ = Curves(polygons.points, polygons.offsets, curves.slice[own], curves.hole[own], curves.frame)
        fitted = describe_curves(slice_, fitting)
        parts.append(lofted_outlines(Sections(fitted.curves, fitted.splines), lofting))
    rings = [ring for part in parts for ring in split_ragged(part.curves.points, part.curves.offsets)]
    points, offsets = concatenate_ragged(rings)
    numbers = np.concatenate([part.curves.slice for part in parts])
    holes = np.concatenate([part.curves.hole for part in parts])
    return Outlines(
        Curves(points, offsets, numbers, holes, curves.frame),
        np.concatenate([part.outwards for part in parts]),
        np.concatenate([part.areas for part in parts]),
        parts[0].of_pixels,
    )


def _capped(distance: SampledDistance, far: float) -> tuple[FloatArray, SingleArray]:
    """Levels of distances, cut where the scan ends, with one outside the organ below and above."""
    low, high = distance.ends
    inside = (distance.z > low) & (distance.z < high)
    levels = _Levels(distance.z, distance.values, far)
    z, values = distance.z[inside], distance.values[inside]
    thin, step = _CAP * distance.level_step, distance.level_step
    outside = np.full((1, *values.shape[1:]), far, np.float32)
    if np.isfinite(low):
        z, values = np.concatenate([[low], z]), np.concatenate([levels.at(low)[None], values])
    if np.isfinite(high):
        z, values = np.concatenate([z, [high]]), np.concatenate([values, levels.at(high)[None]])
    below, above = z[0] - (thin if np.isfinite(low) else step), z[-1] + (thin if np.isfinite(high) else step)
    return np.concatenate([[below], z, [above]]), np.concatenate([outside, values, outside])


# Meshes -----------------------------------------------------------------------------------------------


class _Seam:
    """Makes meshes of slabs, and gives the vertices on the plane between two of them one number."""

    def __init__(self) -> None:
        self._count = 0
        self._numbers: dict[tuple[float, float], int] = {}

    def joined(self, z: FloatArray, values: SingleArray, window: Window, frame: Frame) -> Piece | None:
        """Make the mesh of levels; its first plane is the last one of the slab before."""
        known, self._numbers = self._numbers, {}
        pixel = float(np.sqrt(frame.pixel_spacing.prod()))
        margin = np.float32(NODE_MARGIN * pixel)
        values = np.copysign(np.maximum(np.abs(values), margin), values)
        if len(z) < 2 or not np.any(values < 0):
            return None
        mesh = ScalarGrid(values, np.eye(4)).isosurface(0.0)
        numbers = np.full(len(mesh.vertices), -1)
        for n in np.flatnonzero(mesh.vertices[:, 0] == 0):
            numbers[n] = known.get(_place(mesh.vertices[n]), -1)
        fresh = numbers < 0
        numbers[fresh] = self._count + np.arange(np.count_nonzero(fresh))
        self._count += int(np.count_nonzero(fresh))
        for n in np.flatnonzero(mesh.vertices[:, 0] == len(z) - 1):
            self._numbers[_place(mesh.vertices[n])] = int(numbers[n])
        return Piece(_in_world(mesh, z, window, frame), numbers, fresh)


def _place(vertex: FloatArray) -> tuple[float, float]:
    return float(vertex[1]), float(vertex[2])


def _in_world(mesh: Mesh, z: FloatArray, window: Window, frame: Frame) -> Mesh:
    """Mesh in mm RAS of one in levels and pixels of a window."""
    index = np.empty_like(mesh.vertices)
    index[:, :2] = mesh.vertices[:, 1:] + np.array(window.low) - _MARGIN
    index[:, 2] = np.interp(mesh.vertices[:, 0], np.arange(len(z)), z) / frame.slice_spacing
    return replace(mesh, vertices=index).transformed(frame.stack_affine)
