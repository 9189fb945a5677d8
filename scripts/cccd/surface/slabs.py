"""Surfaces of volumes that are larger than memory: slab by slab, joined without a seam.

Each slab is read with some slices more to either side. What is kept of it depends on none beyond these, so
that neighbours agree on the slice between them to the last bit. The surface is where the signed distances
vanish to which `cccd.surface.spline` fits its spline, smoothed as a mesh; it is not that spline, which is
fitted as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage
from scipy.sparse import coo_array, diags_array

from cccd.containers import Frame, Structure
from cccd.contours import trace_contours
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, SingleArray
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import LoftSettings
from cccd.surface.learned_distance import RANGE, REACH
from cccd.surface.sampled import NODE_MARGIN, SampledDistance
from cccd.surface.stack import interpolate_slices

__all__ = ["LEAST_SLAB", "Piece", "Window", "find_window", "loft_slabs"]

#: Distances depend on so many slices beyond theirs. Of cubes the stacks across these count, too: there
#: `cccd.surface.learned_distance` looks so far, at distances that go no further.
_OVERLAP_SLICES = REACH + int(RANGE) + 1

#: Pairs of steps, and their factors, by which a mesh is smoothed without shrinking (Taubin 1995): these take
#: the steps of pixels off, and pass what is longer than about ten of them ...
_ROUNDS, _SHRINK, _GROW = 10, 0.5, -0.53
#: ... and so many slices to either side count, and less than 0.001 pixels beyond.
_SMOOTHED_SLICES = 16

#: Fewer slices would be read several times over.
LEAST_SLAB = 8

#: Pixels around the organ in which distances are kept.
_MARGIN = 8

#: A plane cap where the scan cuts is this thick before it is made flat, in levels.
_CAP = 1e-6


@dataclass(frozen=True)
class Window:
    """Where an organ lies: slices ``first`` to ``last``, pixels ``low`` to ``high``, all included."""

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
    read: Reader, frame: Frame, window: Window, slab: int, lofting: LoftSettings
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
    lofting : LoftSettings
        Section ``surface`` of the configuration.

    Yields
    ------
    Piece
        Together they are one closed surface, but for parts smaller than ``surface.smallest_part_voxels``.
    """
    smallest = lofting.smallest_part_voxels
    shared: SingleArray | None = None
    seam = _Seam()
    for low in range(window.first, window.last + 1, slab):
        high = low + slab
        reach = _OVERLAP_SLICES + _SMOOTHED_SLICES
        first, last = max(low - reach, 0), min(high + reach, frame.shape[0])
        mask = _without_small(read(first, last), smallest, (first == 0, last == frame.shape[0]))
        levels = _levels(mask, first, frame, window, lofting)
        step = frame.slice_spacing
        bottom = None if low == window.first else low * step
        top = None if high > window.last else high * step
        around = ((low - _SMOOTHED_SLICES) * step, (high + _SMOOTHED_SLICES) * step)
        part = levels.between(*around).through(bottom, shared).through(top)
        shared = None if top is None else part.at(top)
        piece = seam.joined(part, (bottom, top), window, frame)
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
    ends: tuple[float, float] = (-np.inf, np.inf)  # where the scan cuts

    def at(self, height: float) -> SingleArray:
        """Distances (I, J) at a height, linear between levels; far outside beyond them."""
        above = int(np.searchsorted(self.z, height))
        if above < len(self.z) and self.z[above] == height:
            return self.values[above]
        if not 0 < above < len(self.z):
            return np.full(self.values.shape[1:], self.far, np.float32)
        share = np.float32((height - self.z[above - 1]) / (self.z[above] - self.z[above - 1]))
        return self.values[above - 1] * (1 - share) + self.values[above] * share

    def between(self, low: float, high: float) -> _Levels:
        """Take the levels from one height to another."""
        inside = (self.z >= low) & (self.z <= high)
        return replace(self, z=self.z[inside], values=self.values[inside])

    def through(self, height: float | None, values: SingleArray | None = None) -> _Levels:
        """Add a level at a height, or replace the one there; its values are those of `at` by default."""
        if height is None:
            return self
        values = self.at(height) if values is None else values
        others = self.z != height
        place = int(np.searchsorted(self.z[others], height))
        return replace(
            self,
            z=np.insert(self.z[others], place, height),
            values=np.insert(self.values[others], place, values, axis=0),
        )


