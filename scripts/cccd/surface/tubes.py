"""From rings to tubes: matching between levels, branching, and how each tube ends.

Rings of one kind that follow each other become a tube. Where tubes merge or split, the one that shares
most with the common outline, the trunk, runs on; each other one is a branch. Over a junction of some
depth the branch reaches into the trunk while the trunk lets go of the branch's part of the common
outline step by step. So both run smoothly, their solids overlap, and their union is the organ.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import contourpy
import cv2
import numpy as np
import shapely

from cccd.surface.fields import Field
from cccd.surface.rings import Ring, overlap, resample, signed_area

__all__ = ["Section", "Tube", "build_tubes"]

#: A junction's trunk takes over this many mm of the branch's width per mm of depth.
JUNCTION_SLOPE = 2.0
#: Levels of a junction, at least and at most.
JUNCTION_LEVELS = (2, 80)
#: A junction looks at least this many pixels beyond its outlines.
WINDOW_PIXELS = 8
#: A branch reaches this many times as deep as it takes the trunk to hold its whole width.
EXTRA_DEPTH = 1.15
#: How far branch and trunk overlap, how deep below the trunk's surface a branch ends, and over which
#: width the trunk sinks below the branch's surface where it lets go of it, in pixels.
OVERLAP_PIXELS, BURIED_PIXELS, FADE_PIXELS = 1.5, 3.0, 4.0
#: How steeply a branch sinks below the trunk's surface.
BURIAL_SLOPE = 0.3
#: Least and largest height of a paraboloid dome in slice steps: its pole stays short of the next slice,
#: where nothing is.
DOME_HEIGHT = (0.1, 0.95)
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
    None where a flat lid closes it. ``ends`` says why it ends there: ``joined`` to a trunk, ``cap``,
    ``cut`` by the scan, or a hole that ``opens``.
    """

    sections: list[Section]
    pole: list[np.ndarray | None]
    hole: bool
    depth: int
    ends: tuple[str, str]


@dataclass(eq=False)
class _Node:
    """A ring and its links; index 0 is downwards, 1 is upwards.

    ``cuts`` are what junctions take from the ring's outline: each a block of the plane's pixels and a
    field on it, positive where the outline gives way to a branch.
    """

    ring: Ring
    follows: list[_Node | None] = field(default_factory=lambda: [None, None])
    touches: tuple[list[_Node], list[_Node]] = field(default_factory=lambda: ([], []))
    cuts: list[tuple[tuple[slice, slice], np.ndarray]] = field(default_factory=list)


@dataclass
class _Stack:
    """What the functions below share about one stack of levels."""

    fields: Sequence[Field]
    nodes: list[list[_Node]]
    spacing: np.ndarray
    half_step: float
    scan_range: tuple[float, float]

    @property
    def pixel(self) -> float:
        return float(np.sqrt(self.spacing.prod()))


def build_tubes(
    fields: Sequence[Field],
    rings: Sequence[Sequence[Ring]],
    spacing: np.ndarray,
    half_step: float,
    scan_range: tuple[float, float],
    smallest: float,
) -> tuple[list[Tube], int]:
    """Tubes of one stack of levels, and how many parts were too small for one.

    Parameters
    ----------
    fields, rings : sequences
        Every level's field and its rings, from low to high.
    spacing : (2,) float64
        mm per pixel along i and j.
    half_step : float
        Half the distance between slices in mm: how far the organ reaches beyond its last slice.
    scan_range : (float, float)
        Heights of the volume's first and last slice: an organ that reaches them was cut by the scan.
    smallest : float
        Parts of less volume in mm^3 are left out, unless they are all there is.
    """
    nodes = [[_Node(ring) for ring in level] for level in rings]
    for lower, upper in itertools.pairwise(nodes):
        _match(lower, upper)
    stack = _Stack(fields, nodes, spacing, half_step, scan_range)
    chains = [_chain(node, stack) for level in nodes for node in level if node.follows[0] is None]
    chains = [chain for chain in chains if chain]
    if worthy := [chain for chain in chains if _volume(chain, half_step) >= smallest]:
        kept = worthy
    else:
        kept = sorted(chains, key=lambda chain: -_volume(chain, half_step))[:1]
    ends = [(_end(chain[0], 0, stack), _end(chain[-1], 1, stack)) for chain in kept]
    tubes = [_tube(chain, *both, stack) for chain, both in zip(kept, ends, strict=True)]
    return tubes, len(chains) - len(kept)


