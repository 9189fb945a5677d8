"""The skeleton of a solid as a graph of lines: voxels thinned, traced, and freed of spurs."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from cccd.geometry.arrays import FloatArray, IntArray, connected_parts
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import voxelise

#: Voxels of the grid that is thinned at most: thinning takes about a second for each 2 million.
_MOST_VOXELS = 40e6

#: A branch that ends counts if it is longer, from the axis that it leaves, than this share of the inscribed
#: radius there and its own radius together: what protrudes less is a bump of the wall.
_SPUR_SHARE = 1.5


#: The grid is turned by ten degrees: a tube along an axis of the grid would be thinned from its ends, too.
_TURN = Rotation.from_rotvec((0.11, 0.07, 0.13)).as_matrix()


@dataclass(frozen=True, eq=False)
class Line:
    """One line of a skeleton, between two of its nodes.

    Attributes
    ----------
    nodes : (int, int)
        Where it begins and ends; the same node for a loop.
    points : (n, 3) float64
        From node to node, both included, in mm.
    radii : (n,) float64
        Distance of each point to the surface, in mm.
    """

    nodes: tuple[int, int]
    points: FloatArray
    radii: FloatArray

    @property
    def length(self) -> float:
        """Length in mm."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    def reversed(self) -> Line:
        """Return the line from its end to its start."""
        return Line((self.nodes[1], self.nodes[0]), self.points[::-1], self.radii[::-1])


def skeleton_lines(mesh: Mesh, step: float) -> list[Line]:
    """Thin the voxels inside a closed mesh to lines (Lee et al. 1994).

    Parameters
    ----------
    mesh : Mesh
    step : float
        Edge of the voxels in mm; larger where there would be too many.

    Returns
    -------
    list of Line
        Spurs included; loops of the solid are loops of the lines.
    """
    from skimage.morphology import skeletonize

    turned = Mesh(mesh.vertices @ _TURN.T, mesh.faces)
    size = np.ptp(turned.vertices, axis=0)
    step = max(step, float(np.prod(size) / _MOST_VOXELS) ** (1 / 3))
    affine = np.diag([step, step, step, 1.0])
    affine[:3, 3] = turned.vertices.min(axis=0) - 1.5 * step
    a, b, c = (int(n) + 4 for n in np.ceil(size / step))
    inside = voxelise(turned, affine, (a, b, c))
    radii = np.asarray(ndimage.distance_transform_edt(inside), float)
    voxels = np.argwhere(np.asarray(skeletonize(inside, method="lee"), bool))
    if not len(voxels):
        return []
    affine[:3] = _TURN.T @ affine[:3]
    return _traced(voxels, affine, step * (radii[tuple(voxels.T)] - 0.5))


def _traced(voxels: IntArray, affine: FloatArray, radii: FloatArray) -> list[Line]:
    """Lines between the voxels (N, 3) where a skeleton ends or branches."""
    pairs = _links(voxels)
    count = len(voxels)
    points = voxels @ affine[:3, :3].T + affine[:3, 3]
    degree = np.bincount(pairs.ravel(), minlength=count)
    branching = degree > 2
    inner = pairs[branching[pairs].all(axis=1)]
    node = connected_parts(inner[:, 0], inner[:, 1], count)
    stop = degree != 2
    middles = {int(n): points[stop & (node == n)].mean(axis=0) for n in np.unique(node[stop])}
    neighbours: dict[int, list[int]] = defaultdict(list)
    for first, second in pairs.tolist():
        neighbours[first].append(second)
        neighbours[second].append(first)
    lines: list[Line] = []
    for path in _chains(neighbours, stop):
        ends = [int(node[path[0]]), int(node[path[-1]])]
        if ends[0] == ends[1] and (not stop[path[0]] or len(path) <= 4):
            if stop[path[0]]:
                continue  # a triangle of voxels at a node
            lines.append(Line((ends[0], ends[0]), points[path], radii[path]))
            continue
        place = points[path]
        place[0], place[-1] = middles[ends[0]], middles[ends[1]]
        lines.append(Line((ends[0], ends[1]), place, radii[path]))
    return lines


