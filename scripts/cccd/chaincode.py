"""Freeman chain codes, what breaks them (junctions, isolated corners), and the exact curves of a mask.

Codes are numbered as in Figure 1: 0 points along +j (to the right of a slice shown with i downwards) and
the numbers rise counter-clockwise on the screen in steps of 45 degrees::

    3 2 1
    4 . 0        i grows downwards, j to the right
    5 6 7

Curves are ragged (`cccd.containers.Curves`): helpers here work on all curves at once.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numba
import numpy as np
import shapely
from scipy import ndimage

from cccd.containers import Boundaries, Curves, Frame, Structure, concatenate_ragged
from cccd.metrics import rasterise

__all__ = [
    "DIRECTIONS",
    "broken_links",
    "chain_codes",
    "decode",
    "is_simple",
    "isolated_corners",
    "junction_pixels",
    "left_out",
    "on_pixel_chain",
    "perimeters",
    "predecessors",
    "resample",
    "signed_areas",
    "successors",
    "trace_mask",
    "trace_stack",
]

#: Step (di, dj) of each Freeman code (Figure 1).
DIRECTIONS = np.array([(0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1)])

# code of a step, looked up at [di + 1, dj + 1]; 255 where nothing moves
_CODE_OF_STEP = np.full((3, 3), 255, np.uint8)
_CODE_OF_STEP[DIRECTIONS[:, 0] + 1, DIRECTIONS[:, 1] + 1] = np.arange(8)


# Ragged closed curves ---------------------------------------------------------------------------------


def successors(offsets: np.ndarray) -> np.ndarray:
    """Index (P,) of each point's successor on its closed curve."""
    following = np.arange(1, int(offsets[-1]) + 1)
    filled = offsets[1:] > offsets[:-1]
    following[offsets[1:][filled] - 1] = offsets[:-1][filled]
    return following


def predecessors(offsets: np.ndarray) -> np.ndarray:
    """Index (P,) of each point's predecessor on its closed curve."""
    preceding = np.arange(-1, int(offsets[-1]) - 1)
    filled = offsets[1:] > offsets[:-1]
    preceding[offsets[:-1][filled]] = offsets[1:][filled] - 1
    return preceding


