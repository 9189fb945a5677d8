"""From rings to tubes: matching between levels, branching, and how each tube ends.

Rings of one kind that follow each other become a tube. Where shapes jump (an organ splits, merges or
makes a step) tubes end, and the smaller partner reaches a little way into the larger one, so that the
solids overlap and their union is connected.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from cccd.surface.rings import Ring, overlap, resample, signed_area

__all__ = ["Section", "Tube", "build_tubes", "match_rings", "outlines"]

#: A ring continues another when they share this part of their union, or
CONTINUITY = 0.6
#: when they only touch each other and the smaller has at least this part of the larger one's area.
SIMILAR_AREA = 0.45
#: Levels by which a branch reaches into its trunk, at most.
REACH_LEVELS = 3
#: How deep below the trunk's surface a branch runs, in pixels per level.
REACH_DEPTH_PIXELS = 0.3
#: A dome over half a slice's thickness of cylinder has the same volume when it is half as high again.
DOME_HEIGHT = 1.5
#: Radii, as shares of the end ring's, at which a dome is sampled.
DOME_RADII = np.array([0.96, 0.85, 0.65, 0.4, 0.15])


@dataclass(eq=False)
class Section:
    """One cross-section of a tube: a closed polygon (n, 2) in mm at height ``z``, and its area."""

    z: float
    points: np.ndarray
    area: float


@dataclass(eq=False)
class Tube:
    """Sections from the lowest to the highest, and how the two ends close.

    ``pole`` holds, for the low and the high end, the point (3,) mm on which the tube closes smoothly, or
    None where a flat lid closes it.
    """

    sections: list[Section]
    pole: list[np.ndarray | None]
    hole: bool
    depth: int
    ends: tuple[str, str] = ("", "")
    slices: int = 0


@dataclass(eq=False)
class _Node:
    ring: Ring
    up: _Node | None = None
    down: _Node | None = None
    touches_up: list[_Node] = field(default_factory=list)
    touches_down: list[_Node] = field(default_factory=list)

    def step(self, direction: int) -> _Node | None:
        return self.up if direction > 0 else self.down

    def touches(self, direction: int) -> list[_Node]:
        return self.touches_up if direction > 0 else self.touches_down


def match_rings(lower: Sequence[_Node], upper: Sequence[_Node]) -> None:
    """Link rings of two neighbouring levels that continue each other; note which others touch."""
    pairs = []
    touching: dict[_Node, int] = {}
    for a in lower:
        for b in upper:
            if a.ring.hole != b.ring.hole:
                continue
            shared = overlap(a.ring, b.ring)
            if shared:
                pairs.append((shared, a, b))
                touching[a] = touching.get(a, 0) + 1
                touching[b] = touching.get(b, 0) + 1
    pairs.sort(key=lambda pair: -pair[0])
    for shared, a, b in pairs:
        sizes = np.array([np.count_nonzero(a.ring.mask), np.count_nonzero(b.ring.mask)])
        alike = shared / (sizes.sum() - shared) >= CONTINUITY
        alone = touching[a] == touching[b] == 1 and sizes.min() >= SIMILAR_AREA * sizes.max()
        if a.up is None and b.down is None and a.ring.depth == b.ring.depth and (alike or alone):
            a.up, b.down = b, a
        else:
            a.touches_up.append(b)
            b.touches_down.append(a)


def build_tubes(
    levels: Sequence[Sequence[Ring]],
    heights: np.ndarray,
    half_step: float,
    pixel: float,
    scan_range: tuple[float, float],
) -> list[Tube]:
    """Tubes of one stack of levels.

    Parameters
    ----------
    levels : sequence of sequences of Ring
        Rings of every level, from low to high.
    heights : (L,) float64
        Height of every level in mm.
    half_step : float
        Half the distance between slices in mm: how far the organ reaches beyond its last slice.
    pixel : float
        Pixel size in mm.
    scan_range : (float, float)
        Heights of the volume's first and last slice: an organ that reaches them was cut by the scan.
    """
    nodes = [[_Node(ring) for ring in rings] for rings in levels]
    for lower, upper in itertools.pairwise(nodes):
        match_rings(lower, upper)
    context = _Context(nodes, heights, half_step, pixel, scan_range)
    tubes = []
    for level in nodes:
        for node in level:
            if node.down is None:
                tube = _tube_from(node, context)
                if tube is not None:
                    tubes.append(tube)
    return tubes


@dataclass
class _Context:
    nodes: list[list[_Node]]
    heights: np.ndarray
    half_step: float
    pixel: float
    scan_range: tuple[float, float]


def _tube_from(first: _Node, context: _Context) -> Tube | None:
    chain = [first]
    while chain[-1].up is not None:
        chain.append(chain[-1].up)
    chain = _without_loose_ends(chain, context)
    if not chain:
        return None
    low, low_pole, low_kind = _end(chain[0], -1, context)
    high, high_pole, high_kind = _end(chain[-1], +1, context)
    middle = [Section(node.ring.z, node.ring.points, node.ring.area) for node in chain]
    ring = chain[0].ring
    slices = sum(node.ring.source_slice is not None for node in chain)
    sections = [*low[::-1], *middle, *high]
    return Tube(sections, [low_pole, high_pole], ring.hole, ring.depth, (low_kind, high_kind), slices)


def _without_loose_ends(chain: list[_Node], context: _Context) -> list[_Node]:
    """Drop levels between slices where the shape fades out towards nothing.

    What lies beyond a tube's last slice is decided by its cap, not by the distance to other parts.
    """
    while chain and chain[-1].ring.source_slice is None and not _neighbour(chain[-1], +1, context):
        chain = chain[:-1]
    while chain and chain[0].ring.source_slice is None and not _neighbour(chain[0], -1, context):
        chain = chain[1:]
    return chain


def _neighbour(node: _Node, direction: int, context: _Context) -> bool:
    """Whether anything of the same kind, or for a hole the open outside, follows the ring."""
    if node.step(direction) or node.touches(direction):
        return True
    return node.ring.hole and _opening(node, direction, context) is not None


def _end(node: _Node, direction: int, context: _Context) -> tuple[list[Section], np.ndarray | None, str]:
    """Sections that close a tube beyond ``node``, outwards, the pole if any, and what kind of end it is."""
    ring = node.ring
    level = ring.level + direction
    if touching := node.touches(direction):
        partner = max(touching, key=lambda other: overlap(ring, other.ring))
        if partner.ring.area >= ring.area:
            reach = _reach(node, partner, direction, context)
            if reach:
                return reach, None, "joined"
        half = abs(context.heights[level] - ring.z) / 2
        return (*_round_cap(ring, direction, min(half, context.half_step), context.pixel), "step")
    if ring.hole and (sections := _opening(node, direction, context)) is not None:
        return sections, None, "opens"
    half = context.half_step
    limit = context.scan_range[0 if direction < 0 else 1]
    if abs(ring.z - limit) < half:
        return [Section(ring.z + direction * half, ring.points, ring.area)], None, "cut"
    return (*_round_cap(ring, direction, half, context.pixel), "cap")


def _reach(node: _Node, partner: _Node, direction: int, context: _Context) -> list[Section]:
    """Sections of a branch inside its trunk, each a little further below the trunk's surface."""
    sections: list[Section] = []
    shape = shapely.Polygon(node.ring.points).buffer(0)
    step = REACH_DEPTH_PIXELS * context.pixel
    while partner is not None and len(sections) < REACH_LEVELS:
        trunk = shapely.Polygon(partner.ring.points).buffer(0)
        if not node.ring.hole:
            trunk = trunk.buffer(-step)
        shape = _largest(shape.intersection(trunk))
        if shape is None or shape.area < max(2 * context.pixel**2, 0.1 * node.ring.area):
            break
        sections.append(_section(partner.ring.z, shape))
        shape = shape.buffer(-step)
        partner = partner.step(direction)
    return sections