def _links(voxels: IntArray) -> IntArray:
    """Pairs (E, 2) of neighbouring voxels (N, 3), without those that a shorter way joins."""
    pairs = cKDTree(voxels).query_pairs(1.8, output_type="ndarray").astype(np.int64)
    squared = ((voxels[pairs[:, 0]] - voxels[pairs[:, 1]]) ** 2).sum(axis=1)
    steps: dict[int, dict[int, int]] = defaultdict(dict)
    for (first, second), length in zip(pairs.tolist(), squared.tolist(), strict=True):
        steps[first][second] = steps[second][first] = length
    kept = [
        not any(
            max(steps[first][via], steps[second][via]) < length
            for via in steps[first].keys() & steps[second].keys()
        )
        for (first, second), length in zip(pairs.tolist(), squared.tolist(), strict=True)
    ]
    return pairs[np.array(kept, bool)].reshape(-1, 2)


def _chains(neighbours: dict[int, list[int]], stop: np.ndarray) -> list[list[int]]:
    """Paths of voxels from stop to stop, and rings without any, their first voxel repeated."""
    seen: set[tuple[int, int]] = set()
    chains: list[list[int]] = []
    for start in sorted(neighbours, key=lambda voxel: not stop[voxel]):
        for first in neighbours[start]:
            if (start, first) in seen or (
                not stop[start] and any((start, n) in seen for n in neighbours[start])
            ):
                continue
            path = [start, first]
            while not stop[path[-1]] and path[-1] != start:
                path.append(next(n for n in neighbours[path[-1]] if n != path[-2]))
            seen.update(pairwise(path))
            seen.update(pairwise(path[::-1]))
            chains.append(path)
    return chains


def without_spurs(lines: list[Line]) -> list[Line]:
    """Leave out branches that are bumps of the wall, the shortest first, and join what they parted."""
    lines = _joined(_contracted(lines))
    while spurs := _spurs(lines):
        lines = without_shortest(lines, spurs)
    return lines


def without_shortest(lines: Sequence[Line], some: Sequence[Line]) -> list[Line]:
    """Leave out the shortest of some of the lines, and join what it parted."""
    shortest = min(some, key=lambda line: line.length)
    return _joined([line for line in lines if line is not shortest])


def degrees(lines: Sequence[Line]) -> dict[int, int]:
    """Count the ends of lines at each node."""
    found: dict[int, int] = defaultdict(int)
    for line in lines:
        for node in line.nodes:
            found[node] += 1
    return found


def _spurs(lines: Sequence[Line]) -> list[Line]:
    degree = degrees(lines)
    return [line for line in lines if _is_spur(line, degree)]


def _is_spur(line: Line, degree: dict[int, int]) -> bool:
    if degree[line.nodes[0]] == 1:
        line = line.reversed()
    if degree[line.nodes[1]] != 1 or degree[line.nodes[0]] == 1:
        return False
    wide = line.radii[0]
    gone = np.linalg.norm(line.points - line.points[0], axis=1)
    own = line.radii[gone > wide] if np.any(gone > wide) else line.radii[-1:]
    return line.length + line.radii[-1] < _SPUR_SHARE * wide + float(np.median(own))


def _contracted(lines: list[Line]) -> list[Line]:
    """Make one node of two whose line is shorter than the inscribed radius there: a fork of three."""
    while True:
        degree = degrees(lines)
        short = [
            line
            for line in lines
            if line.nodes[0] != line.nodes[1]
            and min(degree[node] for node in line.nodes) > 2
            and line.length < max(line.radii[0], line.radii[-1])
        ]
        if not short:
            return lines
        line = min(short, key=lambda one: one.length)
        kept, gone = line.nodes
        middle = (line.points[0] + line.points[-1]) / 2
        moved: list[Line] = []
        for other in lines:
            if other is line:
                continue
            points = other.points.copy()
            for end, place in ((0, 0), (1, -1)):
                if other.nodes[end] in line.nodes:
                    points[place] = middle
            first, second = (kept if node == gone else node for node in other.nodes)
            moved.append(Line((first, second), points, other.radii))
        lines = moved


def _joined(lines: list[Line]) -> list[Line]:
    """Make one line of two that meet at a node of nothing else."""
    while True:
        at: dict[int, list[Line]] = defaultdict(list)
        for line in lines:
            for node in line.nodes:
                at[node].append(line)
        pair = next(((n, two) for n, two in at.items() if len(two) == 2 and two[0] is not two[1]), None)
        if pair is None:
            return lines
        node, (first, second) = pair
        first = first if first.nodes[1] == node else first.reversed()
        second = second if second.nodes[0] == node else second.reversed()
        whole = Line(
            (first.nodes[0], second.nodes[1]),
            np.concatenate([first.points, second.points[1:]]),
            np.concatenate([first.radii, second.radii[1:]]),
        )
        lines = [line for line in lines if not any(line is part for part in pair[1])] + [whole]
