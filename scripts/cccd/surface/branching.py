"""Where a tube branches off a trunk: how far it reaches into the trunk, and what the trunk leaves to it.

On the levels beyond a junction the trunk's rings hold both. There a split line runs midway between the
branch and the rest. Over some depth the branch's sections end a little beyond that line, while the trunk
takes over the branch's part of the common outline step by step, up to a transition offset from the line
that grows with depth. So both run smoothly, their solids overlap, and their union is the organ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import shapely

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, RealArray, SingleArray
from cccd.geometry.contour_lines import zero_contours
from cccd.geometry.polygons import signed_area
from cccd.settings.surface import MatchingSettings
from cccd.surface.ring_graph import RingGraph
from cccd.surface.rings import Ring, overlap
from cccd.surface.stack import Run
from cccd.surface.tubes import Section

__all__ = ["Cut", "branch_off", "without_cuts"]

#: Levels of a junction, at least and at most.
JUNCTION_LEVELS = (2, 80)
#: A junction looks at least this many pixels beyond its outlines.
WINDOW_PIXELS = 8
#: Sections of less area in square pixels end a junction.
SMALLEST_SECTION_PIXELS = 4

#: A block of the plane's pixels.
Window = tuple[slice, slice]


@dataclass(frozen=True, eq=False)
class Cut:
    """What a trunk leaves to a branch on one level.

    Attributes
    ----------
    ring : Ring
        One of the trunk's.
    window : pair of slices
        Block of the plane's pixels.
    beyond : (a, b) float32
        mm by which the block's pixels lie beyond the transition offset; positive where the ring's
        outline gives way to the branch.
    """

    ring: Ring
    window: Window
    beyond: SingleArray


def branch_off(
    branch: Ring, way: int, graph: RingGraph, run: Run, settings: MatchingSettings
) -> tuple[list[Section], list[Cut]]:
    """Sections of a branch inside its trunk, and what the trunk's rings leave to it.

    Parameters
    ----------
    branch : Ring
        The branch's last ring before the junction; it touches a ring of the trunk.
    way : int
        The way from there into the trunk.
    graph, run
        The links between the levels' rings, and the levels.
    settings : MatchingSettings
        How steep and how deep junctions are.

    Returns
    -------
    sections : list of Section
        From the junction inwards; empty when nothing but the branch leads to the trunk.
    cuts : list of Cut
        One for each of the sections.
    """
    trunk = max(graph.touched(branch, way), key=lambda ring: overlap(branch, ring))
    before = [*graph.touched(trunk, 1 - way), graph.next(trunk, 1 - way)]
    others = [ring for ring in before if ring is not None and ring is not branch]
    if not others:
        return [], []
    path = graph.path(trunk, way, JUNCTION_LEVELS[1])
    window = _window([branch, *others, *path], run)
    distances, slope = _split_distances(
        branch, path, _Sides.of(branch, others, window, run.pixel), window, settings
    )
    sections: list[Section] = []
    cuts: list[Cut] = []
    for ring, distance in zip(path, distances, strict=False):
        offset = slope * abs(ring.z - branch.z)
        section = _branch_section(branch, ring, distance, offset, window, run, settings)
        if section is None or (sections and section.area < SMALLEST_SECTION_PIXELS * run.pixel**2):
            break
        sections.append(section)
        cuts.append(Cut(ring, window, distance - offset))
    return sections, cuts


def _branch_section(
    branch: Ring,
    common: Ring,
    distance: SingleArray,
    offset: float,
    window: Window,
    run: Run,
    settings: MatchingSettings,
) -> Section | None:
    """Section of a branch on the level of a common ring, ``distance`` mm from the split line, if any.

    It overlaps the trunk, and sinks below the trunk's surface where that has taken over.
    """
    overlapping, cover, fade = run.pixel * np.array(
        [settings.overlap_pixels, settings.cover_pixels, settings.fade_pixels]
    )
    covered = np.clip(settings.cover_slope * (offset - fade - distance), 0, cover)
    plane = np.maximum(run.field_inside(common)[window] + covered, -distance - overlapping)
    outline = _outline_around(plane, branch, run.spacing, (window[0].start, window[1].start))
    return None if outline is None else Section.of_outline(common.z, outline)


def without_cuts(ring: Ring, cuts: Sequence[Cut], run: Run, fade_pixels: float) -> Section:
    """Section of a trunk's ring without what it leaves to branches, sinking over ``fade_pixels``."""
    if not cuts:
        return Section.of_ring(ring)
    low = np.maximum(ring.bbox_min - 1, 0)  # what is left lies inside the ring
    plane = run.field_inside(ring)[tuple(map(slice, low, ring.bbox_max + 1))].copy()
    for cut in cuts:
        here, there = _common(cut.window, low, plane.shape)
        beyond = cut.beyond[there]
        sunk = np.clip(1 + beyond / (fade_pixels * run.pixel), 0, 1) * run.pixel
        plane[here] = np.maximum(plane[here] + sunk, beyond)
    outline = _outline_around(plane, ring, run.spacing, (int(low[0]), int(low[1])))
    return Section.of_ring(ring) if outline is None else Section.of_outline(ring.z, outline)


def _common(window: Window, low: IntArray, shape: tuple[int, ...]) -> tuple[Window, Window]:
    """Part that a block of pixels from ``low`` has in common with a window, in it and in the window."""
    start = np.array([side.start for side in window])
    first = np.maximum(start, low)
    stop = np.maximum(first, np.minimum([side.stop for side in window], low + shape))
    (a, b), (c, d) = (tuple(map(slice, first - origin, stop - origin)) for origin in (low, start))
    return (a, b), (c, d)


