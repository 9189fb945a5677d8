"""Signed distances of several labels on one grid: the label that a node lies deepest in owns it.

The grid has the slices' pixels, on the slices and on levels about a pixel apart between them. Each label is
interpolated in its own box, as if it stood alone; large ones slab by slab. Where any label ends and nothing
begins is decided by all labels together, so that no notch opens where a wall between two of them comes out.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from scipy import ndimage

from cccd.containers import Curves, Frame, Sections, Structure
from cccd.contours import trace_contours
from cccd.geometry.arrays import FloatArray, IntArray, LabelArray
from cccd.settings.surface import LoftSettings
from cccd.surface.stack import interpolate_slices, warnings_of

#: Distances count up to so many pixels: a wall runs nearer than that to the nodes that it parts.
BAND_PIXELS = 4.0
#: Pixels around a label in which it competes for nodes.
MARGIN = 3
#: A label whose box has more nodes is interpolated slab by slab.
SLAB_NODES = 12_000_000
#: Memory that the program takes without data, that a node takes, one that is being interpolated, and a
#: wall's quadrilateral while it is smoothed: as measured.
PROGRAM_BYTES, NODE_BYTES, SLAB_BYTES, WALL_BYTES = 250e6, 8, 32, 1100
#: What lies further than this many slices away changes nothing of a level.
SLAB_MARGIN = 6
#: Between labels, what no label holds goes to the nearest one up to so many pixels away.
FILLED_PIXELS = 1.5
#: A gap between labels is so many nodes wide at most.
GAP = 3
#: Walls keep this share of an edge of the grid away from its nodes.
NODE_MARGIN = 0.02
#: What it costs in pixels to move a node across the plane at which the scan ends.
NEVER = 1e3
#: mm, or levels: heights so near to each other are the same.
SAME_HEIGHT = 1e-6

#: Distances in pixels: near a wall, half precision knows them to a thousandth.
HalfArray: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.float16]]
#: Numbers of labels.
NumberArray: TypeAlias = np.ndarray[tuple[int, ...], np.dtype[np.uint16]]


@dataclass(frozen=True, eq=False)
class LevelBlock:
    """Distances to one label on some levels.

    Attributes
    ----------
    heights : (L,) float64
        mm, ascending.
    first : (2,) int64
        Source ``(i, j)`` of the first node.
    values : (L, I, J) float16
        In pixels, negative inside, at most `BAND_PIXELS`.
    volume : float or None
        The mm^3 that the label must hold; None where slices only tell about how much.
    facts : dict
        Plain JSON: ``marching_cubes_bytes``, ``cut_ends`` and ``warnings``, as of a surface alone.
    """

    heights: FloatArray
    first: IntArray
    values: HalfArray
    volume: float | None
    facts: dict[str, Any]


def level_blocks(structure: Structure, settings: LoftSettings) -> Iterator[LevelBlock]:
    """Interpolate a label between its slices, in one block or slab by slab from the first slice on."""
    sections = label_sections(structure)
    mask, frame = sections.mask, structure.frame
    if mask is None or structure.annotation is not None or _nodes(mask.shape, frame) <= SLAB_NODES:
        yield _block(sections, settings)
        return
    slabs = -(-_nodes(mask.shape, frame) // SLAB_NODES)
    edges = np.linspace(0, len(mask), slabs + 1).astype(int)
    origin, step = np.asarray(structure.stack_origin), frame.slice_spacing
    voxel = step * float(frame.pixel_spacing.prod())
    for begin, end in itertools.pairwise(edges.tolist()):
        start, stop = max(begin - SLAB_MARGIN, 0), min(end + SLAB_MARGIN, len(mask))
        part = mask[start:stop]
        if not part.any():
            continue
        block = _block(Sections(sections.curves, part, origin + np.array([start, 0, 0])), settings)
        heights = block.heights + 1e-6 * step
        here = np.ones(len(heights), np.bool_)
        if begin > 0:
            here &= heights >= (origin[0] + begin) * step
        if end < len(mask):
            here &= heights < (origin[0] + end) * step
        if not here.any():
            continue
        volume = np.count_nonzero(mask[begin:end]) * voxel
        yield LevelBlock(block.heights[here], block.first, block.values[here], volume, block.facts)


def label_sections(structure: Structure) -> Sections:
    """Gather what is known of a label's slices; a mask needs no curves."""
    if structure.probability is not None:
        return structure.sections(trace_contours(structure))
    empty = np.zeros(0, np.int32)
    curves = Curves(np.zeros((0, 2)), np.zeros(1, np.int64), empty, empty.astype(bool), structure.frame)
    return structure.sections(curves)