def _match(lower: Sequence[_Node], upper: Sequence[_Node]) -> None:
    """Link rings of two neighbouring levels that continue each other; note which others touch."""
    pairs = [
        (shared, a, b)
        for a in lower
        for b in upper
        if a.ring.hole == b.ring.hole and (shared := overlap(a.ring, b.ring))
    ]
    pairs.sort(key=lambda pair: -pair[0])
    for _, a, b in pairs:
        if a.follows[1] is None and b.follows[0] is None and a.ring.depth == b.ring.depth:
            a.follows[1], b.follows[0] = b, a
        else:
            a.touches[1].append(b)
            b.touches[0].append(a)


def _chain(first: _Node, stack: _Stack) -> list[_Node]:
    """Follow a tube upwards, without levels between slices where the shape fades out towards nothing.

    What lies beyond a tube's last slice is decided by its cap, not by the distance to other parts.
    """
    chain = [first]
    while chain[-1].follows[1] is not None:
        chain.append(chain[-1].follows[1])
    while chain and chain[-1].ring.source_slice is None and not _goes_on(chain[-1], 1, stack):
        chain = chain[:-1]
    while chain and chain[0].ring.source_slice is None and not _goes_on(chain[0], 0, stack):
        chain = chain[1:]
    return chain


def _volume(chain: Sequence[_Node], half_step: float) -> float:
    """Volume in mm^3 that a chain stands for."""
    rise = chain[-1].ring.z - chain[0].ring.z
    return float(np.mean([node.ring.area for node in chain])) * max(rise, 2 * half_step)


def _goes_on(node: _Node, way: int, stack: _Stack) -> bool:
    """Whether anything of the same kind, or for a hole the open outside, follows the ring."""
    if node.follows[way] or node.touches[way]:
        return True
    return node.ring.hole and _opening(node, way, stack) is not None


def _end(node: _Node, way: int, stack: _Stack) -> tuple[list[Section], np.ndarray | None, str]:
    """Sections that close a tube beyond ``node``, outwards, the pole if any, and what kind of end it is."""
    ring = node.ring
    direction = 2 * way - 1
    if node.touches[way] and (sections := _junction(node, way, stack)):
        return sections, None, "joined"
    if ring.hole and (sections := _opening(node, way, stack)) is not None:
        return sections, None, "opens"
    if abs(ring.z - stack.scan_range[way]) < stack.half_step:
        z = ring.z + direction * stack.half_step
        return [Section(z, ring.points, ring.area)], None, "cut"
    return (*_round_cap(ring, direction, _dome_height(node, way, stack)), "cap")


def _dome_height(node: _Node, way: int, stack: _Stack) -> float:
    """Height in mm at which a tube closes beyond ``node``, by the area of its last slices.

    Near its pole the section of any smooth body falls linearly with height, as a paraboloid's does.
    """
    step = 2 * stack.half_step
    before = node
    while before.follows[1 - way] is not None and abs(before.ring.z - node.ring.z) < 0.99 * step:
        before = before.follows[1 - way]
    fall = (before.ring.area - node.ring.area) / max(abs(before.ring.z - node.ring.z), 1e-9)
    low, high = DOME_HEIGHT
    return float(np.clip(node.ring.area / fall, low * step, high * step)) if fall > 0 else high * step


def _junction(branch: _Node, way: int, stack: _Stack) -> list[Section]:
    """Sections of a branch inside its trunk; notes on the trunk's nodes what the branch takes over.

    The common outline is parted by the line midway between the branch and the other rings of the last
    level on which they are apart; ``lead`` is the distance from that line, positive on the branch's
    side. The trunk keeps what leads by no more than ``held``, which grows with depth.
    """
    trunk = max(branch.touches[way], key=lambda node: overlap(branch.ring, node.ring))
    others = [
        node.ring
        for node in (*trunk.touches[1 - way], trunk.follows[1 - way])
        if node is not None and node is not branch
    ]
    if not others:
        return []
    path = _path(trunk, way)
    window = _window([branch.ring, *others, *(node.ring for node in path)], stack)
    leads, slope = _leads(_Lead(branch.ring, others, window, stack.pixel), branch.ring.z, path)
    overlapping, buried, fade = stack.pixel * np.array([OVERLAP_PIXELS, BURIED_PIXELS, FADE_PIXELS])
    sections = []
    for node, leading in zip(path, leads, strict=False):
        held = slope * abs(node.ring.z - branch.ring.z)
        inside = _inside(node.ring, stack)[window]
        below = np.clip(BURIAL_SLOPE * (held - fade - leading), 0, buried)
        plane = np.maximum(inside + below, -leading - overlapping)
        outline = _outline(plane, branch.ring, stack.spacing, (window[0].start, window[1].start))
        if outline is None or (sections and abs(signed_area(outline)) < 4 * stack.pixel**2):
            break
        sections.append(Section(node.ring.z, outline, abs(signed_area(outline))))
        node.cuts.append((window, leading - held))
    return sections


