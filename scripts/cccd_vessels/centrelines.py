"""Centrelines of tubes: a tree of branches with radius, length, tortuosity and angles.

The voxels inside the surface are thinned to lines. Each line then moves to the middle of the sections of the
surface itself, across the line, and is smoothed by a spline. Near a fork no section belongs to one branch
alone: there the axes of the branches are extended straight to where they meet.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import splev, splprep
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from cccd.errors import InputError
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, connected_parts, ranks_of
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh
from cccd.geometry.thickness import Lines, wall_thickness
from cccd_vessels.sections import Section, Slicer
from cccd_vessels.skeleton import Line, degrees, skeleton_lines, without_shortest, without_spurs

#: Voxels that are thinned, per voxel of the scan ...
_PER_VOXEL = 2
#: ... and, of a mesh without a scan, per thickness that 98 % of its surface reach.
_PER_THICKNESS = 6

#: Times that a line moves to the middles of its sections: after three it moves by less than .01 voxels.
_ROUNDS = 3

#: Points of a line lie this share of its radius apart.
_SPACING = 0.25

#: What a point may move to make the line smooth, in thinned voxels: of the voxels' middles, and of sections'.
_ROUGH, _FINE = 0.7, 0.1

#: A section is a branch's own where this share of the triangles is nearer to it than to others.
_OWN = 0.98

#: A point lies this near to the middle of its section, in radii: else the plane goes along the tube.
_NEAR_MIDDLE = 0.5

#: A branch's direction at a fork is that of its points within this many radii.
_STRAIGHT = 2.0

#: A fork may move by this many inscribed radii to where axes meet.
_FORK_REACH = 2.0

#: The surface beyond an end is met within the distance that the skeleton leaves, times this.
_END_REACH = 1.5

#: A tube is longer than so many of its mean radii, from end to end: three times as long as wide.
_TUBE = 6.0


@dataclass(frozen=True, eq=False)
class Branch:
    """One branch, from the fork where it leaves its parent.

    Attributes
    ----------
    number, parent : int
        From 1; 0 for the parent of a root.
    generation : int
        0 for a root.
    start, end : str
        ``end`` where it ends at the surface, ``fork``, or ``loop`` where it closes on itself.
    points : (n, 3) float64
        In mm RAS, evenly spaced.
    tangents : (n, 3) float64
        Of unit length.
    radius : (n,) float64
        Of the circle with the section's area, in mm. Where it is not measured: that of the nearest section
        at an end, the inscribed one at a fork.
    inscribed : (n,) float64
        Of the largest sphere around the point inside the surface.
    least_diameter, largest_diameter : (n,) float64
        Widths of the section; NaN where it is not measured.
    curvature : (n,) float64
        Of the line, in 1/mm.
    measured : (n,) bool
        Whether the section is complete and the branch's own: not at a fork, nor within a radius of an end.
    angle_deg : float
        Between the parent's direction where it ends and this branch's where it starts; NaN for a root.
    """

    number: int
    parent: int
    generation: int
    start: str
    end: str
    points: FloatArray
    tangents: FloatArray
    radius: FloatArray
    inscribed: FloatArray
    least_diameter: FloatArray
    largest_diameter: FloatArray
    curvature: FloatArray
    measured: BoolArray
    angle_deg: float

    @property
    def length(self) -> float:
        """Length in mm: from fork to fork, or to the surface at an end."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    @property
    def chord(self) -> float:
        """Distance from start to end, in mm."""
        return float(np.linalg.norm(self.points[-1] - self.points[0]))

    @property
    def tortuosity(self) -> float:
        """Length by chord; NaN for a loop."""
        return self.length / self.chord if self.start != "loop" else float("nan")

    @property
    def mean_radius(self) -> float:
        """Mean of the measured radii; NaN without any."""
        return float(self.radius[self.measured].mean()) if self.measured.any() else float("nan")


@dataclass(frozen=True, eq=False)
class Centrelines:
    """The centrelines of a structure.

    Attributes
    ----------
    branches : list of Branch
        Parents before their children.
    notes : tuple of str
        What a user should know, one line each.
    """

    branches: list[Branch]
    notes: tuple[str, ...] = ()

    @property
    def loops(self) -> int:
        """Loops of the lines: branches more than a tree has."""
        ends = {_place(b.points[at]) for b in self.branches for at in (0, -1)}
        roots = sum(b.parent == 0 for b in self.branches)
        return len(self.branches) - len(ends) + roots


