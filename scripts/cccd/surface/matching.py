"""From contours to tubes: which rings follow each other, where tubes branch off, and how each one ends.

Rings of one kind that follow each other become a tube. Where tubes merge or split, the one that shares
most with the common outline, the trunk, runs on; each other one is a branch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cccd.geometry.arrays import FloatArray
from cccd.settings.surface import MatchingSettings
from cccd.surface.branching import Cut, branch_off, without_cuts
from cccd.surface.caps import cap_height, opening, planar_cap, reaches_scan_border, rounded_cap
from cccd.surface.ring_graph import DOWN, UP, RingGraph, link_rings
from cccd.surface.rings import Ring
from cccd.surface.stack import Run, SliceStack
from cccd.surface.told import left_out_warnings
from cccd.surface.tubes import EndKind, Section, Tube

__all__ = ["Tubes", "match_contours"]


@dataclass(frozen=True, eq=False)
class Tubes:
    """The tubes of all levels, and mm^3 of each part that was left out, as of fewer voxels than that."""

    tubes: list[Tube]
    left_out: list[float]
    smallest_voxels: float

    @property
    def warnings(self) -> list[str]:
        """What a user should know of them."""
        return left_out_warnings(self.left_out, self.smallest_voxels)


@dataclass(frozen=True, eq=False)
class _End:
    """Sections that close a tube, outwards, its pole if any, why it ends, and what its trunk leaves to it."""

    kind: EndKind
    sections: list[Section]
    pole: FloatArray | None = None
    cuts: Sequence[Cut] = ()


def match_contours(stack: SliceStack, settings: MatchingSettings) -> Tubes:
    """Match the rings of all levels into tubes.

    Parts of fewer than ``settings.smallest_part_voxels`` are left out, unless they are all that a run of
    levels has.
    """
    smallest = settings.smallest_part_voxels * stack.voxel[1:].prod() * stack.step
    matched = [_match_run(run, smallest, settings) for run in stack.runs]
    tubes = [tube for found, _ in matched for tube in found]
    left_out = [volume for _, volumes in matched for volume in volumes]
    return Tubes(tubes, left_out, settings.smallest_part_voxels)


def _match_run(run: Run, smallest: float, settings: MatchingSettings) -> tuple[list[Tube], list[float]]:
    """Tubes of one run of levels, and the volumes of parts of less than ``smallest`` mm^3, left out.

    What no slice shows is not a part: the fields between slices may hold a speck of their own.
    """
    graph = link_rings(run.rings)
    trimmed = [_without_fading_ends(chain, graph, run, settings) for chain in graph.chains()]
    chains = [chain for chain in trimmed if any(ring.source_slice is not None for ring in chain)]
    volumes = np.array([_volume(chain, run.step) for chain in chains])
    large = volumes >= smallest
    if len(chains) and not large.any():
        large[volumes.argmax()] = True
    kept = [chain for chain, is_large in zip(chains, large, strict=True) if is_large]
    ends = [
        (_end(chain[0], DOWN, graph, run, settings), _end(chain[-1], UP, graph, run, settings))
        for chain in kept
    ]
    cuts = [cut for both in ends for end in both for cut in end.cuts]
    tubes = [
        _tube(chain, low, high, cuts, run, settings.fade_pixels)
        for chain, (low, high) in zip(kept, ends, strict=True)
    ]
    return tubes, volumes[~large].tolist()


def _without_fading_ends(
    chain: list[Ring], graph: RingGraph, run: Run, settings: MatchingSettings
) -> list[Ring]:
    """Drop a chain's first and last ring where they lie between slices and nothing goes on from them.

    What lies beyond a tube's last slice is decided by its cap, not by the distance to other parts.
    """
    if chain[-1].source_slice is None and not _goes_on(chain[-1], UP, graph, run, settings):
        chain = chain[:-1]
    if chain and chain[0].source_slice is None and not _goes_on(chain[0], DOWN, graph, run, settings):
        chain = chain[1:]
    return chain


def _goes_on(ring: Ring, way: int, graph: RingGraph, run: Run, settings: MatchingSettings) -> bool:
    """Whether anything of the same kind, or for a hole the open outside, follows the ring."""
    if graph.next(ring, way) or graph.touched(ring, way):
        return True
    return ring.hole and opening(ring, way, run, settings.opening_share) is not None


def _volume(chain: Sequence[Ring], step: float) -> float:
    """Volume in mm^3 that a chain stands for."""
    rise = chain[-1].z - chain[0].z
    return float(np.mean([ring.area for ring in chain])) * max(rise, step)


def _end(ring: Ring, way: int, graph: RingGraph, run: Run, settings: MatchingSettings) -> _End:
    """How a tube ends beyond its first or last ring."""
    if graph.touched(ring, way):
        sections, cuts = branch_off(ring, way, graph, run, settings)
        if sections:
            return _End("joined", sections, cuts=cuts)
    if ring.hole and (sections := opening(ring, way, run, settings.opening_share)) is not None:
        return _End("opens", sections)
    if reaches_scan_border(ring, way, run):
        return _End("cut", planar_cap(ring, way, run))
    height = cap_height(ring, way, graph, run, settings)
    return _End("cap", *rounded_cap(ring, way, height, settings.rim_depth))


def _tube(
    chain: Sequence[Ring], low: _End, high: _End, cuts: Sequence[Cut], run: Run, fade_pixels: float
) -> Tube:
    """Put a tube together: its ends, and between them its rings without what they leave to branches."""
    middle = [
        without_cuts(ring, [cut for cut in cuts if cut.ring is ring], run, fade_pixels) for ring in chain
    ]
    sections = [*low.sections[::-1], *middle, *high.sections]
    return Tube(sections, (low.pole, high.pole), chain[0].hole, chain[0].depth, (low.kind, high.kind))
