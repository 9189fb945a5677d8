"""Gathan: T. K. Dey, R. Wenger, Reconstructing curves with sharp corners, Comput. Geom. 19 (2001) 89-99."""

from __future__ import annotations

import numpy as np

from cccd_paper.comparisons.links import unique_links
from cccd_paper.comparisons.reconstruction.delaunay import first_of_each, triangulate

#: An edge's Voronoi dual may lean this much against the normals at its ends.
ANGLE_DEGREES = 35.0
#: The Voronoi dual is at least this many times as long as the edge.
RATIO = 1.7


def gathan(points: np.ndarray) -> np.ndarray:
    """Keep Delaunay edges whose long Voronoi dual runs along the normals, one on each side of a point.

    The normal at a point leads to its pole, the farthest vertex of its Voronoi cell (for a point of the
    hull, out of the hull). An edge stays when the angle and the ratio condition hold, and when it is the
    shortest such edge on its side of the normal at both of its ends.

    Notes
    -----
    The heuristic's full text was not at hand; the conditions and their numbers are as summarised in the
    literature. The score is that of this reading.
    """
    mesh = triangulate(points)
    if not len(mesh.triangles):
        return mesh.edges
    centre, radius = _circumcircles(points[mesh.triangles])
    hull = mesh.edge_triangles[:, 1] < 0
    one, other = centre[mesh.edge_triangles[:, 0]], centre[mesh.edge_triangles[:, 1]]
    dual = np.where(hull, np.inf, np.linalg.norm(one - other, axis=1))

    normal = _normals(mesh, centre, radius)
    direction = (points[mesh.edges[:, 1]] - points[mesh.edges[:, 0]]) / mesh.length[:, None]
    lean = np.abs((normal[mesh.edges] * direction[:, None]).sum(2)).max(1)  # sine of the angle
    fit = (lean <= np.sin(np.radians(ANGLE_DEGREES))) & (dual >= RATIO * mesh.length)

    start, end, edge, _ = mesh.directed()
    start, end, edge = start[fit[edge]], end[fit[edge]], edge[fit[edge]]
    towards = points[end] - points[start]
    side = normal[start, 0] * towards[:, 1] - normal[start, 1] * towards[:, 0] > 0
    group = 2 * start + side
    order = np.argsort(group, kind="stable")  # shortest first within each side
    best, votes = np.unique(edge[order[first_of_each(group[order])]], return_counts=True)
    return unique_links(mesh.edges[best[votes == 2]])


def _circumcircles(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Circumcentres (T, 2) and radii (T,) of triangles (T, 3, 2)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    twice = 2 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    aa, bb = (a**2).sum(1), (b**2).sum(1)
    offset = np.column_stack([b[:, 1] * aa - a[:, 1] * bb, a[:, 0] * bb - b[:, 0] * aa]) / twice[:, None]
    return corners[:, 0] + offset, np.linalg.norm(offset, axis=1)


def _normals(mesh, centre: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Point from each point to its pole, and out of the hull at the hull's points: unit vectors (N, 2)."""
    point, triangle = mesh.triangles.ravel(), np.repeat(np.arange(len(mesh.triangles)), 3)
    order = np.lexsort((-radius[triangle], point))
    point, triangle = point[order], triangle[order]
    first = first_of_each(point)
    normal = np.zeros_like(mesh.points)
    normal[point[first]] = centre[triangle[first]] - mesh.points[point[first]]

    outer = mesh.edge_triangles[:, 1] < 0
    ends = mesh.edges[outer]
    along = (mesh.points[ends[:, 1]] - mesh.points[ends[:, 0]]) / mesh.length[outer, None]
    across = np.column_stack([along[:, 1], -along[:, 0]])
    inwards = mesh.points[mesh.triangles[mesh.edge_triangles[outer, 0]]].mean(1) - mesh.points[ends[:, 0]]
    across *= -np.sign((across * inwards).sum(1))[:, None]
    normal[ends.ravel()] = 0
    np.add.at(normal, ends, across[:, None])
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.divide(normal, size, out=np.zeros_like(normal), where=size > 0)