def _split_distances(
    branch: Ring, path: Sequence[Ring], sides: _Sides, window: Window, settings: MatchingSettings
) -> tuple[list[SingleArray], float]:
    """Distances from the split line on the levels of a junction, and the slope of its transition offset.

    The junction ends where the trunk holds the whole width of the branch's part, and some more.
    """
    distances: list[SingleArray] = []
    slope = settings.junction_slope
    for ring in path:
        inside = _pixels([ring], window)
        distance = sides.split(inside)
        if distance is None:  # apart again: another branch goes on from here
            return distances, settings.junction_slope
        distances.append(distance)
        width = float(distance[inside].max(initial=0.0))
        wanted = settings.junction_depth * width / max(abs(ring.z - branch.z), 1e-9)
        if len(distances) >= JUNCTION_LEVELS[0] and wanted <= settings.junction_slope:
            return distances, settings.junction_slope
        slope = max(settings.junction_slope, wanted)
    return distances, slope


@dataclass(frozen=True, eq=False)
class _Sides:
    """A branch and the other rings of its level on a block of pixels: what common outlines are split by."""

    branch: BoolArray
    others: BoolArray
    nearer_branch: BoolArray
    pixel: float

    @classmethod
    def of(cls, branch: Ring, others: Sequence[Ring], window: Window, pixel: float) -> _Sides:
        own, rest = _pixels([branch], window), _pixels(others, window)
        return cls(own, rest, _chamfer_distance(own, pixel) < _chamfer_distance(rest, pixel), pixel)

    def split(self, common: BoolArray) -> SingleArray | None:
        """Distance in mm from the line that splits a common ring's pixels, positive on the branch's side.

        The branch's part is what lies nearer to the branch in one piece with it, and what the trunk
        could only reach through that. None when there are not two parts.
        """
        own = _piece_with(common & self.nearer_branch, self.branch)
        trunk = None if own is None else _piece_with(common & ~own, self.others)
        if trunk is None:
            return None
        branch_part = common & ~trunk
        nearer = _chamfer_distance(branch_part, self.pixel) < _chamfer_distance(trunk, self.pixel)
        return -_chamfer_distance(nearer, self.pixel)


def _window(rings: Sequence[Ring], run: Run) -> Window:
    """Block of the plane's pixels around some rings, with room for what grows from them."""
    low = np.min([ring.bbox_min for ring in rings], axis=0)
    high = np.max([ring.bbox_max for ring in rings], axis=0)
    room = np.maximum(WINDOW_PIXELS, (high - low) // 4)
    first, stop = np.maximum(low - room, 0), np.minimum(high + room, run.fields[0].distance.shape)
    return slice(int(first[0]), int(stop[0])), slice(int(first[1]), int(stop[1]))


def _piece_with(pixels: BoolArray, wanted: BoolArray) -> BoolArray | None:
    """Pick the connected piece of some pixels that has most of the ``wanted`` ones; None without any."""
    _, labels = cv2.connectedComponents(pixels.astype(np.uint8), connectivity=4)
    shared = np.bincount(labels[wanted & pixels])
    return labels == int(np.argmax(shared)) if len(shared) else None


def _pixels(rings: Sequence[Ring], window: Window) -> BoolArray:
    """Pixels of a block of the plane that lie inside any of some rings."""
    block = np.zeros([side.stop - side.start for side in window], bool)
    for ring in rings:
        low = ring.bbox_min - [side.start for side in window]
        first, last = np.maximum(low, 0), np.minimum(low + ring.mask.shape, block.shape)
        if np.all(last > first):
            part = ring.mask[tuple(map(slice, first - low, last - low))]
            block[tuple(map(slice, first, last))] |= part.astype(bool)
    return block


def _chamfer_distance(inside: BoolArray, pixel: float) -> SingleArray:
    """Distance in mm to the border of a set of pixels, negative inside (5 x 5 chamfer, Borgefors 1986)."""
    pixels = inside.astype(np.uint8)
    outwards = cv2.distanceTransform(1 - pixels, cv2.DIST_L2, cv2.DIST_MASK_5)
    inwards = cv2.distanceTransform(pixels, cv2.DIST_L2, cv2.DIST_MASK_5)
    return (outwards - inwards) * np.float32(pixel)


def _outline_around(
    plane: RealArray, near: Ring, spacing: FloatArray, first: tuple[int, int] = (0, 0)
) -> FloatArray | None:
    """Find the contour (n, 2) in mm of a field that encloses most of the ring ``near``.

    Contours that leave the block of pixels, which begins at pixel ``first``, are closed along its border.
    """
    plane = np.pad(plane, 1, constant_values=np.float32(max(1.0, np.abs(plane).max())))
    lines = zero_contours(plane)
    outlines = [((line[:-1] - 1 + first) * spacing, bool(line.min() < 1)) for line in lines]
    candidates = [
        points
        for points, at_border in outlines
        # at the border not a hole but the outside, closed along it
        if len(points) >= 4 and signed_area(points) > 0 and not (near.hole and at_border)
    ]
    if len(lines) == 1 or not candidates:
        return candidates[0] if candidates else None
    target = shapely.Polygon(near.points).buffer(0)
    shared = [shapely.Polygon(points).buffer(0).intersection(target).area for points in candidates]
    return candidates[int(np.argmax(shared))] if max(shared) > 0 else None
