"""The curves of a mask, by border following, and of probabilities, by their level: no network needed."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import cast

import contourpy
import numpy as np
from scipy import ndimage

from cccd.containers import Curves, Frame, ProbabilityStack, Structure
from cccd.geometry._jit import jit, jit_within
from cccd.geometry.arrays import FloatArray, RealArray, concatenate_ragged, split_ragged
from cccd.geometry.polygons import RaggedPolygons

__all__ = ["left_out", "level_curves", "trace_mask", "trace_stack"]

#: Probabilities count as no nearer to one half than this: their level passes no pixel's centre.
NEAREST_HALF = 0.02
#: Steps (i, j) down, right, up and left: each a left turn from the last.
_HEADINGS = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)])


def trace_mask(structure: Structure) -> Curves:
    """Outer borders and borders of holes of a mask's slices, ordered exactly: no network needed.

    See `trace_stack`; what has no polygon is counted by `left_out`.
    """
    return trace_stack(structure.required_stack("mask"), structure.stack_origin, structure.frame)


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
    walk is split there into loops that touch in that pixel only; what was walked back and forth (spurs,
    lines, single pixels) encloses nothing and is dropped. The signed area is kept exactly.
    """
    whole, offsets, layers, holes = _border_walks(mask)
    loop_points, loop_offsets, chain = _split_at_repeated_pixels(whole, offsets)
    points = whole[loop_points].astype(float)
    layer, within_hole = layers[chain], holes[chain]

    # Outer borders and holes are walked in opposite senses; turn each chain so that the organ lies on
    # the side that `Curves` wants. A loop around tissue that hangs into a hole is an outer curve.
    chain_area = RaggedPolygons(whole.astype(float), offsets).signed_areas[chain]
    area = RaggedPolygons(points, loop_offsets).signed_areas
    area *= np.where((chain_area > 0) == within_hole, -1, 1)
    return _oriented(points, loop_offsets, layer, area, np.asarray(origin), frame)