def _place(point: FloatArray) -> tuple[float, ...]:
    return tuple(np.round(point, 6).tolist())


def find_centrelines(
    mesh: Mesh, voxel_mm: float | None = None, root: Sequence[float] | None = None, location: str = "surface"
) -> Centrelines:
    """Find the centrelines of a closed surface of tubes.

    Parameters
    ----------
    mesh : Mesh
        Closed, in mm RAS.
    voxel_mm : float, optional
        Smallest voxel edge of the scan that it was made of. Default: from its thickness.
    root : (3,) float, optional
        The end nearest to this point is the root; by default the widest.
    location : str
        What messages name.

    Raises
    ------
    InputError
        There is no tube in it.

    Examples
    --------
    >>> import trimesh
    >>> tube = trimesh.creation.cylinder(3.0, 40.0, sections=64)
    >>> (branch,) = find_centrelines(Mesh(tube.vertices, tube.faces)).branches
    >>> round(branch.length, 1), round(branch.mean_radius, 1)
    (40.0, 3.0)
    """
    step = voxel_mm / _PER_VOXEL if voxel_mm else wall_thickness(mesh, 0.02) / _PER_THICKNESS
    lines = without_spurs(skeleton_lines(mesh, step))
    slicer, notes = Slicer(mesh), []
    moved: list[_Moved] = []
    for number in range(_ROUNDS + 1):
        tolerance = step * (_FINE if number else _ROUGH)
        while bumps := _without_sections(moved := _measured(lines, slicer, tolerance)):
            lines = without_shortest(lines, bumps)
        if number < _ROUNDS:
            lines = _centred(moved, mesh)
    tubes = _tubes(moved, location)
    skipped = mesh.count_bodies() - len(tubes)
    if skipped > 0:
        plural = "s" * (skipped > 1)
        notes.append(f"left out {skipped} piece{plural} of the surface, not three times as long as wide")
    moved = [one for tube in tubes for one in tube]
    found = Centrelines(_oriented(moved, root))
    if found.loops:
        loops = f"{found.loops} loop{'s' * (found.loops > 1)}"
        notes.append(f"the centrelines close {loops}: a tree has none. Check the mask there")
    return Centrelines(found.branches, tuple(notes))


@dataclass(frozen=True, eq=False)
class _Moved:
    """A line made smooth, and the sections across it."""

    line: Line
    is_ring: bool
    points: FloatArray
    tangents: FloatArray
    curvature: FloatArray
    inscribed: FloatArray
    sections: list[Section | None]
    own: BoolArray

    @property
    def nodes(self) -> tuple[int, int]:
        return self.line.nodes

    @property
    def radius(self) -> FloatArray:
        radii = [section.radius if section else np.nan for section in self.sections]
        return np.where(self.own, radii, self.inscribed)

    @property
    def centres(self) -> FloatArray:
        return np.array([s.centroid for s, own in zip(self.sections, self.own, strict=True) if own and s])

    def direction(self, end: int) -> FloatArray:
        """Return the unit vector along the line near an end, 0 or -1, out of the line."""
        outward = self.tangents[end] * (1 if end else -1)
        if self.own.sum() < 2:
            return outward
        centres = self.centres if end else self.centres[::-1]
        radius = float(self.radius[self.own][end])
        near = centres[np.linalg.norm(centres - centres[-1], axis=1) <= _STRAIGHT * radius]
        if len(near) < 2:
            near = centres[-2:]
        axis = np.linalg.svd(near - near.mean(axis=0))[2][0]
        return axis if axis @ (near[-1] - near[0]) > 0 else -axis