def _opening(node: _Node, direction: int, context: _Context) -> list[Section] | None:
    """Cut the section of a hole on the next level when the hole opens to the outside there."""
    ring = node.ring
    level = ring.level + direction
    if not 0 <= level < len(context.nodes):
        return None
    outside = shapely.Polygon(ring.points).buffer(0)
    for other in context.nodes[level]:
        if not other.ring.hole and overlap(ring, other.ring):
            outside = outside.difference(shapely.Polygon(other.ring.points).buffer(0))
    shape = _largest(outside)
    if shape is None or shape.area < max(context.pixel**2, 0.25 * ring.area):
        return None
    return [_section(float(context.heights[level]), shape)]


def _largest(shape: shapely.Geometry) -> shapely.Polygon | None:
    parts = [part for part in shapely.get_parts(shape) if isinstance(part, shapely.Polygon) and part.area > 0]
    return max(parts, key=lambda part: part.area) if parts else None


def _section(z: float, shape: shapely.Polygon) -> Section:
    points = np.array(shape.exterior.coords)[:-1]
    if signed_area(points) < 0:
        points = points[::-1]
    return Section(z, points, float(shapely.Polygon(points).area))


def _round_cap(
    ring: Ring, direction: int, half: float, pixel: float
) -> tuple[list[Section], np.ndarray | None]:
    """Round an end so that it holds the volume of half a slice.

    A ring that a point inside it sees as a whole closes on a pole; any other is rounded over its rim
    and gets a flat lid.
    """
    centre = _kernel_point(ring.points)
    if centre is not None:
        height = DOME_HEIGHT * half
        sections = [
            Section(
                ring.z + direction * height * float(np.sqrt(1 - radius**2)),
                centre + radius * (ring.points - centre),
                ring.area * radius**2,
            )
            for radius in DOME_RADII
        ]
        return sections, np.array([*centre, ring.z + direction * height])
    shape = shapely.Polygon(ring.points).buffer(0)
    inradius = 2 * shape.area / shape.length
    depth = min(half, 0.7 * inradius)
    sections = []
    for angle in np.deg2rad([35, 60, 80, 90]):
        smaller = _largest(shape.buffer(-depth * (1 - np.cos(angle))))
        if smaller is None or smaller.area < 0.3 * ring.area:
            break
        sections.append(_section(ring.z + direction * half * float(np.sin(angle)), smaller))
    if not sections:
        sections = [Section(ring.z + direction * half, ring.points, ring.area)]
    return sections, None


