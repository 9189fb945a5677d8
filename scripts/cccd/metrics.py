"""How well a result agrees with the truth: in the plane (equations 12-21), and on surfaces.

The paper prints its rates as shares of *all* pixels and calls TP / (TP + FN) precision, which everyone
else calls recall. `Confusion.printed` gives the equations as printed, `Confusion.standard` the usual
definitions of what goes by the same or a neighbouring name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from cccd.containers import Curves, Frame, concatenate_ragged
from cccd.tolerances import ROUNDING

__all__ = [
    "Confusion",
    "bending_per_area",
    "confusion",
    "count_self_intersections",
    "curvature_per_area",
    "dice",
    "dihedrals",
    "is_closed_manifold",
    "jaccard",
    "mesh_area",
    "mesh_volume",
    "rasterise",
    "rasterise_slice",
    "sample_mesh",
    "self_intersections",
    "surface_distances",
    "voxelise",
]

Counts = np.ndarray | int
Rates = np.ndarray | float


def _ratio(part: Counts, whole: Counts, empty: float = np.nan) -> Rates:
    """``part / whole``, and ``empty`` where the whole is nothing."""
    part, whole = np.asarray(part, float), np.asarray(whole, float)
    return np.divide(part, whole, out=np.full(np.shape(whole), empty), where=whole > 0)[()]


@dataclass(frozen=True)
class Confusion:
    """Pixel counts of a prediction against the truth, for one region or an array of them.

    Attributes
    ----------
    tp, fp, tn, fn : int or array of int
        True positives, false positives, true negatives, false negatives (section 4.4).

    Examples
    --------
    >>> counts = Confusion(tp=40, fp=10, tn=40, fn=10)
    >>> float(counts.printed["DSC"]), float(counts.printed["TP rate"])
    (0.8, 0.4)
    """

    tp: Counts
    fp: Counts
    tn: Counts
    fn: Counts

    @property
    def printed(self) -> dict[str, Rates]:
        """Equations 12-21 as the paper prints them, under the abbreviations of its Figure 11."""
        tp, fp, tn, fn = self.tp, self.fp, self.tn, self.fn
        everything = tp + fp + tn + fn
        return {
            "TP rate": _ratio(tp, everything),  # eq. (12)
            "FP rate": _ratio(fp, everything),  # eq. (13)
            "TN rate": _ratio(tn, everything),  # eq. (14)
            "FN rate": _ratio(fn, everything),  # eq. (15)
            "ACC": _ratio(tp + tn, everything),  # eq. (16)
            "MC": _ratio(fp + fn, everything),  # eq. (17)
            "PRE": _ratio(tp, tp + fn),  # eq. (18): the usual recall
            "SPEC": _ratio(tn, tn + fp),  # eq. (19)
            "DSC": _ratio(2 * tp, 2 * tp + fp + fn, empty=1.0),  # eq. (20)
            "JI": _ratio(tp, tp + fp + fn, empty=1.0),  # eq. (21)
        }

    @property
    def standard(self) -> dict[str, Rates]:
        """The usual definitions where the printed ones differ from them."""
        return {
            "precision": _ratio(self.tp, self.tp + self.fp),
            "recall": _ratio(self.tp, self.tp + self.fn),
            "false positive rate": _ratio(self.fp, self.fp + self.tn),
            "false negative rate": _ratio(self.fn, self.fn + self.tp),
        }


def confusion(
    truth: np.ndarray, predicted: np.ndarray, axis: int | tuple[int, ...] | None = None
) -> Confusion:
    """Count agreeing and disagreeing pixels.

    Parameters
    ----------
    truth, predicted : bool arrays of one shape
        Foreground of the ground truth and of the prediction.
    axis : int or tuple of int, optional
        Axes to count over; all by default. ``(1, 2)`` counts each slice of a stack (S, I, J).

    Raises
    ------
    ValueError
        When the shapes differ.
    """
    truth, predicted = np.asarray(truth, bool), np.asarray(predicted, bool)
    if truth.shape != predicted.shape:
        raise ValueError(f"truth {truth.shape} and prediction {predicted.shape} differ in shape")
    tp = np.count_nonzero(truth & predicted, axis=axis)
    positives = np.count_nonzero(truth, axis=axis)
    claimed = np.count_nonzero(predicted, axis=axis)
    pixels = truth.size if axis is None else truth.size // max(np.size(positives), 1)
    return Confusion(tp=tp, fp=claimed - tp, tn=pixels - positives - claimed + tp, fn=positives - tp)


def dice(truth: np.ndarray, predicted: np.ndarray, axis: int | tuple[int, ...] | None = None) -> Rates:
    """Dice score, eq. (20); two empty regions agree (1)."""
    return confusion(truth, predicted, axis).printed["DSC"]


def jaccard(truth: np.ndarray, predicted: np.ndarray, axis: int | tuple[int, ...] | None = None) -> Rates:
    """Jaccard index, eq. (21); two empty regions agree (1)."""
    return confusion(truth, predicted, axis).printed["JI"]


# Polygons to pixels -----------------------------------------------------------------------------------


def rasterise(curves: Curves, origin: Sequence[int] | np.ndarray, shape: tuple[int, int, int]) -> np.ndarray:
    """Pixels whose centres lie in or on the curves of their slice (even-odd rule, so holes are holes).

    Parameters
    ----------
    curves : Curves
        Closed polygons; parts outside the stack are cut off.
    origin : (3,) int
        Source index ``(k, i, j)`` of the stack's first pixel (`Structure.stack_origin`).
    shape : (S, I, J)
        Shape of the stack.

    Returns
    -------
    (S, I, J) bool array

    Notes
    -----
    A centre on a polygon counts as inside, so the pixel-centre polygons of a mask's borders (outer
    borders and holes, `cccd.chaincode.trace_mask`) give back the mask itself.
    """
    k, i, j = (int(index) for index in origin)
    return _fill(curves.points - (i, j), curves.offsets, np.asarray(curves.slice, np.int64) - k, shape)


def rasterise_slice(
    polygons: Sequence[np.ndarray], origin: Sequence[int] | np.ndarray, shape: tuple[int, int]
) -> np.ndarray:
    """`rasterise` for the polygons (n, 2) of one slice; ``origin`` is (i, j), the result (I, J) bool."""
    points, offsets = concatenate_ragged(polygons)
    stack = _fill(points - np.asarray(origin, float), offsets, np.zeros(len(polygons), np.int64), (1, *shape))
    return stack[0]


def _fill(
    points: np.ndarray, offsets: np.ndarray, layer: np.ndarray, shape: tuple[int, int, int]
) -> np.ndarray:
    """Scan-line even-odd fill of ragged polygons (P, 2), each into its own ``layer`` of a stack.

    Every edge toggles the parity of the pixels to its right on each row ``i`` that it crosses; a row
    counts for an edge from its lower end up to, but without, its upper end, so that a shared vertex is
    counted once. What lies exactly on an edge is added afterwards.
    """
    layers, rows, columns = shape
    parity = np.zeros(shape, np.uint8)
    sizes = np.diff(offsets)
    if len(points) == 0 or parity.size == 0:
        return parity.astype(bool)
    start = points
    end = np.roll(points, -1, axis=0)
    filled = sizes > 0
    end[offsets[1:][filled] - 1] = points[offsets[:-1][filled]]
    layer = np.repeat(layer, sizes)
    here = (layer >= 0) & (layer < layers)
    start, end, layer = start[here], end[here], layer[here]

    upward = start[:, 0] <= end[:, 0]
    low = np.where(upward[:, None], start, end)
    high = np.where(upward[:, None], end, start)
    edge, row = _integers_between(low[:, 0], high[:, 0], rows)
    rise = (high - low)[edge]
    level = rise[:, 0] == 0  # the row runs along the edge
    share = np.divide(row - low[edge, 0], rise[:, 0], out=np.zeros(len(row)), where=~level)
    column = low[edge, 1] + share * rise[:, 1]
    nearest = np.rint(column)
    exact = np.abs(column - nearest) <= ROUNDING * np.maximum(1.0, np.abs(column))
    column = np.where(exact, nearest, column)

    crossing = ~level & (row < high[edge, 0])
    entry = np.maximum(np.ceil(column), 0).astype(np.int64)
    flat = (layer[edge] * rows + row) * columns
    kept = crossing & (entry < columns)
    np.add.at(parity.reshape(-1), (flat + entry)[kept], np.uint8(1))
    # Unsigned bytes wrap at 256, which is even: the parity survives any number of crossings.
    inside = (np.add.accumulate(parity, axis=2, dtype=np.uint8) & 1).astype(bool)

    touched = ~level & exact & (column >= 0) & (column < columns)
    inside.reshape(-1)[(flat + entry)[touched]] = True
    along = edge[level]
    left = np.minimum(low[along, 1], high[along, 1])
    right = np.maximum(low[along, 1], high[along, 1])
    which, column = _integers_between(left, right, columns)
    inside.reshape(-1)[flat[level][which] + column] = True
    return inside


def _integers_between(low: np.ndarray, high: np.ndarray, stop: int) -> tuple[np.ndarray, np.ndarray]:
    """Every integer of ``[low[n], high[n]]`` within ``[0, stop)``, with the n it belongs to."""
    first = np.maximum(np.ceil(low), 0).astype(np.int64)
    last = np.minimum(np.floor(high), stop - 1).astype(np.int64)
    count = np.maximum(last - first + 1, 0)
    owner = np.repeat(np.arange(len(count)), count)
    begin = np.cumsum(count) - count
    return owner, first[owner] + np.arange(len(owner)) - begin[owner]


# Surfaces -----------------------------------------------------------------------------------------------


def mesh_volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Volume in mm^3 inside a closed mesh (V, 3), (F, 3) by the divergence theorem; outwards is positive."""
    a, b, c = (vertices[faces[:, corner]] - vertices.mean(axis=0) for corner in range(3))
    return float(np.einsum("fc,fc->", a, np.cross(b, c))) / 6