def _border_walks(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Walk around the borders of a mask (S, I, J); in the order in which OpenCV's ``findContours`` does.

    Returns
    -------
    pixels : (P, 2) int64
    offsets : (C + 1,) int64
    layers : (C,) int64
    holes : (C,) bool
    """
    inside = np.pad(np.asarray(mask, bool), ((0, 0), (1, 1), (1, 1)))
    sides = sum(int(np.count_nonzero(np.diff(inside, axis=axis))) for axis in (1, 2))
    pixels, walks = np.empty((sides, 2), np.int64), np.empty((sides, 4), np.int64)
    walked = np.empty((2, *inside.shape[1:]), np.int64)
    count = _follow(inside, walked, _HEADINGS, pixels, walks)
    ends, layers, parts, holes = walks[:count].T
    starts = np.concatenate([[0], ends])[:-1]
    order = np.lexsort((-starts, holes, -parts, layers))  # the last part first, its holes after its border
    chains, offsets = concatenate_ragged([pixels[starts[n] : ends[n]] - 1 for n in order])
    return chains, offsets, layers[order], holes[order] > 0


@jit
def _follow(inside, walked, headings, pixels, walks):
    # Along the sides of pixels, the organ on the left: from a left side downwards, of holes from a right side
    # upwards. `walked` holds for both sides of a layer's pixels which part's border was walked there.
    written, count = 0, 0
    for layer in range(inside.shape[0]):
        walked[:] = -1
        for i in range(1, inside.shape[1] - 1):
            part = -1
            for j in range(1, inside.shape[2] - 1):
                if not inside[layer, i, j]:
                    continue
                for hole in range(2):
                    if inside[layer, i, j - 1 + 2 * hole]:
                        continue
                    if walked[hole, i, j] < 0:
                        part = part if hole else count
                        written = _walk(inside, layer, walked, headings, pixels, written, i, j, hole, part)
                        walks[count, 0], walks[count, 1] = written, layer
                        walks[count, 2], walks[count, 3] = part, hole
                        count += 1
                    part = walked[hole, i, j]
    return count


@jit_within
def _walk(inside, layer, walked, headings, pixels, first, i, j, hole, part):
    """Write the pixels along one border, and return how many are written by then."""
    written, heading, a, b = first, 2 * hole, i, j
    while True:
        if heading % 2 == 0:
            walked[heading // 2, a, b] = part
        if written == first or pixels[written - 1, 0] != a or pixels[written - 1, 1] != b:
            pixels[written, 0], pixels[written, 1] = a, b
            written += 1
        right = (heading + 3) % 4
        c, d = a + headings[heading, 0], b + headings[heading, 1]
        if inside[layer, c + headings[right, 0], d + headings[right, 1]]:  # by a corner, too
            a, b, heading = c + headings[right, 0], d + headings[right, 1], right
        elif inside[layer, c, d]:
            a, b = c, d
        else:
            heading = (heading + 1) % 4
        if a == i and b == j and heading == 2 * hole:
            break
    # it may have begun amid the sides of its first pixel
    again = written > first + 1 and pixels[written - 1, 0] == i and pixels[written - 1, 1] == j
    return written - 1 if again else written


def level_curves(stack: ProbabilityStack, frame: Frame) -> Curves:
    """Curves along which probabilities are one half, on every slice: below the pixel, without its steps.

    Parameters
    ----------
    stack : ProbabilityStack
        Linear between the centres of pixels, zero beyond its sides.
    frame : Frame
        Of the source volume.

    Returns
    -------
    Curves
        Simple and closed, larger ones first within a slice.
    """
    lines: list[np.ndarray] = []
    layers: list[int] = []
    for layer in np.flatnonzero((stack.values >= 0.5).any(axis=(1, 2))):
        outside = np.pad(0.5 - stack.values[layer].astype(float), 1, constant_values=0.5)
        field = np.copysign(np.maximum(np.abs(outside), NEAREST_HALF), np.where(outside > 0, 1.0, -1.0))
        found = [line[:-1] - 1 for line in zero_contours(field)]
        lines += found
        layers += [int(layer)] * len(found)
    points, offsets = concatenate_ragged(lines)
    area = RaggedPolygons(points, offsets).signed_areas
    return _oriented(points, offsets, np.array(layers, np.int64), area, np.asarray(stack.origin), frame)


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
    loops = split_ragged(points, offsets)
    turned = np.sign(area) != np.sign(RaggedPolygons(points, offsets).signed_areas)
    loops = [loops[n][::-1] if turned[n] else loops[n] for n in order]
    ragged, new_offsets = concatenate_ragged(loops)
    return Curves(
        ragged.astype(float) + origin[1:],
        new_offsets,
        (layer[order] + origin[0]).astype(np.int32),
        area[order] < 0,
        frame,
    )


def _split_at_repeated_pixels(
    points: np.ndarray, offsets: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Split closed walks into loops without repeated pixels."""
    if len(points) == 0:
        return np.zeros(0, np.int64), np.zeros(1, np.int64), np.zeros(0, np.int64)
    low, high = points.min(axis=0), points.max(axis=0)
    place = np.full(high - low + 1, -1, np.int64)
    index, ends, walks, stack = np.empty((4, len(points)), np.int64)
    written, loops = _write_loops(points - low, offsets, place, stack, index, ends, walks)
    return index[:written], np.concatenate([[0], ends[:loops]]), walks[:loops]


@jit
def _write_loops(points, offsets, place, stack, index, ends, walks):
    # `place` holds where on the stack a pixel of the current walk stands
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
    return written, loops


def left_out(mask: np.ndarray, origin: Sequence[int] | np.ndarray, curves: Curves) -> dict[str, int]:
    """Count what of a mask (S, I, J) its curves do not enclose.

    Returns
    -------
    dict
        ``components``: in-slice components (8-connected) too small to have a polygon;
        ``component_pixels``: their pixels; ``spur_pixels``: pixels of other components that lie on spurs
        or bridges one pixel wide; ``parts``: parts of the whole mask (26-connected) that have no polygon on
        any slice; ``part_voxels``: their voxels; ``voxels``: the mask's.
    """
    missing = mask & ~curves.rasterise(origin, mask.shape)
    in_plane = np.zeros((3, 3, 3), bool)
    in_plane[1] = True
    labels, count = ndimage.label(mask, structure=in_plane)
    size = np.bincount(labels.ravel(), minlength=count + 1)
    lost = np.bincount(labels[missing], minlength=count + 1)
    whole = (lost == size) & (lost > 0)
    parts = _wholly_missing(mask, missing) if whole.any() else np.zeros(0, int)
    return {
        "components": int(whole.sum()),
        "component_pixels": int(size[whole].sum()),
        "spur_pixels": int(lost[~whole].sum()),
        "parts": len(parts),
        "part_voxels": int(parts.sum()),
        "voxels": int(size[1:].sum()),
    }


def _wholly_missing(mask: np.ndarray, missing: np.ndarray) -> np.ndarray:
    """Voxels (P,) of each part of a mask (S, I, J) whose voxels are all missing."""
    labels, count = ndimage.label(mask, structure=np.ones((3, 3, 3), bool))
    size = np.bincount(labels[mask], minlength=count + 1)
    lost = np.bincount(labels[missing], minlength=count + 1)
    return size[(lost == size) & (lost > 0)]


def zero_contours(plane: RealArray) -> list[FloatArray]:
    """Contours (n, 2) in pixels along which a plane (I, J) is zero, each with its first point once more.

    Around what is negative they run counter-clockwise in (i, j), around holes in it clockwise.

    Examples
    --------
    >>> plane = np.ones((3, 3))
    >>> plane[1, 1] = -1
    >>> zero_contours(plane)[0].tolist()
    [[0.5, 1.0], [1.0, 0.5], [1.5, 1.0], [1.0, 1.5], [0.5, 1.0]]
    """
    rows, columns = _pixel_grid(*plane.shape)
    generator = contourpy.contour_generator(columns, rows, plane)
    return [line[:, ::-1] for line in cast("list[FloatArray]", generator.lines(0.0))]


@lru_cache(maxsize=4)
def _pixel_grid(height: int, width: int) -> tuple[FloatArray, FloatArray]:
    """Rows and columns (H, W) of a plane's pixels, which contourpy would make anew for every plane."""
    rows, columns = np.indices((height, width), float)
    return rows, columns
