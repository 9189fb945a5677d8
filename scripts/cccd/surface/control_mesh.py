"""The first control mesh of a surface: few quads of the right topology, finer where it bends.

Edges of a triangle mesh collapse by quadric error, which keeps its topology; triangles are joined in pairs
where that gives a good quad, and every polygon is then split into quads by its centre. So all is quads
whatever the pairs are, and only what was a corner before the split can have other than four of them. Limit
surfaces that fold over themselves unfold: their control points give way.
"""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.decimation import collapse_edges
from cccd.geometry.flat_caps import fill_rim
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import SHARP, ControlMesh, Sampler, quad_edges
from cccd.tolerances import TINY

#: Triangles that a fold turned over have at least this share of the median one's area in the end.
LEAST_AREA = 0.01
#: Moves that unfold it, at most: what folds after these has, as a rule, a rim that crosses itself.
MOVES = 100


def unfold(points: FloatArray, sampler: Sampler, moving: BoolArray, normals: FloatArray) -> FloatArray:
    """Move control points where triangles of the limit surface face away from where they should.

    Areas are those seen along the normals; the squared lack of area of all triangles that have less than some
    is minimized.

    Parameters
    ----------
    points : (P, 3) float64
    sampler : Sampler
        Of the surface.
    moving : (P,) bool
        Points that may move.
    normals : (T, 3) float64
        Where the sampler's triangles should face.

    Returns
    -------
    (P, 3) float64
    """
    moved, count = points.copy(), sampler.matrix.shape[0]
    near = (sampler.matrix @ moving.astype(float) > 0)[sampler.triangles].any(axis=1)
    triangles, facing = sampler.triangles[near], normals[near, None]

    def areas(samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        corners = samples[triangles]
        across = np.cross(np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1), facing)
        return -(corners * across).sum(axis=(1, 2)) / 4, across

    area, _ = areas(sampler.matrix @ points)
    least = LEAST_AREA * float(np.median(area)) if len(area) else 0.0
    if least <= 0 or area.min() >= least:
        return points

    def lack(places: FloatArray) -> tuple[float, FloatArray]:
        moved[moving] = places.reshape(-1, 3)
        area, across = areas(sampler.matrix @ moved)
        missing = np.maximum(1 - area / least, 0.0)
        slope = (missing / least)[:, None, None] * across
        at = triangles.ravel()
        each = [np.bincount(at, slope[..., axis].ravel(), count) for axis in range(3)]
        return float(missing @ missing), (sampler.matrix.T @ np.column_stack(each))[moving].ravel()

    from scipy.optimize import minimize  # a hundred modules, and few surfaces fold

    found = minimize(lack, points[moving].ravel(), jac=True, method="L-BFGS-B", options={"maxiter": MOVES})
    moved[moving] = found.x.reshape(-1, 3)
    return moved


#: mm: points so near to where the scan ends lie there.
SAME_HEIGHT = 1e-6
#: Weight of even edges beside that of near ones when edges collapse: needles make needles of quads.
EVENNESS = 1e-3
#: A pair is a quad where its triangles' normals agree (1 - cosine), and no corner is straight (cosine).
MOST_BENT, MOST_ALIGNED = 0.6, 0.97
#: Rounds in which triangles without a partner look for one by changing one pair; few are left after these.
PAIRING_ROUNDS = 5


def control_mesh(
    fine: Mesh, most: int, ends: tuple[float, float], weights: FloatArray | None = None
) -> tuple[ControlMesh, Mesh]:
    """Make a control mesh of a closed triangle mesh, without its planar caps.

    Parameters
    ----------
    fine : Mesh
        Closed, oriented outwards, in the plane's mm and height in mm.
    most : int
        Triangles that its edges collapse to; about twice as many control points come of them.
    ends : (float, float)
        Heights of its planar caps; infinite without one.
    weights : (V,) float64, optional
        Factors of what a collapse costs at the vertices of ``fine``: larger ones keep finer triangles.

    Returns
    -------
    ControlMesh
        Its control points lie on the triangles. Where the caps were it is open, with creases there.
    Mesh
        The triangles that it was made of, the caps' included.
    """
    few = fewer_triangles(fine, most, ends, weights)
    on_wall = caps_of(few, ends) == 0
    return _split(Mesh(few.vertices, few.faces[on_wall]).compact()), few