def mesh_area(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Area in mm^2 of a mesh (V, 3), (F, 3)."""
    return float(_face_areas(vertices, faces).sum())


def _face_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def is_closed_manifold(faces: np.ndarray) -> bool:
    """Tell whether every edge belongs to two faces that run along it in opposite directions.

    That is: closed, without edges of three faces, and consistently oriented. A vertex where two sheets
    touch is not found by looking at edges, so the faces around each vertex must also form one fan.
    """
    faces = np.asarray(faces, np.int64)
    if len(faces) == 0 or np.any(faces == np.roll(faces, 1, axis=1)):
        return False
    count = int(faces.max()) + 1
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    forward, backward = start * count + end, end * count + start
    order = np.argsort(forward)
    forward = forward[order]
    if np.any(forward[1:] == forward[:-1]) or not np.array_equal(forward, np.sort(backward)):
        return False
    return _fans(faces) == len(np.unique(faces))


def _fans(faces: np.ndarray) -> int:
    """Count fans: corners joined with the neighbouring corner across an edge at the same vertex."""
    count = int(faces.max()) + 1
    corner = np.arange(faces.size)
    following = corner // 3 * 3 + (corner + 1) % 3
    preceding = corner // 3 * 3 + (corner + 2) % 3
    vertex = faces.ravel()
    leaving = vertex * count + vertex[following]
    arriving = vertex * count + vertex[preceding]
    order = np.argsort(leaving)
    partner = order[np.searchsorted(leaving[order], arriving)]
    links = coo_array((np.ones(faces.size, bool), (corner, partner)), shape=(faces.size, faces.size))
    return int(connected_components(links, directed=False)[0])


def bending_per_area(vertices: np.ndarray, faces: np.ndarray) -> float:
    r"""Bending energy of a surface per area, in 1/mm^2.

    The integral of :math:`k_1^2 + k_2^2 = (k_1 + k_2)^2 - 2 k_1 k_2` over the surface, divided by its
    area. The first term is the discrete-shell energy :math:`\sum 3 \theta^2 l^2 / A` of Grinspun et al.
    (2003): each edge of length l bends by its dihedral angle :math:`\theta` between two faces of
    together area A. The second is :math:`4 \pi \chi` by Gauss and Bonnet, with the Euler characteristic
    of the mesh. Slivers count as if they were as wide as a tenth of their edge.
    """
    edge, theta, length, area = dihedrals(vertices, faces)
    if len(edge) == 0:
        return 0.0
    area = np.maximum(area, 0.1 * length**2)
    shell = np.divide(3 * theta**2 * length**2, area, out=np.zeros_like(area), where=area > 0).sum()
    euler = len(np.unique(faces)) - len(edge) + len(faces)
    return float(max(shell - 4 * np.pi * euler, 0.0) / mesh_area(vertices, faces))


def curvature_per_area(vertices: np.ndarray, faces: np.ndarray) -> float:
    r"""Mean absolute curvature in 1/mm: the sum of :math:`|\theta| l` over all edges, by the area.

    The dihedral angles of a mesh measure its total curvature without dividing by small faces, so this
    figure is the one to compare between meshes of different make.
    """
    _, theta, length, _ = dihedrals(vertices, faces)
    return float(np.sum(np.abs(theta) * length) / mesh_area(vertices, faces))


def dihedrals(
    vertices: np.ndarray, faces: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Inner edges (E, 2), the angles (E,) between their faces' normals, lengths, and the faces' areas."""
    normal = np.cross(
        vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]
    )
    size = np.linalg.norm(normal, axis=1)
    unit = np.divide(normal, size[:, None], out=np.zeros_like(normal), where=size[:, None] > 0)
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    key = edges[:, 0] * (int(faces.max()) + 1) + edges[:, 1]
    order = np.argsort(key, kind="stable")
    pair = np.flatnonzero(key[order][1:] == key[order][:-1])
    first, second = order[pair] // 3, order[pair + 1] // 3
    edge = edges[order[pair]]
    cosine = np.einsum("ec,ec->e", unit[first], unit[second])
    sine = np.linalg.norm(np.cross(unit[first], unit[second]), axis=1)
    theta = np.where((size[first] > 0) & (size[second] > 0), np.arctan2(sine, cosine), 0.0)
    length = np.linalg.norm(vertices[edge[:, 1]] - vertices[edge[:, 0]], axis=1)
    return edge, theta, length, (size[first] + size[second]) / 2


