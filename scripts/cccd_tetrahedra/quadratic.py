"""Quadratic tetrahedra: nodes in the middle of edges, on the surface where an edge is of the boundary."""

from __future__ import annotations

from collections.abc import Iterable
from math import factorial
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.distance import nearest_points
from cccd.geometry.mesh import Mesh
from cccd.tolerances import TINY
from cccd_tetrahedra.chords import unspoiled
from cccd_tetrahedra.shapes import signed_volumes

#: Edges of a tetrahedron in the order of their middle nodes in VTK, Abaqus, CalculiX and FEBio.
EDGES = np.array([(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)])

#: Of the faces of `cccd_tetrahedra.shapes.FACES`, the edges from each corner to the next.
FACE_EDGES = np.array([(2, 1, 0), (0, 4, 3), (1, 5, 4), (3, 5, 2)])

#: Faces that meet at more than this angle have a ridge between them: caps meet walls at more.
SHARP_DEG = 40.0

#: A middle node moves by at most this share of its edge: what is further away is another part of the surface.
MOST_MOVED = 0.25

#: The Jacobian is nowhere less than this share of the straight tetrahedron's; else its edges stay straight.
LEAST_JACOBIAN = 0.1

#: Segments of ridges that are tried for each point.
_TRIED = 8


class Curved(NamedTuple):
    """Nodes of quadratic tetrahedra.

    Attributes
    ----------
    vertices : (V, 3) float64
        Corners first, then the nodes in the middle of edges.
    middles : (N, 6) int64
        Of each tetrahedron's `EDGES`.
    boundary : int
        How many edges are of the boundary.
    straight : int
        How many of those stay straight, because a tetrahedron would fold or the surface is too far away.
    """

    vertices: FloatArray
    middles: IntArray
    boundary: int
    straight: int


def curve_edges(
    vertices: FloatArray, tetrahedra: IntArray, triangles: IntArray, surfaces: Iterable[Mesh]
) -> Curved:
    """Put corners and middle nodes of the boundary onto the surfaces; the Jacobian stays positive everywhere.

    Parameters
    ----------
    vertices : (V, 3) float64
        Near the surfaces where they are of the boundary.
    tetrahedra : (N, 4) int64
        Of positive volume.
    triangles : (T, 3) int64
        All faces that bound an organ.
    surfaces : iterable of Mesh
        Closed.

    Returns
    -------
    Curved

    Examples
    --------
    >>> import trimesh
    >>> ball = trimesh.creation.icosphere(4, 1.0)
    >>> corners = np.array([(1.0, 1, 1), (-1, 1, -1), (-1, -1, 1), (1, -1, -1)]) / 3**0.5
    >>> faces = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)])
    >>> surface = Mesh(np.array(ball.vertices), np.array(ball.faces, np.int64))
    >>> curved = curve_edges(corners, np.array([(0, 1, 2, 3)]), faces, [surface])
    >>> curved.boundary, curved.straight, len(curved.vertices)  # so large that the ball is too far away
    (6, 6, 10)
    """
    surface = Mesh.joined(list(surfaces))
    ridges = _ridges_of(surface)
    sides = np.unique(np.sort(_pairs(triangles), axis=1), axis=0)
    sharp = _sharp_edges(vertices, triangles, sides)
    edges, places = np.unique(
        np.sort(tetrahedra[:, EDGES].reshape(-1, 2), axis=1), axis=0, return_inverse=True
    )
    middles = places.reshape(-1, len(EDGES))
    keys = edges @ (len(vertices), 1)
    at = np.searchsorted(keys, sides @ (len(vertices), 1))
    lengths = np.linalg.norm(np.diff(vertices[sides], axis=1)[:, 0], axis=1)

    corners = np.unique(sides)
    reach = np.full(len(vertices), np.inf)
    np.minimum.at(reach, sides, np.repeat(MOST_MOVED * lengths[:, None], 2, axis=1))
    on_ridge = np.isin(corners, sides[sharp])
    moved = vertices.copy()
    moved[corners], _ = _onto(vertices[corners], surface, ridges, on_ridge, reach[corners])
    corner_points = unspoiled(vertices, moved, tetrahedra)

    straight = corner_points[edges].mean(axis=1)
    points = straight.copy()
    points[at], found = _onto(straight[at], surface, ridges, sharp, MOST_MOVED * lengths)
    bent = np.zeros(len(edges), bool)
    bent[at[found]] = True
    kept = _bent_where_sound(corner_points, tetrahedra, middles, points, straight, bent)
    points[~kept] = straight[~kept]
    return Curved(
        np.concatenate([corner_points, points]),
        middles + len(vertices),
        len(sides),
        len(sides) - int(kept.sum()),
    )


def _bent_where_sound(
    corners: FloatArray,
    tetrahedra: IntArray,
    middles: IntArray,
    points: FloatArray,
    straight: FloatArray,
    bent: BoolArray,
) -> BoolArray:
    """Choose those of bent edges (E,) that may be so: no tetrahedron folds with the others straight."""
    kept = bent.copy()
    tried = np.flatnonzero(kept[middles].any(axis=1))
    while len(tried):
        places = np.where(kept[:, None], points, straight)
        nodes = np.concatenate([corners[tetrahedra[tried]], places[middles[tried]]], axis=1)
        folded = np.unique(middles[tried[jacobian_bounds(nodes)[:, 0] < LEAST_JACOBIAN]])
        folded = folded[kept[folded]]
        kept[folded] = False
        tried = tried[np.isin(middles[tried], folded).any(axis=1)]
    return kept