def _block(sections: Sections, settings: LoftSettings) -> LevelBlock:
    """Interpolate slices, and keep what lies near to the label."""
    stack = interpolate_slices(sections, settings)
    values = stack.distance.values
    near = values.min(axis=0) < BAND_PIXELS * stack.pixel
    box = tuple(
        slice(max(int(found[0]) - MARGIN, 0), int(found[-1]) + MARGIN + 1)
        for found in (np.flatnonzero(near.any(axis=1)), np.flatnonzero(near.any(axis=0)))
    )
    first = stack.origin + np.array([box[0].start, box[1].start])
    pixels = np.clip(values[:, box[0], box[1]] / np.float32(stack.pixel), -BAND_PIXELS, BAND_PIXELS)
    facts = {
        "marching_cubes_bytes": stack.marching_cubes_bytes,
        "cut_ends": int(np.isfinite(stack.distance.ends).sum()),
        "warnings": warnings_of(stack),
    }
    return LevelBlock(stack.distance.z, first, pixels.astype(np.float16), stack.held_volume, facts)


def _levels_per_slice(frame: Frame) -> int:
    """Levels from a slice to the next one."""
    return max(1, round(frame.slice_spacing / float(np.sqrt(frame.pixel_spacing.prod()))))


def _nodes(shape: Sequence[int], frame: Frame) -> int:
    """Nodes of the box of a label of so many slices and pixels."""
    return (shape[0] + 1) * _levels_per_slice(frame) * (shape[1] + 2 * MARGIN) * (shape[2] + 2 * MARGIN)


def bytes_needed(structures: Mapping[int, Structure]) -> int:
    """Estimate the memory that it takes to let some labels meet, in bytes, the program itself included."""
    low, high = box_of(structures)
    labels = gathered(structures, low - 1, high + 1)
    parts = _levels_per_slice(next(iter(structures.values())).frame)
    walls = np.count_nonzero(np.diff(labels, axis=0))
    walls += parts * sum(np.count_nonzero(np.diff(labels, axis=axis)) for axis in (1, 2))
    nodes = _nodes((high - low).tolist(), next(iter(structures.values())).frame)
    at_work = max(SLAB_BYTES * min(nodes, SLAB_NODES), WALL_BYTES * walls)
    return int(PROGRAM_BYTES + NODE_BYTES * nodes + at_work)


def box_of(structures: Mapping[int, Structure]) -> tuple[IntArray, IntArray]:
    """First and last source (k, i, j), the latter not included, of what some labels hold."""
    lows, highs = [], []
    for structure in structures.values():
        stack = structure.required_stack("mask")
        (box,) = ndimage.find_objects(stack.astype(np.uint8))
        lows.append(structure.stack_origin + np.array([side.start for side in box]))
        highs.append(structure.stack_origin + np.array([side.stop for side in box]))
    return np.min(lows, axis=0), np.max(highs, axis=0)