def _levels(mask: BoolArray, first: int, frame: Frame, window: Window, lofting: LoftSettings) -> _Levels:
    """Distances of a slab whose first slice is ``first``, closed by levels outside at both ends."""
    shape = tuple(high - low + 1 + 2 * _MARGIN for low, high in zip(window.low, window.high, strict=True))
    far = RANGE * float(np.sqrt(frame.pixel_spacing.prod()))
    if not mask.any():
        return _Levels(np.zeros(0), np.zeros((0, *shape), np.float32), far)
    structure = Structure("slab", "slab", frame, np.array([first, 0, 0]), mask=mask)
    stack = interpolate_slices(structure.sections(trace_contours(structure)[0]), lofting)
    distance = stack.distance
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
    return _Levels(z, placed, far, distance.ends)


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
    """Makes meshes of slabs, and gives the vertices on the plane between two of them one number and place."""

    def __init__(self) -> None:
        self._count = 0
        self._known: dict[tuple[float, float], tuple[int, FloatArray]] = {}

    def joined(
        self, levels: _Levels, limits: tuple[float | None, float | None], window: Window, frame: Frame
    ) -> Piece | None:
        """Make the mesh between two levels, smoothed with what lies around; None for no limit."""
        known, self._known = self._known, {}
        z, values = levels.z, levels.values
        margin = np.float32(NODE_MARGIN * levels.far / RANGE)
        values = np.copysign(np.maximum(np.abs(values), margin), values)
        if len(z) < 2 or not np.any(values < 0):
            return None
        rough = ScalarGrid(values, np.eye(4)).isosurface(0.0)
        low, high = (
            end if limit is None else float(np.searchsorted(z, limit))
            for end, limit in zip((-1.0, float(len(z))), limits, strict=True)
        )
        cell = np.floor(rough.vertices[rough.faces, 0].mean(axis=1))
        kept = rough.faces[(cell >= low) & (cell < high)]
        if not len(kept):
            return None
        smooth = _smoothed(_in_world(rough, z, window, frame), _on_ends(rough, levels), rough.faces)
        used, faces = np.unique(kept, return_inverse=True)
        place, vertices = rough.vertices[used], smooth[used]
        numbers = np.full(len(used), -1)
        for n in np.flatnonzero(place[:, 0] == low):
            if _place(place[n]) in known:
                numbers[n], vertices[n] = known[_place(place[n])]
        fresh = numbers < 0
        numbers[fresh] = self._count + np.arange(np.count_nonzero(fresh))
        self._count += int(np.count_nonzero(fresh))
        for n in np.flatnonzero(place[:, 0] == high):
            self._known[_place(place[n])] = int(numbers[n]), vertices[n]
        mesh = Mesh(vertices, faces.reshape(-1, 3).astype(np.int64))
        mirrored = np.linalg.det(frame.stack_affine[:3, :3]) < 0
        return Piece(mesh.reversed() if mirrored else mesh, numbers, fresh)


def _on_ends(rough: Mesh, levels: _Levels) -> BoolArray:
    """Mark vertices (V,) where the scan cuts."""
    height = np.interp(rough.vertices[:, 0], np.arange(len(levels.z)), levels.z)
    near = 10 * _CAP * levels.far
    return np.asarray(np.any([np.abs(height - end) < near for end in levels.ends], axis=0), np.bool_)


def _smoothed(points: FloatArray, fixed: BoolArray, faces: IntArray) -> FloatArray:
    """Move vertices (V, 3) towards their neighbours' means and away from them, in turns."""
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    both = np.unique(np.concatenate([ends, ends[:, ::-1]]), axis=0)
    links = coo_array((np.ones(len(both)), both.T), shape=(len(points), len(points))).tocsr()
    mean = diags_array(1 / np.maximum(links.sum(axis=1), 1)) @ links
    for factor in _ROUNDS * (_SHRINK, _GROW):
        points = points + np.where(fixed, 0.0, factor)[:, None] * (mean @ points - points)
    return points


def _place(vertex: FloatArray) -> tuple[float, float]:
    return float(vertex[1]), float(vertex[2])


def _in_world(mesh: Mesh, z: FloatArray, window: Window, frame: Frame) -> FloatArray:
    """Vertices (V, 3) in mm RAS of a mesh in levels and pixels of a window."""
    index = np.empty_like(mesh.vertices)
    index[:, :2] = mesh.vertices[:, 1:] + np.array(window.low) - _MARGIN
    index[:, 2] = np.interp(mesh.vertices[:, 0], np.arange(len(z)), z) / frame.slice_spacing
    return index @ frame.stack_affine[:3, :3].T + frame.stack_affine[:3, 3]