def _sum_per_curve(values: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    total = np.concatenate([[0.0], np.cumsum(values)])
    return total[offsets[1:]] - total[offsets[:-1]]


def signed_areas(points: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Shoelace areas (C,) of ragged polygons in (i, j): positive for outer curves, negative for holes."""
    if len(points) == 0:
        return np.zeros(len(offsets) - 1)
    # coordinates relative to each polygon's first point keep the products small and exact
    sizes = np.diff(offsets)
    local = points - np.repeat(points[np.minimum(offsets[:-1], len(points) - 1)], sizes, axis=0)
    following = local[successors(offsets)]
    twice = local[:, 0] * following[:, 1] - local[:, 1] * following[:, 0]
    return _sum_per_curve(twice, offsets) / 2


def perimeters(points: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Lengths (C,) of ragged closed polygons."""
    return _sum_per_curve(np.linalg.norm(points[successors(offsets)] - points, axis=1), offsets)


def is_simple(points: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Whether each ragged closed polygon (C,) is strictly simple: it never touches or crosses itself."""
    sizes = np.diff(offsets)
    simple = np.zeros(len(sizes), bool)
    polygons = np.flatnonzero(sizes >= 3)
    if len(polygons):
        member = np.repeat(sizes >= 3, sizes)
        owner = np.repeat(np.arange(len(polygons)), sizes[polygons])
        rings = shapely.linearrings(points[member], indices=owner)
        simple[polygons] = shapely.is_simple(rings)
        # shapely overlooks a point repeated in place, which moves nothing but is a vertex twice
        still = (points[successors(offsets)] == points).all(axis=1)
        simple &= _sum_per_curve(still, offsets) == 0
    return simple


def resample(points: np.ndarray, offsets: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points evenly spaced by arc length on ragged closed polygons.

    Parameters
    ----------
    points : (P, 2) float array
    offsets : (C + 1,) int array
    counts : (C,) int array
        How many points each curve shall have; the first one stays.

    Returns
    -------
    (Q, 2) float array, (C + 1,) int64 array
        Points and offsets.
    """
    sizes = np.diff(offsets)
    closed = offsets + np.arange(len(offsets))  # each curve with its first point repeated at its end
    ring = np.empty((len(points) + len(sizes), 2))
    last = np.zeros(len(ring), bool)
    last[closed[1:] - 1] = True
    ring[~last] = points
    ring[last] = points[offsets[:-1]]
    length = np.zeros(len(ring))
    length[1:] = np.linalg.norm(np.diff(ring, axis=0), axis=1)
    length[closed[:-1]] = 1.0  # parts the curves on one common axis
    position = np.cumsum(length)
    begin, end = position[closed[:-1]], position[closed[1:] - 1]
    new_offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    rank = np.arange(new_offsets[-1]) - np.repeat(new_offsets[:-1], counts)
    wanted = np.repeat(begin, counts) + rank * np.repeat((end - begin) / np.maximum(counts, 1), counts)
    columns = [np.interp(wanted, position, ring[:, axis]) for axis in (0, 1)]
    return np.column_stack(columns), new_offsets


# Codes ------------------------------------------------------------------------------------------------


def broken_links(points: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Corners (P,) bool of closed curves whose successor is not one of their eight neighbours.

    In an ordered chain these are the isolated corners that are left (section 4.1, Figure 4).
    """
    step = points[successors(offsets)] - points
    return ~((np.abs(step).max(axis=1, initial=0) == 1) & (step == np.rint(step)).all(axis=1))


def on_pixel_chain(points: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Whether each closed curve (C,) steps from pixel centre to neighbouring pixel centre."""
    whole = (points == np.rint(points)).all(axis=1)
    return _sum_per_curve(broken_links(points, offsets) | ~whole, offsets) == 0


def chain_codes(points: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Freeman code of the link from each point to its successor (Definition 1).

    Parameters
    ----------
    points : (P, 2) array
        Closed 8-connected pixel chains.
    offsets : (C + 1,) int array

    Returns
    -------
    (P,) uint8 array of 0..7

    Raises
    ------
    ValueError
        When a link is not a step to one of the 8 neighbours.
    """
    step = np.asarray(points)[successors(offsets)] - points
    unit = (np.abs(step).max(axis=1, initial=0) == 1) & (step == np.rint(step)).all(axis=1)
    if not unit.all():
        curve = int(np.searchsorted(offsets, np.argmin(unit), side="right")) - 1
        raise ValueError(f"curve {curve} has a link that is not a step to a neighbouring pixel")
    step = step.astype(np.int64)
    return _CODE_OF_STEP[step[:, 0] + 1, step[:, 1] + 1]


def decode(starts: np.ndarray, codes: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Points (P, 2) of chain codes (P,) with the first point (C, 2) of each curve: undoes `chain_codes`."""
    steps = DIRECTIONS[codes]
    walked = np.concatenate([np.zeros((1, 2), steps.dtype), np.cumsum(steps, axis=0)])[:-1]
    sizes = np.diff(offsets)
    begin = np.minimum(offsets[:-1], max(len(codes) - 1, 0))
    if len(codes) == 0:
        return np.zeros((0, 2))
    return np.asarray(starts, float).repeat(sizes, axis=0) + walked - walked[begin].repeat(sizes, axis=0)


# Junctions and isolated corners -----------------------------------------------------------------------


def _neighbours(boundaries: Boundaries) -> np.ndarray:
    """Index (P, 8) of each boundary pixel's neighbours by Freeman code; -1 where there is none."""
    points = boundaries.points.astype(np.int64)
    if len(points) == 0:
        return np.zeros((0, 8), np.int64)
    points = points - points.min(axis=0) + 1
    height, width = points.max(axis=0) + 2
    layer = np.repeat(np.arange(len(boundaries)), np.diff(boundaries.offsets))
    key = (layer * height + points[:, 0]) * width + points[:, 1]
    order = np.argsort(key, kind="stable")
    wanted = key[:, None] + DIRECTIONS @ (width, 1)
    found = np.minimum(np.searchsorted(key, wanted, sorter=order), len(key) - 1)
    return np.where(key[order[found]] == wanted, order[found], -1)


def junction_pixels(boundaries: Boundaries) -> np.ndarray:
    """Boundary pixels (P,) bool with more than two neighbours (section 4.2).

    There the next link of a chain is not determined. A corner of a 4-connected staircase is a junction
    in this sense as well as a place where three strands meet.
    """
    return np.count_nonzero(_neighbours(boundaries) >= 0, axis=1) > 2


def isolated_corners(boundaries: Boundaries) -> np.ndarray:
    """Boundary pixels (P,) bool where a greedy chain code gets stuck (section 4.1, Figure 4).

    The walk starts at the first pixel of a slice in raster order, goes on to the neighbour of lowest
    Freeman code that was not visited, and never returns. Where it finds no successor it is stuck, unless
    it stands beside its own start with at least three pixels behind it, which closes the curve. Pixels
    left behind are walked next, until all have been visited.
    """
    return _greedy_dead_ends(_neighbours(boundaries))


@numba.njit(cache=True)
def _greedy_dead_ends(neighbours):  # a walk is sequential by nature
    count = len(neighbours)
    visited = np.zeros(count, np.bool_)
    stuck = np.zeros(count, np.bool_)
    for start in range(count):
        if visited[start]:
            continue
        current, length = start, 1
        visited[start] = True
        moving = True
        while moving:
            moving = False
            for code in range(8):
                candidate = neighbours[current, code]
                if candidate >= 0 and not visited[candidate]:
                    visited[candidate] = True
                    current, length, moving = candidate, length + 1, True
                    break
        closed = False
        if length >= 3:
            for code in range(8):
                closed |= neighbours[current, code] == start
        stuck[current] = not closed
    return stuck


# Exact curves of a mask -------------------------------------------------------------------------------


def trace_mask(structure: Structure) -> Curves:
    """Outer borders and borders of holes of a mask's slices, ordered exactly: no network needed.

    See `trace_stack`; what has no polygon is told by `left_out`.
    """
    return trace_stack(structure.stack("mask"), structure.stack_origin, structure.frame)


def trace_stack(mask: np.ndarray, origin: Sequence[int] | np.ndarray, frame: Frame) -> Curves:
    """Border curves of every slice of a mask.

    Parameters
    ----------
    mask : (S, I, J) bool array
    origin : (3,) int
        Source index (k, i, j) of the stack's first voxel.
    frame : Frame
        Of the source volume.

    Returns
    -------
    Curves
        Strictly simple closed 8-connected pixel chains, larger ones first within a slice.

    Notes
    -----
    Border following (Suzuki and Abe 1985) visits a pixel twice where the organ is one pixel wide. The
    walk is parted there into loops that touch in that pixel only; what was walked to and fro (spurs,
    lines, single pixels) encloses nothing and is dropped. The signed area is kept exactly.
    """
    chains: list[np.ndarray] = []
    layers: list[int] = []
    holes: list[bool] = []
    for layer in np.flatnonzero(mask.any(axis=(1, 2))):
        contours, hierarchy = cv2.findContours(
            mask[layer].astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE
        )
        chains += [contour[:, 0, ::-1] for contour in contours]
        layers += [int(layer)] * len(contours)
        holes += (hierarchy[0, :, 3] >= 0).tolist()
    points, offsets = concatenate_ragged(chains)
    points = points.astype(np.int64)
    loop_points, loop_offsets, chain = _part_at_repeated_pixels(points, offsets)
    points = points[loop_points].astype(float)
    layer, within_hole = np.array(layers, np.int64)[chain], np.array(holes, bool)[chain]

    # OpenCV walks outer borders and holes in opposite senses; turn each chain so that the organ lies on
    # the side that `Curves` wants. A loop around tissue that hangs into a hole is an outer curve.
    chain_area = signed_areas(*_as_float(chains))[chain]
    area = signed_areas(points, loop_offsets)
    area *= np.where((chain_area > 0) == within_hole, -1, 1)
    return _oriented(points, loop_offsets, layer, area, np.asarray(origin), frame)


def _as_float(chains: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    points, offsets = concatenate_ragged(chains)
    return points.astype(float), offsets


def _oriented(
    points: np.ndarray,
    offsets: np.ndarray,
    layer: np.ndarray,
    area: np.ndarray,
    origin: np.ndarray,
    frame: Frame,
) -> Curves:
    """Sort loops by slice and size and give each the orientation that the sign of ``area`` asks for."""
    order = np.lexsort((-np.abs(area), layer))
    loops = np.split(points, offsets[1:-1]) if len(layer) else []
    turned = np.sign(area) != np.sign(signed_areas(points, offsets))
    loops = [loops[n][::-1] if turned[n] else loops[n] for n in order]
    ragged, new_offsets = concatenate_ragged(loops)
    return Curves(
        ragged.astype(float) + origin[1:],
        new_offsets,
        (layer[order] + origin[0]).astype(np.int32),
        area[order] < 0,
        frame,
    )


def _part_at_repeated_pixels(
    points: np.ndarray, offsets: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Part closed walks into loops without repeated pixels.

    Returns
    -------
    index : (Q,) int64 array
        The loops' points, as indices of ``points``.
    offsets : (L + 1,) int64 array
    walk : (L,) int64 array
        The walk each loop was part of. Loops of fewer than three pixels enclose nothing: dropped.
    """
    if len(points) == 0:
        return np.zeros(0, np.int64), np.zeros(1, np.int64), np.zeros(0, np.int64)
    low, high = points.min(axis=0), points.max(axis=0)
    place = np.full(high - low + 1, -1, np.int64)
    index, ends, walks = _loops(points - low, offsets, place)
    return index, np.concatenate([[0], ends]), walks


@numba.njit(cache=True)
def _loops(points, offsets, place):
    # `place` holds where on the stack a pixel of the current walk stands
    total = len(points)
    index = np.empty(total, np.int64)
    ends = np.empty(total, np.int64)
    walks = np.empty(total, np.int64)
    stack = np.empty(total, np.int64)
    written, loops = 0, 0
    for walk in range(len(offsets) - 1):
        height = 0
        for n in range(offsets[walk], offsets[walk + 1] + 1):
            closing = n == offsets[walk + 1]
            bottom = 0 if closing else place[points[n, 0], points[n, 1]]
            if bottom >= 0:  # back at a pixel: what lies above it on the stack is a loop
                if height - bottom >= 3:
                    for level in range(bottom, height):
                        index[written] = stack[level]
                        written += 1
                    ends[loops] = written
                    walks[loops] = walk
                    loops += 1
                keep = bottom if closing else bottom + 1
                for level in range(keep, height):
                    place[points[stack[level], 0], points[stack[level], 1]] = -1
                height = keep
            else:
                place[points[n, 0], points[n, 1]] = height
                stack[height] = n
                height += 1
    return index[:written], ends[:loops], walks[:loops]


def left_out(mask: np.ndarray, origin: Sequence[int] | np.ndarray, curves: Curves) -> dict[str, int]:
    """Count what of a mask (S, I, J) its curves do not enclose.

    Returns
    -------
    dict
        ``components``: in-slice components (8-connected) too small to have a polygon;
        ``component_pixels``: their pixels; ``spur_pixels``: pixels of other components that lie on spurs
        or bridges one pixel wide.
    """
    missing = mask & ~rasterise(curves, origin, mask.shape)
    in_plane = np.zeros((3, 3, 3), bool)
    in_plane[1] = True
    labels, count = ndimage.label(mask, structure=in_plane)
    size = np.bincount(labels.ravel(), minlength=count + 1)
    lost = np.bincount(labels[missing], minlength=count + 1)
    whole = (lost == size) & (lost > 0)
    return {
        "components": int(whole.sum()),
        "component_pixels": int(size[whole].sum()),
        "spur_pixels": int(lost[~whole].sum()),
    }