@dataclass(frozen=True, eq=False)
class LabelFields:
    """Who owns the nodes of a grid, and how deep they lie in it.

    Attributes
    ----------
    structures : dict of int to Structure
        The labels, on one grid of voxels, by number from 1.
    owner : (L, I, J) uint16
        Number of the label that a node lies deepest in, or nearest to.
    best, second : (L, I, J) float16
        Distances in pixels to it, and to the one after it.
    outer : (L, I, J) float16
        To all labels together.
    heights : (L,) float64
        mm.
    first : (2,) int64
        Source ``(i, j)`` of the first node.
    volumes : (N + 1,) float64
        mm^3 that each label must hold; not a number where that is not known.
    facts : dict of int to dict
        What else is known of each label; see `LevelBlock`.
    """

    structures: dict[int, Structure]
    owner: NumberArray
    best: HalfArray
    second: HalfArray
    outer: HalfArray
    heights: FloatArray
    first: IntArray
    volumes: FloatArray
    facts: dict[int, dict[str, Any]]

    @classmethod
    def empty(cls, structures: Sequence[Structure]) -> LabelFields:
        """Lay a grid over labels of one grid of voxels; each is `add`-ed then, and `together` as number 0."""
        numbered = dict(enumerate(structures, 1))
        low, high = box_of(numbered)
        heights = _heights(structures[0].frame, int(low[0]), int(high[0]))
        shape = (len(heights), *(high[1:] - low[1:] + 2 * MARGIN))
        best, second, outer = (np.full(shape, BAND_PIXELS, np.float16) for _ in range(3))
        volumes = np.full(len(numbered) + 1, np.nan)
        owner = np.zeros(shape, np.uint16)
        return cls(numbered, owner, best, second, outer, heights, low[1:] - MARGIN, volumes, {})

    @property
    def frame(self) -> Frame:
        """The labels' grid of voxels."""
        return self.structures[1].frame

    def together(self) -> Structure:
        """Make one structure of all labels."""
        low, high = box_of(self.structures)
        axis = self.frame.slice_axis
        origin = np.empty(3, np.int64)
        origin[[axis, *self.frame.in_plane_axes]] = low
        mask = np.moveaxis(gathered(self.structures, low, high) > 0, 0, axis)
        one = next((part for part in self.structures.values() if part.annotation), self.structures[1])
        return Structure(one.case, "all", one.frame, origin, mask=mask, annotation=one.annotation)

    def add(self, number: int, blocks: Iterable[LevelBlock]) -> None:
        """Enter the distances to a label, in any order, or (0) to all together."""
        for block in blocks:
            box, values = self._placed(block)
            if number == 0:
                self.outer[box] = values
                continue
            best, owner = self.best[box], self.owner[box]
            nearer = (values < best) | ((values == best) & (number < owner))
            self.second[box] = np.where(values < best, best, np.minimum(self.second[box], values))
            owner[nearer] = number
            np.minimum(best, values, out=best)
            if block.volume is not None:
                self.volumes[number] = np.nan_to_num(self.volumes[number]) + block.volume
            known = self.facts.setdefault(number, {"marching_cubes_bytes": 0, "cut_ends": 0, "warnings": []})
            known["marching_cubes_bytes"] += block.facts["marching_cubes_bytes"]
            known["cut_ends"] = max(known["cut_ends"], block.facts["cut_ends"])
            known["warnings"] += [line for line in block.facts["warnings"] if line not in known["warnings"]]

    def owners(self) -> NumberArray:
        """Give each node (L, I, J) its owner: 0 outside, `beyond` where a label runs past the scan's end."""
        owner = self._owner_at(...)
        low, high = self.frame.ends
        past = (self.heights < low) | (self.heights > high)
        owner[past] = np.where(owner[past] > 0, np.uint16(self.beyond), np.uint16(0))
        owner[[0, -1]] = 0
        return owner

    def _owner_at(self, at: Any) -> NumberArray:
        """Owners of nodes, given as an index of the grid; 0 outside."""
        # a fragment that was dropped is of all labels together still, but near to none
        inside = (self.outer[at] < 0) & (self.best[at] < FILLED_PIXELS)
        return np.where(inside, self.owner[at], np.uint16(0))

    @property
    def beyond(self) -> int:
        """Number of what lies past the ends of the scan."""
        return len(self.volumes)

    def price(self, nodes: IntArray, labels: LabelArray) -> FloatArray:
        """Tell what it costs (P,), in pixels, that labels (P,) own nodes (P, 3); see `well_composed`."""
        at = tuple(nodes.T)
        price = np.where(labels == self.owner[at], self.best[at], self.second[at]).astype(float)
        price = np.where(labels == 0, -self.outer[at].astype(float), price)
        low, high = self.frame.ends
        height = self.heights[nodes[:, 0]]
        across = (labels == self.beyond) != ((height < low) | (height > high))
        return np.where(across & (labels > 0), NEVER, price)

    def cut(self, nodes: IntArray, ends: IntArray, low: LabelArray, high: LabelArray) -> FloatArray:
        """Share (E,) of edges at which they leave one label for another."""
        facing = self._facing(nodes, ends, low, high)
        here, there = (self._depth(at, low, high, own, facing) for at, own in ((nodes, low), (ends, high)))
        total = here + there
        share = np.divide(here, total, out=np.full(len(nodes), 0.5), where=total > 0)
        share = np.clip(share, NODE_MARGIN, 1 - NODE_MARGIN)
        begin, end = self.heights[nodes[:, 0]], self.heights[ends[:, 0]]
        at_end = ((low == self.beyond) | (high == self.beyond)) & (begin != end)
        for plane in self.frame.ends:
            crossed = at_end & (begin <= plane) & (end >= plane)
            share[crossed] = (plane - begin[crossed]) / (end[crossed] - begin[crossed])
        return np.asarray(share, float)

    def _facing(self, nodes: IntArray, ends: IntArray, low: LabelArray, high: LabelArray) -> LabelArray:
        """Labels (E,) of edges that lead from them into a gap before another one; 0 for all others."""
        facing, begins = np.zeros(len(nodes), self.owner.dtype), (low == 0)[:, None]
        outer = np.flatnonzero((low == 0) | (high == 0))
        at, own = (np.where(begins, *pair)[outer] for pair in ((nodes, ends), (ends, nodes)))
        label, last = self.owner[tuple(own.T)], np.array(self.owner.shape) - 1
        for far in range(1, GAP + 1):
            other = self._owner_at(tuple(np.clip(at + far * (at - own), 0, last).T))
            facing[outer[(other > 0) & (other != label)]] = label[(other > 0) & (other != label)]
        return facing

    def _depth(
        self, nodes: IntArray, low: LabelArray, high: LabelArray, own: LabelArray, facing: LabelArray
    ) -> FloatArray:
        """How far (E,) nodes are from changing between two labels; 0 for those that went over to ``own``.

        The outside begins where all labels together end: each by itself is rounded where it meets another.
        They fill narrow gaps, so a label that faces another ends by itself.
        """
        at = tuple(nodes.T)
        best, second = self.best[at].astype(float), self.second[at].astype(float)
        alone = np.where(own > 0, -best, np.where(self.owner[at] == facing, best, second))
        outside = np.where(facing > 0, np.maximum(alone, 0), np.abs(self.outer[at].astype(float)))
        depth = np.where((low == 0) | (high == 0), outside, second - best)
        return np.where((own == self._owner_at(at)) | (own == self.beyond), depth, 0)

    def _placed(self, block: LevelBlock) -> tuple[tuple[slice, slice, slice], HalfArray]:
        """Find where on the grid a block lies, and its distances there."""
        begin = int(np.searchsorted(self.heights, block.heights[0] - SAME_HEIGHT))
        end = int(np.searchsorted(self.heights, block.heights[-1] + SAME_HEIGHT))
        place = np.interp(self.heights[begin:end], block.heights, np.arange(len(block.heights)))
        level = np.floor(place + SAME_HEIGHT).astype(int)
        between = np.flatnonzero(place - level > SAME_HEIGHT)
        box, cut = [slice(begin, end)], []
        for start, size, most in zip(
            block.first - self.first, block.values.shape[1:], self.best.shape[1:], strict=True
        ):
            box.append(slice(max(start, 0), min(start + size, most)))
            cut.append(slice(max(-start, 0), min(size, most - start)))
        values = block.values[:, cut[0], cut[1]]
        placed = values[level]
        share = (place - level)[between, None, None].astype(np.float32)
        placed[between] = (1 - share) * placed[between] + share * values[level[between] + 1]
        return (box[0], box[1], box[2]), placed