def fewer_triangles(
    mesh: Mesh, most: int, ends: tuple[float, float], weights: FloatArray | None = None
) -> Mesh:
    """Collapse edges as `collapse_edges` does; what lies at the heights ``ends`` stays there exactly."""
    few = collapse_edges(mesh, most, EVENNESS, weights, caps_of(mesh, ends))
    vertices = few.vertices.copy()
    for end in ends:
        vertices[np.abs(vertices[:, 2] - end) < SAME_HEIGHT, 2] = end
    return Mesh(vertices, few.faces)


def _split(triangles: Mesh) -> ControlMesh:
    """Join triangles in pairs and split them to quads, with creases along open edges."""
    points, quads, _ = split_to_quads(triangles.vertices, *join_in_pairs(triangles))
    rims = open_edges(quads)
    return ControlMesh(points, quads, rims, np.full(len(rims), SHARP))


def open_edges(faces: IntArray) -> IntArray:
    """Edges (E, 2) of polygons (F, n) that have only one beside them, the lower end first."""
    edges, side = quad_edges(faces)
    return edges[np.bincount(side.ravel(), minlength=len(edges)) == 1]


def with_caps(wall: ControlMesh, ends: tuple[float, float]) -> ControlMesh:
    """Close a wall by planar caps of quads within its rims.

    Parameters
    ----------
    wall : ControlMesh
        Open, with rims at the heights ``ends``, as `control_mesh` and `split_to_quads` make it: every second
        point of a rim is the middle of an edge that was split.
    ends : (float, float)
        Heights in mm; infinite without a cap.
    """
    if not len(wall.creases):
        return wall
    points, quads = [wall.vertices], [wall.quads]
    count = len(wall.vertices)
    for end, upwards in zip(ends, (False, True), strict=True):
        if np.any(wall.vertices[wall.creases[:, 0], 2] == end):
            added, cap = _cap(wall, end, upwards, count)
            points.append(added)
            quads.append(cap)
            count += len(added)
    return ControlMesh(np.concatenate(points), np.concatenate(quads), wall.creases, wall.sharpness)


def _cap(wall: ControlMesh, end: float, upwards: bool, count: int) -> tuple[FloatArray, IntArray]:
    """Points to be added to ``count`` others, and quads, of the cap at one height."""
    own = len(wall.vertices)
    # the cap runs along the rim against the wall's quads; of a rim's edge the lower end is a corner
    sides = np.stack([wall.quads, np.roll(wall.quads, -1, axis=1)], axis=2).reshape(-1, 2)
    on_rim = np.isin(np.sort(sides, axis=1) @ [own, 1], wall.creases @ [own, 1])
    on_rim &= wall.vertices[sides[:, 0], 2] == end
    # each middle has one side before and one behind it; where a rim touches itself, a corner has more
    ends_at, starts_at = np.full((2, own), -1)
    ends_at[sides[on_rim, 1]], starts_at[sides[on_rim, 0]] = sides[on_rim, 0], sides[on_rim, 1]
    middles = np.unique(wall.creases[wall.vertices[wall.creases[:, 0], 2] == end, 1])
    # against the wall's quads: from the corner behind a middle to the one before it
    corners, rim = np.unique(np.column_stack([starts_at[middles], ends_at[middles]]), return_inverse=True)
    rim = rim.reshape(-1, 2)
    plane = wall.vertices[corners, :2]
    flat = Mesh(wall.vertices[corners], fill_rim(plane if upwards else plane * [1, -1], rim))
    points, quads, edges = split_to_quads(flat.vertices, *join_in_pairs(flat))
    number = np.full(len(points), -1)
    number[: len(corners)] = corners
    keys = np.sort(rim, axis=1) @ [len(corners), 1]
    order = np.argsort(keys)
    at = order[np.minimum(np.searchsorted(keys, edges @ [len(corners), 1], sorter=order), len(keys) - 1)]
    known = keys[at] == edges @ [len(corners), 1]
    number[len(corners) + np.flatnonzero(known)] = middles[at[known]]
    new = number < 0
    points[~new] = wall.vertices[number[~new]]
    rims = open_edges(quads)
    # where the curve of a rim bulges beyond its corners the surface within would fold over it
    sampler = ControlMesh(points, quads, rims, np.full(len(rims), SHARP)).sampler()
    facing = np.tile([0.0, 0.0, 1.0 if upwards else -1.0], (len(sampler.triangles), 1))
    points = unfold(points, sampler, new, facing)
    number[new] = count + np.arange(int(new.sum()))
    return points[new], number[quads]


