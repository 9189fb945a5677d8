"""The first control mesh of a surface: few quads of the right topology, finer where it bends.

Edges of a triangle mesh collapse by quadric error, which keeps its topology; triangles are joined in pairs
where that gives a good quad, and every polygon is then split into quads by its centre. So all is quads
whatever the pairs are, and only what was a corner before the split can have other than four of them.
"""

from __future__ import annotations

import numpy as np

from cccd.geometry._jit import jit
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.decimation import collapse_edges
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import SHARP, ControlMesh, quad_edges
from cccd.surface.flat_caps import even_cap
from cccd.tolerances import TINY

__all__ = ["control_mesh", "join_in_pairs", "split_to_quads"]

#: Weight of even edges beside that of near ones when edges collapse: needles make needles of quads.
EVENNESS = 1e-3
#: A pair is a quad where its triangles' normals agree (1 - cosine), and no corner is straight (cosine).
MOST_BENT, MOST_ALIGNED = 0.6, 0.97
#: Rounds in which triangles without a partner look for one by changing one pair; few are left after these.
PAIRING_ROUNDS = 5


def control_mesh(
    fine: Mesh, most: int, ends: tuple[float, float], weights: FloatArray | None = None
) -> tuple[ControlMesh, Mesh]:
    """Make a control mesh of a closed triangle mesh.

    Parameters
    ----------
    fine : Mesh
        Closed, oriented outwards, in the plane's mm and height in mm.
    most : int
        Triangles that its edges collapse to; about twice as many control points come of them.
    ends : (float, float)
        Heights of its planar caps, which get a crease around them; infinite without one.
    weights : (V,) float64, optional
        Factors of what a collapse costs at the vertices of ``fine``: larger ones keep finer triangles.

    Returns
    -------
    ControlMesh
        Its control points lie on the triangles.
    Mesh
        The triangles that it was made of.
    """
    flat = _on_caps(fine, ends)
    few = collapse_edges(fine, most, EVENNESS, weights, flat.astype(np.int64))
    flat = _on_caps(few, ends)
    if flat.any():
        corners = few.vertices[few.faces[flat]]
        edge = float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))
        for end in ends:
            few = even_cap(few, end, edge)
        flat = _on_caps(few, ends)
    quads, triangles = join_in_pairs(few, flat)
    points, quads, edges = split_to_quads(few.vertices, quads, triangles)
    rim = _rim(few, flat)
    count = len(few.vertices)
    at = np.searchsorted(edges[:, 0] * count + edges[:, 1], rim[:, 0] * count + rim[:, 1])
    creases = np.concatenate([np.column_stack([rim[:, end], count + at]) for end in (0, 1)])
    return ControlMesh(points, quads, creases, np.full(len(creases), SHARP)), few


def _on_caps(mesh: Mesh, ends: tuple[float, float]) -> BoolArray:
    """Which triangles (F,) lie on one of two planes across z."""
    at = np.isin(mesh.vertices[:, 2], [end for end in ends if np.isfinite(end)])
    return np.asarray(np.all(at[mesh.faces], axis=1), np.bool_)


def _rim(mesh: Mesh, flat: BoolArray) -> IntArray:
    """Edges (R, 2), the lower end first, between triangles that lie flat and others."""
    edges, side = quad_edges(mesh.faces)
    beside = np.bincount(side.ravel(), np.repeat(flat, 3), len(edges))
    return edges[beside == 1]


def join_in_pairs(mesh: Mesh, flat: BoolArray | None = None) -> tuple[IntArray, IntArray]:
    """Join triangles in pairs, flat and square ones first.

    Parameters
    ----------
    mesh : Mesh
        Closed.
    flat : (F,) bool, optional
        Triangles that lie on a cap: they are not joined with others.

    Returns
    -------
    quads : (Q, 4) int64
    triangles : (T, 3) int64
        Those without a partner.
    """
    faces, vertices = mesh.faces, mesh.vertices
    _, side = quad_edges(faces)
    order = np.argsort(side.ravel(), kind="stable").reshape(-1, 2)
    owner, corner = np.divmod(order, 3)
    (f, g), (i, j) = owner.T, corner.T
    quads = np.column_stack(
        [faces[f, i], faces[g, (j + 2) % 3], faces[f, (i + 1) % 3], faces[f, (i + 2) % 3]]
    )
    cost = _cost_of_quads(vertices[quads])
    if flat is not None:
        cost[flat[f] != flat[g]] = np.inf
    allowed = np.isfinite(cost)
    best = np.argsort(cost, kind="stable")[: int(allowed.sum())]
    partner = _pairs(best, owner, side.reshape(-1, 3), allowed)
    chosen = np.flatnonzero((partner[f] == g) & allowed)
    # two triangles may share more than one edge: one pair, one quad
    _, once = np.unique(f[chosen] * len(faces) + g[chosen], return_index=True)
    return quads[chosen[once]], faces[partner < 0]


