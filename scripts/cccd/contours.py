"""From slices to ordered contours without a network: a mask is traced, drawn contours are taken.

The third way, for boundary pixels that still need ordering, is `cccd_junctions.ordering`. Which one a
structure goes the workflow decides from the cohort sheet, before any job starts.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from itertools import pairwise
from typing import cast

import contourpy
import numpy as np

from cccd.containers import Curves, Frame, ProbabilityStack, Structure
from cccd.errors import InputError
from cccd.geometry.arrays import (
    FloatArray,
    IntArray,
    concatenate_ragged,
    owners_of,
    split_ragged,
)
from cccd.geometry.opencv import borders_of
from cccd.geometry.polygons import RaggedPolygons

#: Probabilities count as no nearer to one half than this: their level passes no pixel's centre.
NEAREST_HALF = 0.02


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
    """Walk around the borders of a mask (S, I, J).

    Returns
    -------
    pixels : (P, 2) int64
    offsets : (C + 1,) int64
    layers : (C,) int64
    holes : (C,) bool
    """
    chains: list[np.ndarray] = []
    layers: list[int] = []
    holes: list[bool] = []
    for layer in np.flatnonzero(mask.any(axis=(1, 2))):
        borders, of_holes = borders_of(mask[layer])
        chains += borders
        layers += [int(layer)] * len(borders)
        holes += of_holes.tolist()
    pixels, offsets = concatenate_ragged(chains)
    return pixels.astype(np.int64), offsets, np.array(layers, np.int64), np.array(holes, bool)


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
        closed = cast("list[FloatArray]", contourpy.contour_generator(z=field).lines(0.0))
        found = [line[:-1, ::-1] - 1 for line in closed]  # contourpy's are (j, i), the first point once more
        lines += found
        layers += [int(layer)] * len(found)
    points, offsets = concatenate_ragged(lines)
    area = RaggedPolygons(points, offsets).signed_areas
    return _oriented(points, offsets, np.array(layers, np.int64), area, np.asarray(stack.origin), frame)


def _oriented(
    points: FloatArray,
    offsets: IntArray,
    layer: IntArray,
    area: FloatArray,
    origin: IntArray,
    frame: Frame,
) -> Curves:
    """Sort loops by slice and size and give each the orientation that the sign of ``area`` asks for."""
    order = np.lexsort((-np.abs(area), layer))
    loops = split_ragged(points, offsets)
    turned = np.sign(area) != np.sign(RaggedPolygons(points, offsets).signed_areas)
    loops = [loops[n][::-1] if turned[n] else loops[n] for n in map(int, order)]
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
    """Split closed walks into loops without repeated pixels: their points, offsets, and walks."""
    walk = owners_of(offsets)
    order = np.lexsort((points[:, 1], points[:, 0], walk))
    again = (np.diff(points[order], axis=0) == 0).all(axis=1) & (np.diff(walk[order]) == 0)
    twice = set(walk[order[1:][again]].tolist())
    loops: list[np.ndarray] = []
    walks: list[int] = []
    for n, (start, end) in enumerate(pairwise(offsets.tolist())):
        pixels = map(tuple, points[start:end].tolist()) if n in twice else range(end - start)
        found = [start + np.array(loop) for loop in _loops(list(pixels))]
        loops += found
        walks += [n] * len(found)
    index, ends = concatenate_ragged(loops, 1)
    return index.astype(np.int64), ends, np.array(walks, np.int64)


def _loops(walk: Sequence[Hashable]) -> list[list[int]]:
    """Which steps of a closed walk each of its loops has, of three places at least."""
    loops: list[list[int]] = []
    stack: list[int] = []
    height: dict[Hashable, int] = {}  # at which a place stands on the stack
    for n, place in enumerate(walk):
        if place not in height:
            height[place] = len(stack)
            stack.append(n)
            continue
        bottom = height[place]  # back there: what lies above it on the stack is a loop
        loops.append(stack[bottom:])
        for m in stack[bottom + 1 :]:
            del height[walk[m]]
        del stack[bottom + 1 :]
    return [loop for loop in [*loops, stack] if len(loop) >= 3]


_CHANGED = "its file has changed since the run was planned: run snakemake again"


def trace_contours(structure: Structure) -> Curves:
    """Follow the borders of a mask's slices: exact, so that no network could add to it.

    Of probabilities it is their level of one half, which runs between the pixels.

    Parameters
    ----------
    structure : Structure
        With a mask, and probabilities where there are some.

    Returns
    -------
    Curves
        Closed, simple, oriented; see `trace_stack` and `level_curves`.

    Raises
    ------
    InputError
        There is no mask, or nothing in it.
    """
    mask = structure.stack("mask")
    if mask is None:
        raise InputError(f"{structure.case}/{structure.organ}", "there is no mask to trace", _CHANGED)
    probability = structure.probability_stack
    if probability is not None:
        return check_closed(level_curves(probability, structure.frame), structure)
    curves = trace_stack(mask, structure.stack_origin, structure.frame)
    # what is one pixel wide everywhere has no curve through its pixels' centres, but it has a border
    return curves if mask.any() else check_closed(curves, structure)


def take_contours(structure: Structure) -> Curves:
    """Take drawn contours (RTSTRUCT) as they are.

    Parameters
    ----------
    structure : Structure
        With contours.

    Raises
    ------
    InputError
        There are no drawn contours.
    """
    if structure.contours is None:
        raise InputError(f"{structure.case}/{structure.organ}", "there are no drawn contours", _CHANGED)
    return check_closed(structure.contours, structure)


def check_closed(curves: Curves, structure: Structure) -> Curves:
    """Return the curves, provided that there is one.

    Raises
    ------
    InputError
        No slice has a closed boundary.
    """
    if not len(curves):
        raise InputError(
            f"{structure.case}/{structure.organ}",
            "no slice has a closed boundary",
            "check the input's slices: none shows an outline that closes",
        )
    return curves