def caps_of(mesh: Mesh, ends: tuple[float, float]) -> IntArray:
    """On which of two planes across z, 1 or 2, each triangle (F,) lies; 0 on none."""
    height = mesh.vertices[mesh.faces, 2]
    lower, upper = (np.all(height == end, axis=1) for end in ends)
    return np.asarray(lower + 2 * upper, np.int64)


def join_in_pairs(mesh: Mesh) -> tuple[IntArray, IntArray]:
    """Join triangles in pairs, flat and square ones first.

    Parameters
    ----------
    mesh : Mesh
        Oriented; closed, or open.

    Returns
    -------
    quads : (Q, 4) int64
    triangles : (T, 3) int64
        Those without a partner.
    """
    faces, vertices = mesh.faces, mesh.vertices
    edges, side = quad_edges(faces)
    order = np.argsort(side.ravel(), kind="stable")
    beside = np.bincount(side.ravel(), minlength=len(edges))
    inner = np.flatnonzero(beside == 2)
    first = np.cumsum(beside)[inner] - 2
    (f, g), (i, j) = np.divmod(np.stack([order[first], order[first + 1]]), 3)
    quads = np.column_stack(
        [faces[f, i], faces[g, (j + 2) % 3], faces[f, (i + 1) % 3], faces[f, (i + 2) % 3]]
    )
    cost = _cost_of_quads(vertices[quads])
    good = np.flatnonzero(np.isfinite(cost))
    beside = np.full((len(faces), 3), -1)
    beside[f[good], i[good]], beside[g[good], j[good]] = g[good], f[good]
    best = good[np.argsort(cost[good], kind="stable")]
    partner = _pair(np.column_stack([f, g])[best], beside)
    chosen = good[partner[f[good]] == g[good]]
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


def _pair(pairs: IntArray, beside: IntArray) -> IntArray:
    """Partner (F,) of each triangle, or -1: greedily, then by changing one pair to make two.

    ``pairs`` (K, 2) may be joined, the best first; ``beside`` (F, 3) are the triangles across a triangle's
    edges that it may be joined with, or -1.
    """
    partner, around = [-1] * len(beside), beside.tolist()
    for x, y in pairs.tolist():  # of a coarse mesh: an array's rounds take longer
        if x != y and partner[x] < 0 and partner[y] < 0:
            partner[x], partner[y] = y, x
    for _ in range(PAIRING_ROUNDS):
        alone = [x for x, other in enumerate(partner) if other < 0]
        if not sum([_pair_by_changing(x, partner, around) for x in alone]):
            break
    return np.array(partner, np.int64)


def _pair_by_changing(x: int, partner: list[int], beside: list[list[int]]) -> bool:
    """Give a triangle that is alone a neighbour whose partner finds another one."""
    if partner[x] >= 0:
        return False
    for y in beside[x]:
        z = partner[y] if y >= 0 else -1
        for w in beside[z] if z >= 0 else []:
            if w >= 0 and w not in (x, y, z) and partner[w] < 0:
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
