"""From contours to tubes: which rings follow each other, where tubes branch off, and how each one ends.

Rings of one kind that follow each other become a tube. Where tubes merge or split, the one that shares
most with the common outline, the trunk, runs on; each other one is a branch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cccd.surface.branching import Cut, branch_off, without_cuts
from cccd.surface.caps import cap_height, opening, planar_cap, reaches_scan_border, rounded_cap
from cccd.surface.ring_graph import DOWN, UP, RingGraph, link_rings
from cccd.surface.rings import Ring
from cccd.surface.stack import Run, SliceStack
from cccd.surface.tubes import EndKind, Section, Tube

__all__ = ["Tubes", "match_contours"]

#: Parts of fewer voxels than this are noise of the mask.
SMALLEST_PART_VOXELS = 6


@dataclass(frozen=True, eq=False)
class Tubes:
    """The tubes of all levels, and the number of parts that were too small for one."""

    tubes: list[Tube]
    left_out: int


@dataclass(frozen=True, eq=False)
class _End:
    """Sections that close a tube, outwards, its pole if any, why it ends, and what its trunk leaves to it."""

    kind: EndKind
    sections: list[Section]
    pole: NDArray[np.float64] | None = None
    cuts: Sequence[Cut] = ()


def match_contours(stack: SliceStack) -> Tubes:
    """Match the rings of all levels into tubes.

    Parts of fewer voxels than `SMALLEST_PART_VOXELS` are left out, unless they are all that a run of
    levels has.
    """
    smallest = SMALLEST_PART_VOXELS * stack.voxel[1:].prod() * stack.step
    matched = [_match_run(run, smallest) for run in stack.runs]
    return Tubes([tube for part in matched for tube in part.tubes], sum(part.left_out for part in matched))


def _match_run(run: Run, smallest: float) -> Tubes:
    """Tubes of one run of levels; parts of less than ``smallest`` mm^3 are left out."""
    graph = link_rings(run.rings)
    chains = [chain for whole in graph.chains() if (chain := _without_fading_ends(whole, graph, run))]
    kept = [chain for chain in chains if _volume(chain, run.half_step) >= smallest]
    if not kept:
        kept = sorted(chains, key=lambda chain: -_volume(chain, run.half_step))[:1]
    ends = [(_end(chain[0], DOWN, graph, run), _end(chain[-1], UP, graph, run)) for chain in kept]
    cuts = [cut for both in ends for end in both for cut in end.cuts]
    tubes = [_tube(chain, low, high, cuts, run) for chain, (low, high) in zip(kept, ends, strict=True)]
    return Tubes(tubes, len(chains) - len(kept))


def _without_fading_ends(chain: list[Ring], graph: RingGraph, run: Run) -> list[Ring]:
    """Drop a chain's first and last ring where they lie between slices and nothing goes on from them.

    What lies beyond a tube's last slice is decided by its cap, not by the distance to other parts.
    """
    if chain[-1].source_slice is None and not _goes_on(chain[-1], UP, graph, run):
        chain = chain[:-1]
    if chain and chain[0].source_slice is None and not _goes_on(chain[0], DOWN, graph, run):
        chain = chain[1:]
    return chain


def _goes_on(ring: Ring, way: int, graph: RingGraph, run: Run) -> bool:
    """Whether anything of the same kind, or for a hole the open outside, follows the ring."""
    if graph.next(ring, way) or graph.touched(ring, way):
        return True
    return ring.hole and opening(ring, way, run) is not None


def _volume(chain: Sequence[Ring], half_step: float) -> float:
    """Volume in mm^3 that a chain stands for."""
    rise = chain[-1].z - chain[0].z
    return float(np.mean([ring.area for ring in chain])) * max(rise, 2 * half_step)


def _end(ring: Ring, way: int, graph: RingGraph, run: Run) -> _End:
    """How a tube ends beyond its first or last ring."""
    if graph.touched(ring, way):
        sections, cuts = branch_off(ring, way, graph, run)
        if sections:
            return _End("joined", sections, cuts=cuts)
    if ring.hole and (sections := opening(ring, way, run)) is not None:
        return _End("opens", sections)
    if reaches_scan_border(ring, way, run):
        return _End("cut", planar_cap(ring, way, run))
    return _End("cap", *rounded_cap(ring, way, cap_height(ring, way, graph, run)))


def _tube(chain: Sequence[Ring], low: _End, high: _End, cuts: Sequence[Cut], run: Run) -> Tube:
    """Put a tube together: its ends, and between them its rings without what they leave to branches."""
    middle = [without_cuts(ring, [cut for cut in cuts if cut.ring is ring], run) for ring in chain]
    sections = [*low.sections[::-1], *middle, *high.sections]
    return Tube(sections, (low.pole, high.pole), chain[0].hole, chain[0].depth, (low.kind, high.kind))