def _path(trunk: _Node, way: int) -> list[_Node]:
    """Give the trunk's nodes from the junction inwards, as many as a junction may take."""
    path = [trunk]
    while path[-1].follows[way] is not None and len(path) < JUNCTION_LEVELS[1]:
        path.append(path[-1].follows[way])
    return path


def _leads(lead: _Lead, z: float, path: Sequence[_Node]) -> tuple[list[np.ndarray], float]:
    """Fields of the lead on the levels of a junction that begins at height ``z``, and its slope.

    The junction ends where the trunk holds the whole width of the branch's part, and some more.
    """
    fields: list[np.ndarray] = []
    slope = JUNCTION_SLOPE
    for node in path:
        field = lead.field(node.ring)
        if field is None:  # apart again: another branch goes on from here
            return fields, JUNCTION_SLOPE
        fields.append(field)
        wanted = EXTRA_DEPTH * lead.width(node.ring, field) / max(abs(node.ring.z - z), 1e-9)
        if len(fields) >= JUNCTION_LEVELS[0] and wanted <= JUNCTION_SLOPE:
            return fields, JUNCTION_SLOPE
        slope = max(JUNCTION_SLOPE, wanted)
    return fields, slope


def _window(rings: Sequence[Ring], stack: _Stack) -> tuple[slice, slice]:
    """Block of the plane's pixels around some rings, with room for what grows from them."""
    low = np.min([ring.corner for ring in rings], axis=0)
    high = np.max([ring.corner + ring.mask.shape for ring in rings], axis=0)
    room = np.maximum(WINDOW_PIXELS, (high - low) // 4)
    stop = np.minimum(high + room, stack.fields[0].distance.shape)
    return tuple(slice(int(a), int(b)) for a, b in zip(np.maximum(low - room, 0), stop, strict=True))


def _inside(ring: Ring, stack: _Stack) -> np.ndarray:
    """Field of a ring's level, negative inside what the ring bounds."""
    plane = stack.fields[ring.level].distance
    return -plane if ring.hole else plane


class _Lead:
    """Parts a common outline between a branch and others, on a block of the plane's pixels.

    The branch's part is what lies nearer to the branch in one piece with it, and what the trunk could
    only reach through that.
    """

    def __init__(self, branch: Ring, others: Sequence[Ring], window: tuple[slice, slice], pixel: float):
        self.window, self.pixel = window, pixel
        self.branch, self.others = _pixels([branch], window), _pixels(others, window)
        self.nearer = _signed_distance(self.branch, pixel) < _signed_distance(self.others, pixel)

    def field(self, common: Ring) -> np.ndarray | None:
        """Distance in mm from the parting line, positive on the branch's side; None without two sides."""
        whole = _pixels([common], self.window)
        own = _piece(whole & self.nearer, self.branch)
        trunk = None if own is None else _piece(whole & ~own, self.others)
        if trunk is None:
            return None
        own = whole & ~trunk
        nearer = _signed_distance(own, self.pixel) < _signed_distance(trunk, self.pixel)
        return -_signed_distance(nearer, self.pixel)

    def width(self, common: Ring, field: np.ndarray) -> float:
        """How far in mm the branch's part reaches beyond the parting line."""
        return float(field[_pixels([common], self.window)].max(initial=0.0))


def _piece(pixels: np.ndarray, wanted: np.ndarray) -> np.ndarray | None:
    """Pick the connected piece of some pixels that has most of the ``wanted`` ones."""
    _, labels = cv2.connectedComponents(pixels.astype(np.uint8), connectivity=4)
    counts = np.bincount(labels[wanted & pixels])
    return labels == int(np.argmax(counts)) if len(counts) else None


def _pixels(rings: Sequence[Ring], window: tuple[slice, slice]) -> np.ndarray:
    """Pixels of a block of the plane that lie inside any of some rings."""
    block = np.zeros([side.stop - side.start for side in window], bool)
    for ring in rings:
        low = ring.corner - [side.start for side in window]
        first, last = np.maximum(low, 0), np.minimum(low + ring.mask.shape, block.shape)
        if np.all(last > first):
            part = ring.mask[tuple(map(slice, first - low, last - low))]
            block[tuple(map(slice, first, last))] |= part.astype(bool)
    return block


def _signed_distance(inside: np.ndarray, pixel: float) -> np.ndarray:
    """Distance in mm to the border of a set of pixels, negative inside."""
    inside = inside.astype(np.uint8)
    outwards = cv2.distanceTransform(1 - inside, cv2.DIST_L2, cv2.DIST_MASK_5)
    inwards = cv2.distanceTransform(inside, cv2.DIST_L2, cv2.DIST_MASK_5)
    return (outwards - inwards) * np.float32(pixel)


def _outline(
    plane: np.ndarray, near: Ring, spacing: np.ndarray, corner: tuple[int, int] = (0, 0)
) -> np.ndarray | None:
    """Find the contour (n, 2) in mm of a field that encloses most of the ring ``near``.

    Contours that leave the block of pixels, whose first pixel is ``corner``, are closed along its border.
    """
    plane = np.pad(plane, 1, constant_values=np.float32(max(1.0, np.abs(plane).max())))
    lines = contourpy.contour_generator(z=plane).lines(0.0)
    best, most = None, 0.0
    for line in lines:
        points = (line[:-1, ::-1] - 1 + corner) * spacing
        around = near.hole and line.min() < 1  # not a hole but the outside, closed along the border
        if len(points) < 4 or signed_area(points) <= 0 or around:
            continue
        if len(lines) == 1:
            return points
        shared = shapely.Polygon(points).buffer(0).intersection(shapely.Polygon(near.points).buffer(0)).area
        if shared > most:
            best, most = points, shared
    return best


def _opening(node: _Node, way: int, stack: _Stack) -> list[Section] | None:
    """Cut the section of a hole on the next level when the hole opens to the outside there.

    A hole that is open in the organ's last slice, or before, runs on straight through the cap.
    """
    ring = node.ring
    level = ring.level + 2 * way - 1
    beyond = (2 * way - 1) * 2 * stack.half_step
    following = stack.nodes[level] if 0 <= level < len(stack.nodes) else []
    covers = [other.ring for other in following if not other.ring.hole and overlap(ring, other.ring)]
    if not covers:
        return [Section(ring.z + beyond, ring.points, ring.area)]
    outside = shapely.Polygon(ring.points).buffer(0)
    for cover in covers:
        outside = outside.difference(shapely.Polygon(cover.points).buffer(0))
    shape = _largest(outside)
    if shape is None or shape.area < max(stack.pixel**2, 0.25 * ring.area):
        return None
    section = _section(stack.fields[level].z, shape)
    if 0 < level < len(stack.nodes) - 1:
        return [section]
    return [section, Section(section.z + beyond, section.points, section.area)]


def _largest(shape: shapely.Geometry) -> shapely.Polygon | None:
    parts = [part for part in shapely.get_parts(shape) if isinstance(part, shapely.Polygon) and part.area > 0]
    return max(parts, key=lambda part: part.area) if parts else None


def _section(z: float, shape: shapely.Polygon) -> Section:
    points = np.array(shape.exterior.coords)[:-1]
    if signed_area(points) < 0:
        points = points[::-1]
    return Section(z, points, abs(signed_area(points)))


def _tube(chain: list[_Node], low: tuple, high: tuple, stack: _Stack) -> Tube:
    """Put a tube together once every junction has said what it takes from the chain's rings."""
    middle = []
    for node in chain:
        ring = node.ring
        points = None
        if node.cuts:
            inside = _inside(ring, stack).copy()
            for window, cut in node.cuts:
                sunk = np.clip(1 + cut / (FADE_PIXELS * stack.pixel), 0, 1) * stack.pixel
                inside[window] = np.maximum(inside[window] + sunk, cut)
            points = _outline(inside, ring, stack.spacing)
        if points is None:
            middle.append(Section(ring.z, ring.points, ring.area))
        else:
            middle.append(Section(ring.z, points, abs(signed_area(points))))
    (below, low_pole, low_kind), (above, high_pole, high_kind) = low, high
    ring = chain[0].ring
    sections = [*below[::-1], *middle, *above]
    return Tube(sections, [low_pole, high_pole], ring.hole, ring.depth, (low_kind, high_kind))


def _round_cap(ring: Ring, direction: int, height: float) -> tuple[list[Section], np.ndarray | None]:
    """Round an end over ``height`` mm.

    A ring that a point inside it sees as a whole closes on a pole; any other is rounded over its rim
    and gets a flat lid that leaves it half the volume too.
    """
    centre = _kernel_point(ring.points)
    if centre is not None:
        sections = [
            Section(
                ring.z + direction * height * float(1 - radius**2),
                centre + radius * (ring.points - centre),
                ring.area * radius**2,
            )
            for radius in DOME_RADII
        ]
        return sections, np.array([*centre, ring.z + direction * height])
    shape = shapely.Polygon(ring.points).buffer(0)
    inradius = 2 * shape.area / shape.length
    depth = min(height / 2, 0.7 * inradius)
    sections = []
    for angle in np.deg2rad([35, 60, 80, 90]):
        smaller = _largest(shape.buffer(-depth * (1 - np.cos(angle))))
        if smaller is None or smaller.area < 0.3 * ring.area:
            break
        sections.append(_section(ring.z + direction * height / 2 * float(np.sin(angle)), smaller))
    if not sections:
        sections = [Section(ring.z + direction * height / 2, ring.points, ring.area)]
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