def sample_mesh(vertices: np.ndarray, faces: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points (count, 3) drawn uniformly by area."""
    areas = _face_areas(vertices, faces)
    chosen = rng.choice(len(faces), size=count, p=areas / areas.sum())
    r, s = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.column_stack([1 - r, r * (1 - s), r * s])
    return np.einsum("pc,pcx->px", weights, vertices[faces[chosen]])


def surface_distances(
    first: tuple[np.ndarray, np.ndarray],
    second: tuple[np.ndarray, np.ndarray],
    rng: np.random.Generator,
    count: int = 50_000,
) -> dict[str, float]:
    """Distances in mm between two meshes, both ways, from area-uniform points to the other's triangles.

    Returns
    -------
    dict
        ``assd`` (average symmetric surface distance), ``hd95`` (the larger of the two 95th
        percentiles) and ``hausdorff`` (the largest distance met).
    """
    there = _distance_to(sample_mesh(*first, count, rng), *second)
    back = _distance_to(sample_mesh(*second, count, rng), *first)
    return {
        "assd": float(there.sum() + back.sum()) / (2 * count),
        "hd95": float(max(np.percentile(there, 95), np.percentile(back, 95))),
        "hausdorff": float(max(there.max(), back.max())),
    }


def _distance_to(points: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Distance (P,) of points to the nearest point on a mesh."""
    import pyvista  # VTK takes a second to load, and only distances need it

    mesh = pyvista.PolyData.from_regular_faces(np.asarray(vertices, float), faces)
    _, nearest = mesh.find_closest_cell(points, return_closest_point=True)
    return np.linalg.norm(points - nearest, axis=1)


def voxelise(
    vertices: np.ndarray, faces: np.ndarray, frame: Frame, origin: np.ndarray, shape: tuple[int, int, int]
) -> np.ndarray:
    """Voxels whose centres a closed mesh that is oriented outwards winds around.

    Parameters
    ----------
    vertices, faces : (V, 3) float64 in mm RAS, (F, 3) int
        A closed mesh.
    frame : Frame
        The source volume's grid.
    origin, shape : (3,)
        The block of source voxels to fill, in the source volume's axis order.

    Returns
    -------
    (a, b, c) bool array
    """
    index = (vertices - frame.affine[:3, 3]) @ np.linalg.inv(frame.affine[:3, :3]).T - np.asarray(origin)
    # Vertices on a voxel line would be counted once, twice or not at all, and rounding would decide for faces
    # through voxel centres; half a micro-voxel decides.
    index = index + np.array([5.13e-7, 3.71e-7, 2.72e-7])
    crossings = np.zeros((shape[0], shape[1], shape[2] + 1), np.int8)
    _toggle(np.ascontiguousarray(index), np.ascontiguousarray(faces, np.int64), crossings)
    winding = np.add.accumulate(crossings, axis=2, dtype=np.int8)[:, :, :-1]
    mirrored = np.linalg.det(frame.affine[:3, :3]) < 0
    return winding < 0 if mirrored else winding > 0


@njit(cache=True)
def _toggle(index, faces, crossings):
    """Mark where the lines along the third axis pass through the triangles."""
    na, nb, nc = crossings.shape
    for f in range(len(faces)):
        p, q, r = index[faces[f, 0]], index[faces[f, 1]], index[faces[f, 2]]
        area = (q[0] - p[0]) * (r[1] - p[1]) - (r[0] - p[0]) * (q[1] - p[1])
        if area == 0.0:
            continue
        a0 = max(0, int(np.ceil(min(p[0], q[0], r[0]))))
        a1 = min(na - 1, int(np.floor(max(p[0], q[0], r[0]))))
        b0 = max(0, int(np.ceil(min(p[1], q[1], r[1]))))
        b1 = min(nb - 1, int(np.floor(max(p[1], q[1], r[1]))))
        for a in range(a0, a1 + 1):
            for b in range(b0, b1 + 1):
                wr = ((q[0] - p[0]) * (b - p[1]) - (a - p[0]) * (q[1] - p[1])) / area
                wp = ((r[0] - q[0]) * (b - q[1]) - (a - q[0]) * (r[1] - q[1])) / area
                wq = ((p[0] - r[0]) * (b - r[1]) - (a - r[0]) * (p[1] - r[1])) / area
                if wp >= 0 and wq >= 0 and wr >= 0:
                    c = int(np.ceil(wp * p[2] + wq * q[2] + wr * r[2]))
                    crossings[a, b, min(max(c, 0), nc - 1)] += -1 if area > 0 else 1


def count_self_intersections(vertices: np.ndarray, faces: np.ndarray) -> int:
    """Count the triangle pairs of a mesh that pass through each other; see `self_intersections`."""
    return len(self_intersections(vertices, faces))


def self_intersections(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Find the pairs (K, 2) of a mesh's triangles that pass through each other.

    Pairs that share an edge are not looked at; of pairs that share a vertex, the opposite edges are.
    Touching without passing through does not count.
    """
    if len(faces) == 0:
        return np.zeros((0, 2), np.int64)
    corners = np.ascontiguousarray(np.asarray(vertices, float)[faces])
    low, high = corners.min(axis=1), corners.max(axis=1)
    size = float(np.mean(high - low)) * 2 + 1e-12
    first = np.floor((low - low.min(axis=0)) / size).astype(np.int64)
    last = np.floor((high - low.min(axis=0)) / size).astype(np.int64)
    cells = last.max(axis=0) + 1
    entries = int(np.prod(last - first + 1, axis=1).sum())
    cell, member = _grid_entries(first, last, cells, entries)
    order = np.argsort(cell, kind="stable")
    cell, member = cell[order], member[order]
    starts = np.concatenate([[0], np.flatnonzero(np.diff(cell)) + 1, [len(cell)]])
    pairs = _passing_pairs(
        corners, np.asarray(faces, np.int64), low, high, first, cells, cell, member, starts
    )
    return np.array(pairs, np.int64).reshape(-1, 2)


@njit(cache=True)
def _grid_entries(first, last, cells, entries):
    cell = np.empty(entries, np.int64)
    member = np.empty(entries, np.int64)
    at = 0
    for f in range(len(first)):
        for x in range(first[f, 0], last[f, 0] + 1):
            for y in range(first[f, 1], last[f, 1] + 1):
                for z in range(first[f, 2], last[f, 2] + 1):
                    cell[at] = (x * cells[1] + y) * cells[2] + z
                    member[at] = f
                    at += 1
    return cell, member


@njit(cache=True)
def _side(a, b, c, d):
    """Six times the signed volume of a tetrahedron."""
    ax, ay, az = a[0] - d[0], a[1] - d[1], a[2] - d[2]
    bx, by, bz = b[0] - d[0], b[1] - d[1], b[2] - d[2]
    cx, cy, cz = c[0] - d[0], c[1] - d[1], c[2] - d[2]
    return ax * (by * cz - bz * cy) - ay * (bx * cz - bz * cx) + az * (bx * cy - by * cx)


@njit(cache=True)
def _pierces(a, b, triangle, tiny):
    """Whether the segment ab passes through the inside of a triangle."""
    p, q, r = triangle[0], triangle[1], triangle[2]
    start, end = _side(p, q, r, a), _side(p, q, r, b)
    if start * end >= 0 or abs(start) < tiny or abs(end) < tiny:
        return False
    s, t, w = _side(a, b, p, q), _side(a, b, q, r), _side(a, b, r, p)
    if abs(s) < tiny or abs(t) < tiny or abs(w) < tiny:
        return False
    return (s > 0) == (t > 0) == (w > 0)


@njit(cache=True)
def _passing_pairs(corners, faces, low, high, first, cells, cell, member, starts):
    found = [(np.int64(0), np.int64(0)) for _ in range(0)]  # typed and empty
    for n in range(len(starts) - 1):
        for m in range(starts[n], starts[n + 1]):
            f = member[m]
            for o in range(m + 1, starts[n + 1]):
                g = member[o]
                apart = False
                home = 0  # each pair is tested in the lowest cell that both reach
                for axis in range(3):
                    if low[f, axis] > high[g, axis] or low[g, axis] > high[f, axis]:
                        apart = True
                        break
                    home = home * cells[axis] + max(first[f, axis], first[g, axis])
                if apart or home != cell[starts[n]]:
                    continue
                shared = 0
                own_f, own_g = -1, -1
                for x in range(3):
                    for y in range(3):
                        if faces[f, x] == faces[g, y]:
                            shared += 1
                            own_f, own_g = x, y
                if shared >= 2:
                    continue
                scale = 0.0
                for axis in range(3):
                    scale = max(scale, high[f, axis] - low[f, axis], high[g, axis] - low[g, axis])
                tiny = 1e-12 * scale**3
                hit = False
                for x in range(3):
                    if shared == 0 or x == (own_f + 1) % 3:
                        hit = hit or _pierces(corners[f, x], corners[f, (x + 1) % 3], corners[g], tiny)
                    if shared == 0 or x == (own_g + 1) % 3:
                        hit = hit or _pierces(corners[g, x], corners[g, (x + 1) % 3], corners[f], tiny)
                if hit:
                    found.append((f, g))
    return found
