"""Which rings of neighbouring levels continue each other, and which only touch."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from cccd.surface.rings import Ring, overlap

__all__ = ["DOWN", "UP", "RingGraph", "link_rings"]

#: The two ways along the stack, as indices.
DOWN, UP = 0, 1


@dataclass(frozen=True, eq=False)
class RingGraph:
    """Links between the rings of neighbouring levels, downwards and upwards.

    Attributes
    ----------
    levels : sequence of sequences of Ring
        From low to high.
    continued : pair of dicts
        The one ring of the next level that a ring runs on in.
    touching : pair of dicts
        The other rings of its kind that overlap it on the next level.
    """

    levels: Sequence[Sequence[Ring]]
    continued: tuple[dict[Ring, Ring], dict[Ring, Ring]]
    touching: tuple[dict[Ring, list[Ring]], dict[Ring, list[Ring]]]

    def next(self, ring: Ring, way: int) -> Ring | None:
        """Find the ring in which a ring runs on, if it does."""
        return self.continued[way].get(ring)

    def touched(self, ring: Ring, way: int) -> list[Ring]:
        """List the rings that overlap a ring on the next level without continuing it."""
        return self.touching[way].get(ring, [])

    def path(self, ring: Ring, way: int, most: int | None = None) -> list[Ring]:
        """List the ring and all in which it runs on, one way; ``most`` of them."""
        path = [ring]
        while (following := self.next(path[-1], way)) is not None and len(path) != most:
            path.append(following)
        return path

    def chains(self) -> list[list[Ring]]:
        """Split the rings into sequences that run on from level to level, from low to high."""
        first = [ring for level in self.levels for ring in level if self.next(ring, DOWN) is None]
        return [self.path(ring, UP) for ring in first]


def link_rings(levels: Sequence[Sequence[Ring]]) -> RingGraph:
    """Link the rings of every two neighbouring levels, those first that share most pixels."""
    links = [_links_between(lower, upper) for lower, upper in itertools.pairwise(levels)]
    continued = [pair for follows, _ in links for pair in follows]
    touching = [pair for _, touches in links for pair in touches]
    return RingGraph(
        levels,
        ({b: a for a, b in continued}, dict(continued)),
        (_grouped((b, a) for a, b in touching), _grouped(touching)),
    )


def _links_between(
    lower: Sequence[Ring], upper: Sequence[Ring]
) -> tuple[list[tuple[Ring, Ring]], list[tuple[Ring, Ring]]]:
    """Pairs of rings (lower, upper) that continue each other, and pairs that touch.

    Each ring runs on in one other at most, of the same kind and nested as deep.
    """
    pairs = [(shared, a, b) for a in lower for b in upper if a.hole == b.hole and (shared := overlap(a, b))]
    taken: set[Ring] = set()
    continued: list[tuple[Ring, Ring]] = []
    touching: list[tuple[Ring, Ring]] = []
    for _, a, b in sorted(pairs, key=lambda pair: -pair[0]):
        if a.depth == b.depth and taken.isdisjoint((a, b)):
            continued.append((a, b))
            taken |= {a, b}
        else:
            touching.append((a, b))
    return continued, touching


def _grouped(pairs: Iterable[tuple[Ring, Ring]]) -> dict[Ring, list[Ring]]:
    """Every first ring's second ones, in their order."""
    groups: defaultdict[Ring, list[Ring]] = defaultdict(list)
    for first, second in pairs:
        groups[first].append(second)
    return dict(groups)