def _kernel_point(points: np.ndarray) -> np.ndarray | None:
    """Find a point from which the whole polygon is seen, but for its pixel steps; None for bent shapes."""
    outline = resample(points, 48)
    smooth = (np.roll(outline, 1, axis=0) + 2 * outline + np.roll(outline, -1, axis=0)) / 4
    shape = shapely.Polygon(smooth)
    for centre in (shape.centroid, shapely.maximum_inscribed_circle(shape.buffer(0)).centroid):
        arms = smooth - (centre.x, centre.y)
        following = np.roll(arms, -1, axis=0)
        turning = arms[:, 0] * following[:, 1] - arms[:, 1] * following[:, 0]
        if np.all(turning > 0):
            return np.array([centre.x, centre.y])
    return None


def outlines(tube: Tube, count: int) -> np.ndarray:
    """Sections as (A, count, 2), each turned to start where its neighbour below starts.

    The turn that brings two centred outlines closest is the peak of their circular correlation.
    """
    rings = np.stack([resample(section.points, count) for section in tube.sections])
    plane = rings[..., 0] + 1j * rings[..., 1]
    plane = plane - 0.7 * plane.mean(axis=1, keepdims=True)
    spectra = np.fft.fft(plane, axis=1)
    shift = 0
    for n in range(1, len(rings)):
        correlation = np.fft.ifft(spectra[n] * np.conj(spectra[n - 1])).real
        shift += int(np.argmax(correlation))
        rings[n] = np.roll(rings[n], -(shift % count), axis=0)
    return rings