def _onto(
    points: FloatArray, surface: Mesh, ridges: FloatArray, on_ridge: BoolArray, reach: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Move points (P, 3) to the surface, or to its ridges (R, 2, 3), where within reach; which are."""
    moved = nearest_points(points, surface)
    if len(ridges) and on_ridge.any():
        along = _nearest_on_segments(points[on_ridge], ridges)
        near = np.linalg.norm(along - points[on_ridge], axis=1) < reach[on_ridge]
        moved[np.flatnonzero(on_ridge)[near]] = along[near]
    found = np.linalg.norm(moved - points, axis=1) <= reach
    return np.where(found[:, None], moved, points), found


def _nearest_on_segments(points: FloatArray, segments: FloatArray) -> FloatArray:
    """Nearest points (P, 3) on segments (S, 2, 3), of those whose middles are near."""
    count = min(_TRIED, len(segments))
    tried = cKDTree(segments.mean(axis=1)).query(points, k=range(1, count + 1))[1]
    start, along = segments[tried, 0], segments[tried, 1] - segments[tried, 0]
    share = np.einsum("pkc,pkc->pk", points[:, None] - start, along) / np.einsum("pkc,pkc->pk", along, along)
    found = start + np.clip(share, 0, 1)[..., None] * along
    best = np.linalg.norm(found - points[:, None], axis=2).argmin(axis=1)
    return found[np.arange(len(points)), best]


def _ridges_of(surface: Mesh) -> FloatArray:
    """Edges (R, 2, 3) along which a surface is sharp."""
    bends = surface.dihedrals
    return surface.vertices[bends.edges[np.degrees(bends.angles) > SHARP_DEG]]


def _pairs(triangles: IntArray) -> IntArray:
    return triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)


def _sharp_edges(vertices: FloatArray, triangles: IntArray, sides: IntArray) -> BoolArray:
    """Whether edges (E, 2), sorted, have faces in planes that differ by more than the angle of a ridge."""
    normals = Mesh(vertices, triangles).unit_normals
    keys = np.sort(_pairs(triangles), axis=1) @ (len(vertices), 1)
    edge = np.searchsorted(sides @ (len(vertices), 1), keys)
    order = np.argsort(edge, kind="stable")
    face = order // 3
    sharp = np.zeros(len(sides), bool)
    most = int(np.bincount(edge).max())
    for apart in range(1, most):  # two faces mostly, three and four where organs meet
        first, second = order[:-apart], order[apart:]
        same = edge[first] == edge[second]
        cosine = np.abs(np.einsum("ec,ec->e", normals[face[:-apart]], normals[face[apart:]]))
        sharp[edge[first[same & (cosine < np.cos(np.radians(SHARP_DEG)))]]] = True
    return sharp


def _powers() -> IntArray:
    """Exponents (20, 4) of the barycentric coordinates in cubic polynomials."""
    return np.array([p for p in np.ndindex(4, 4, 4, 4) if sum(p) == 3])


def _bernstein_from_values() -> FloatArray:
    """Matrix (20, 20) from values at the points of thirds to Bernstein's coefficients."""
    powers = _powers()
    many = 6 / np.array([np.prod([factorial(n) for n in p]) for p in powers.tolist()])
    return np.linalg.inv(many * np.prod((powers[:, None, :] / 3) ** powers, axis=2))


def _shape_gradients() -> FloatArray:
    """Gradients (20, 10, 3) of the shape functions at those points, by the last three coordinates."""
    by_barycentric = np.array([(-1.0, -1, -1), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    at = _powers() / 3
    corners = (4 * at - 1)[:, :, None] * by_barycentric
    first, second = EDGES.T
    sides = 4 * (at[:, second, None] * by_barycentric[first] + at[:, first, None] * by_barycentric[second])
    return np.concatenate([corners, sides], axis=1)


_COEFFICIENTS, _GRADIENTS = _bernstein_from_values(), _shape_gradients()


def _determinants(nodes: FloatArray) -> FloatArray:
    """Bernstein's coefficients (N, 20) of the Jacobian's determinant of tetrahedra (N, 10, 3)."""
    jacobians = np.einsum("pna,knc->kpac", _GRADIENTS, nodes, optimize=True)
    return np.linalg.det(jacobians) @ _COEFFICIENTS.T


def jacobian_bounds(nodes: FloatArray) -> FloatArray:
    """Bounds (N, 2) of the Jacobian of quadratic tetrahedra (N, 10, 3), by that of the straight ones.

    The determinant is a cubic polynomial: it lies between its least and its largest Bernstein coefficient,
    so that a tetrahedron whose lower bound is positive is nowhere folded.

    Examples
    --------
    >>> corners = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    >>> nodes = np.concatenate([corners, corners[EDGES].mean(axis=1)])[None]
    >>> jacobian_bounds(nodes).round(9).tolist()
    [[1.0, 1.0]]
    >>> nodes[0, 4] = (0.1, 0, 0)  # nearer to a corner than a quarter of the edge
    >>> bool(jacobian_bounds(nodes)[0, 0] < 0)
    True
    """
    straight = 6 * np.abs(signed_volumes(nodes[:, :4]))
    found = _determinants(nodes)
    ends = np.column_stack([found.min(axis=1), found.max(axis=1)])
    return ends / np.maximum(straight, TINY)[:, None]


def quadratic_volumes(nodes: FloatArray) -> FloatArray:
    """Volume (N,) of quadratic tetrahedra (N, 10, 3), exactly: the mean of Bernstein's coefficients."""
    return _determinants(nodes).mean(axis=1) / 6