def _measured(lines: Sequence[Line], slicer: Slicer, tolerance: float) -> list[_Moved]:
    """Smooth lines, and cut the surface across each of their points."""
    if not lines:
        return []
    degree = degrees(lines)
    smooth = [_smoothed(line, tolerance, _is_ring(line, degree)) for line in lines]
    starts = np.cumsum([0, *(len(points) for points, _, _ in smooth)])
    points = np.concatenate([points for points, _, _ in smooth])
    inscribed, cut = slicer.around(points, np.concatenate([way for _, way, _ in smooth]), tolerance)
    owner = _owners(slicer.mesh, points, inscribed, np.repeat(np.arange(len(smooth)), np.diff(starts)))
    moved: list[_Moved] = []
    for number, (line, (at, tangents, curvature)) in enumerate(zip(lines, smooth, strict=True)):
        radii = inscribed[starts[number] : starts[number + 1]]
        sections = cut[starts[number] : starts[number + 1]]
        gone = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(at, axis=0), axis=1))])
        to_end = np.full(len(at), np.inf)
        if degree[line.nodes[0]] == 1:
            to_end = gone + radii[0]
        if degree[line.nodes[1]] == 1:
            to_end = np.minimum(to_end, gone[-1] - gone + radii[-1])
        own = np.array(
            [
                section is not None
                and np.mean(owner[section.faces] == number) >= _OWN
                and section.radius <= away
                and np.linalg.norm(section.centroid - point) <= _NEAR_MIDDLE * section.radius
                for point, section, away in zip(at, sections, to_end, strict=True)
            ],
            bool,
        )
        ring = _is_ring(line, degree)
        own[[0, -1]] &= ring  # else at a fork, or on the surface
        moved.append(_Moved(line, ring, at, tangents, curvature, radii, sections, own))
    return moved


def _is_ring(line: Line, degree: Mapping[int, int]) -> bool:
    """Whether a line closes on itself, with nothing else at that node."""
    return line.nodes[0] == line.nodes[1] and degree[line.nodes[0]] == 2