def _cost_of_quads(corners: FloatArray) -> FloatArray:
    """How far (Q,) quads (Q, 4, 3) are from flat rectangles; infinite where they will not do."""
    a, d, b, c = corners.transpose(1, 0, 2)
    sides = np.roll(corners, -1, axis=1) - corners
    sides /= np.maximum(np.linalg.norm(sides, axis=2, keepdims=True), TINY)
    before = np.roll(sides, 1, axis=1)
    aligned = np.abs(np.einsum("qkc,qkc->qk", sides, before)).max(axis=1)
    normals = np.stack([np.cross(b - a, c - a), np.cross(d - a, b - a)])
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), TINY)
    bent = 1 - np.einsum("qc,qc->q", *normals)
    turning = np.einsum("qkc,qc->qk", np.cross(before, sides), normals.sum(axis=0))
    good = (bent < MOST_BENT) & (aligned < MOST_ALIGNED) & np.all(turning > 0, axis=1)
    return np.where(good, aligned + bent, np.inf)


@jit
def _pairs(best: IntArray, owner: IntArray, side: IntArray, allowed: BoolArray) -> IntArray:
    """Partner (F,) of each triangle, or -1: greedily, then by changing one pair to make two."""
    partner = np.full(len(side), -1)
    for edge in best:
        x, y = owner[edge, 0], owner[edge, 1]
        if x != y and partner[x] < 0 and partner[y] < 0:
            partner[x], partner[y] = y, x
    for _ in range(PAIRING_ROUNDS):
        gained = False
        for x in range(len(side)):
            if partner[x] < 0 and _pair_by_changing(x, partner, owner, side, allowed):
                gained = True
        if not gained:
            break
    return partner


@jit
def _pair_by_changing(x: int, partner: IntArray, owner: IntArray, side: IntArray, allowed: BoolArray) -> bool:
    """Give a triangle a neighbour whose partner finds another one."""
    for k in range(3):
        if not allowed[side[x, k]]:
            continue
        y = owner[side[x, k], 0] + owner[side[x, k], 1] - x
        z = partner[y]
        for n in range(3):
            if not allowed[side[z, n]]:
                continue
            w = owner[side[z, n], 0] + owner[side[z, n], 1] - z
            if w not in (x, y, z) and partner[w] < 0:
                partner[x], partner[y], partner[z], partner[w] = y, x, w, z
                return True
    return False


def split_to_quads(
    vertices: FloatArray, quads: IntArray, triangles: IntArray
) -> tuple[FloatArray, IntArray, IntArray]:
    """Split every quad into four and every triangle into three quads, by its centre and its edges' middles.

    Returns
    -------
    points : (P, 3) float64
        The vertices, then the middles of the edges, then the centres.
    quads : (4 Q + 3 T, 4) int64
    edges : (E, 2) int64
        Those that were split, ascending, the lower end first.
    """
    count = len(vertices)
    ends = [
        np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2) for faces in (quads, triangles)
    ]
    ends = np.sort(np.concatenate(ends), axis=1)
    keys, number = np.unique(ends[:, 0] * count + ends[:, 1], return_inverse=True)
    edges = np.column_stack(np.divmod(keys, count))
    finer: list[IntArray] = []
    start, centre = 0, count + len(edges)
    for faces in (quads, triangles):
        size = faces.shape[1]
        middle = count + number[start : start + faces.size].reshape(-1, size)
        own = centre + np.arange(len(faces))
        finer += [np.column_stack([faces[:, k], middle[:, k], own, middle[:, k - 1]]) for k in range(size)]
        start, centre = start + faces.size, centre + len(faces)
    middles = vertices[edges].mean(axis=1)
    centres = [vertices[faces].mean(axis=1) for faces in (quads, triangles) if len(faces)]
    return np.concatenate([vertices, middles, *centres]), np.concatenate(finer), edges