def _heights(frame: Frame, first: int, stop: int) -> FloatArray:
    """Heights (L,) in mm of the levels around slices: one past the ends of the scan, and one past that."""
    parts, step = _levels_per_slice(frame), frame.slice_spacing
    heights = np.arange((first - 1) * parts - 1, stop * parts + 2) * (step / parts)
    low, high = frame.ends
    kept = (heights > low - 2.01 * step / parts) & (heights < high + 2.01 * step / parts)
    return np.asarray(heights[kept], float)


def gathered(structures: Mapping[int, Structure], low: IntArray, high: IntArray) -> NumberArray:
    """Numbers (S, I, J), from 1 in their order, of the labels in a box; a voxel of several is the last one's.

    The box is from source ``(k, i, j)`` ``low`` to ``high``, which is not in it.
    """
    labels = np.zeros(high - low, np.uint16)
    for number, structure in enumerate(structures.values(), 1):
        stack, origin = structure.required_stack("mask"), structure.stack_origin
        start, stop = np.maximum(origin, low), np.minimum(origin + stack.shape, high)
        box = tuple(slice(a, b) for a, b in zip(start - low, stop - low, strict=True))
        part = tuple(slice(a, b) for a, b in zip(start - origin, stop - origin, strict=True))
        labels[box][np.asarray(stack[part], np.bool_)] = number
    return labels