def _smoothed(line: Line, tolerance: float, around: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Evenly spaced points (n, 3), tangents (n, 3) and curvature (n,) of a spline along a line."""
    spacing = max(_SPACING * float(np.median(line.radii)), 2 * tolerance)
    points = _filled(line.points, spacing)
    degree = min(3, len(points) - 1)
    weights = np.ones(len(points))
    weights[[0, -1]] *= 1 if around else 10  # ends stay
    found: Any = splprep(points.T, w=weights / tolerance, k=degree, s=len(points), per=around)
    spline: Any = found[0]
    fine = np.linspace(0, 1, 20 * len(points))
    dense = np.array(splev(fine, spline)).T
    gone = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(dense, axis=0), axis=1))])
    at = np.interp(np.linspace(0, gone[-1], max(int(np.ceil(gone[-1] / spacing)), 4) + 1), gone, fine)
    first = np.array(splev(at, spline, der=1)).T
    second = np.array(splev(at, spline, der=2)).T if degree > 1 else np.zeros_like(first)
    speed = np.linalg.norm(first, axis=1)
    curvature = np.linalg.norm(np.cross(first, second), axis=1) / speed**3
    smooth = np.array(splev(at, spline)).T
    if not around:
        smooth[[0, -1]] = points[[0, -1]]  # lines of one fork meet
    return smooth, first / speed[:, None], curvature


def _filled(points: FloatArray, spacing: float) -> FloatArray:
    """Put points into gaps of a line (n, 3), so that a spline crosses them straight; doubled ones go."""
    apart = np.linalg.norm(np.diff(points, axis=0), axis=1)
    points = points[np.concatenate([apart > 1e-9, [True]])]
    counts = np.maximum(np.ceil(apart[apart > 1e-9] / spacing).astype(int), 1)
    share = ranks_of(counts) / np.repeat(counts, counts)
    at = np.append(np.repeat(np.arange(len(counts)), counts) + share, len(counts))
    return np.column_stack([np.interp(at, np.arange(len(points)), axis) for axis in points.T])


def _owners(mesh: Mesh, points: FloatArray, radii: FloatArray, lines: IntArray) -> IntArray:
    """Line (F,) to which each triangle belongs: that of the inscribed sphere of the least power distance."""
    # That is the squared distance less the squared radius: a tree in four dimensions finds it.
    lift = np.sqrt(np.maximum(radii.max() ** 2 - radii**2, 0))
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    _, nearest = cKDTree(np.column_stack([points, lift])).query(
        np.column_stack([middles, np.zeros(len(middles))])
    )
    return lines[nearest]


def _without_sections(moved: Sequence[_Moved]) -> list[Line]:
    """Lines with a free end that have no section of their own, where they are not the only one."""
    degree = degrees([one.line for one in moved])
    return [
        one.line
        for one in moved
        if not one.own.any()
        and sorted(degree[node] for node in one.nodes)[0] == 1
        and max(degree[node] for node in one.nodes) > 1
    ]


def _centred(moved: Sequence[_Moved], mesh: Mesh) -> list[Line]:
    """Lines through the middles of their sections, their ends at the surface or where axes meet."""
    forks = _forks(moved, mesh)
    lines_through = Lines(mesh)
    lines: list[Line] = []
    for one in moved:
        centres, radii = one.centres.reshape(-1, 3), one.radius[one.own]
        if one.is_ring:
            enough = len(centres) > 4
            points = np.concatenate([centres[:-1], centres[:1]]) if enough else one.points
            lines.append(Line(one.nodes, points, radii if enough else one.inscribed))
            continue
        ends: list[FloatArray] = []
        for end, node in zip((0, -1), one.nodes, strict=True):
            if node in forks:
                ends.append(forks[node])
            elif len(centres):
                away = np.linalg.norm(one.points[end] - centres[end]) + one.inscribed[end]
                ahead = _END_REACH * away * one.direction(end)
                share = lines_through.first_hits(centres[[end]], (centres[end] + ahead)[None])
                ends.append(centres[end] + share * ahead)
            else:
                ends.append(one.points[end])
        if not len(centres):  # as where two forks are near: straight, if not along another such line
            twin = any(set(other.nodes) == set(one.nodes) for other in moved if other is not one)
            middle = len(one.points) // 2
            centres = one.points[middle : middle + 1] if twin else centres
            radii = one.inscribed[middle : middle + 1]
        points = np.concatenate([ends[:1], centres, ends[1:]])
        lines.append(Line(one.nodes, points, np.concatenate([radii[:1], radii, radii[-1:]])[: len(points)]))
    return lines


def _forks(moved: Sequence[_Moved], mesh: Mesh) -> dict[int, FloatArray]:
    """Where the axes that meet at each fork come nearest to each other."""
    axes: Mapping[int, list[tuple[FloatArray, FloatArray, FloatArray]]] = defaultdict(list)
    for one in moved:
        for end, node in zip((0, -1), one.nodes, strict=True):
            last = one.centres[end] if one.own.any() else one.points[end]
            axes[node].append((last, one.direction(end), one.points[end]))
    axes = {node: ends for node, ends in axes.items() if len(ends) > 2}  # else an end, or where a ring closes
    if not axes:
        return {}
    before = np.array([np.mean([place for _, _, place in ends], axis=0) for ends in axes.values()])
    inscribed = np.maximum(-to_mesh(before, mesh), 0.0)
    forks: dict[int, FloatArray] = {}
    for old, wide, (node, ends) in zip(before, inscribed, axes.items(), strict=True):
        least = 1e-3  # keeps the fork where all axes are one line
        matrix, right = least * np.eye(3), least * old
        for place, way, _ in ends:
            off = np.eye(3) - np.outer(way, way)
            matrix, right = matrix + off, right + off @ place
        meeting = np.linalg.solve(matrix, right)
        away = float(np.linalg.norm(meeting - old))
        forks[node] = meeting if away <= _FORK_REACH * wide else old
    return forks


def _tubes(moved: Sequence[_Moved], location: str) -> list[list[_Moved]]:
    """Take the connected lines that are long for their width."""
    kept: list[list[_Moved]] = []
    for part in _components(moved):
        radii = np.concatenate([one.radius[one.own] for one in part])
        if len(radii) and _longest([one.line for one in part]) > _TUBE * float(radii.mean()):
            kept.append(part)
    if not kept:
        raise InputError(
            location,
            "there is no tube in it: nothing is three times as long as wide",
            "give a vessel, an airway or a duct",
        )
    return kept


def _components(moved: Sequence[_Moved]) -> list[list[_Moved]]:
    nodes = np.array([one.nodes for one in moved]).reshape(-1, 2)
    part = connected_parts(nodes[:, 0], nodes[:, 1], int(nodes.max(initial=0)) + 1)[nodes[:, 0]]
    return [[one for one, own in zip(moved, part == n, strict=True) if own] for n in np.unique(part)]


def _longest(lines: Sequence[Line]) -> float:
    """Length of the longest of the shortest ways between nodes, or of a ring."""
    nodes, at = np.unique([line.nodes for line in lines], return_inverse=True)
    at, lengths = at.reshape(-1, 2), [line.length for line in lines]
    graph = coo_array((lengths, at.T), shape=(len(nodes), len(nodes))).tocsr()
    ways = dijkstra(graph, directed=False)
    rings = [length for length, (a, b) in zip(lengths, at, strict=True) if a == b]
    return float(max([ways[np.isfinite(ways)].max(), *rings]))


def _oriented(moved: Sequence[_Moved], root: Sequence[float] | None) -> list[Branch]:
    """Branches from the root on, parents first; of each piece that is not connected a tree of its own."""
    branches: list[Branch] = []
    chosen = None if root is None else _nearest_end(moved, np.asarray(root, float))
    for part in sorted(_components(moved), key=lambda one: -sum(line.line.length for line in one)):
        nodes = {node for one in part for node in one.nodes}
        start = chosen if chosen in nodes else _widest_end(part)
        _grow(part, start, branches)
    return branches


def _free_ends(moved: Sequence[_Moved]) -> list[tuple[int, _Moved, int]]:
    degree = degrees([one.line for one in moved])
    ends = [(node, one, end) for one in moved for end, node in zip((0, -1), one.nodes, strict=True)]
    return [found for found in ends if degree[found[0]] == 1]


def _nearest_end(moved: Sequence[_Moved], point: FloatArray) -> int | None:
    ends = _free_ends(moved)
    return min(ends, key=lambda e: float(np.linalg.norm(e[1].points[e[2]] - point)))[0] if ends else None


def _widest_end(part: Sequence[_Moved]) -> int:
    ends = _free_ends(part)
    if not ends:
        return part[0].nodes[0]
    return max(ends, key=lambda e: float(e[1].radius[e[1].own][e[2]]) if e[1].own.any() else 0.0)[0]


def _grow(part: Sequence[_Moved], root: int, branches: list[Branch]) -> None:
    """Append the branches of a connected piece, from a node on, generation by generation."""
    left = list(part)
    degree = degrees([one.line for one in part])
    fronts: list[tuple[int, Branch | None, FloatArray | None]] = [(root, None, None)]
    while fronts:
        node, parent, arriving = fronts.pop(0)
        leaving = [one for one in left if node in one.nodes]
        left = [one for one in left if node not in one.nodes]
        for one in sorted(leaving, key=lambda one: -float(one.radius.mean())):
            turned = one.nodes[0] != node
            first, last = (-1, 0) if turned else (0, -1)
            angle = np.nan
            if arriving is not None:
                cosine = float(np.clip(arriving @ -one.direction(first), -1, 1))
                angle = float(np.degrees(np.arccos(cosine)))
            branch = _branch(one, turned, len(branches) + 1, parent, angle, degree)
            branches.append(branch)
            fronts.append((one.nodes[last], branch, one.direction(last)))


def _branch(
    one: _Moved, turned: bool, number: int, parent: Branch | None, angle: float, degree: Mapping[int, int]
) -> Branch:
    way = -1 if turned else 1
    names = ["loop" if one.is_ring else "end" if degree[node] == 1 else "fork" for node in one.nodes[::way]]
    least, largest = (
        np.where(one.own, [getattr(section, name, np.nan) for section in one.sections], np.nan)
        for name in ("least_diameter", "largest_diameter")
    )
    radius, measured = one.radius[::way].copy(), np.flatnonzero(one.own[::way])
    if len(measured):
        first, last = measured[0], measured[-1]
        radius[:first] = radius[first] if names[0] == "end" else radius[:first]
        radius[last:] = radius[last] if names[1] == "end" else radius[last:]
    return Branch(
        number=number,
        parent=parent.number if parent else 0,
        generation=parent.generation + 1 if parent else 0,
        start=names[0],
        end=names[1],
        points=one.points[::way],
        tangents=way * one.tangents[::way],
        radius=radius,
        inscribed=one.inscribed[::way],
        least_diameter=least[::way],
        largest_diameter=largest[::way],
        curvature=one.curvature[::way],
        measured=one.own[::way],
        angle_deg=angle,
    )
