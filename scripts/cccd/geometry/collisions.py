"""Which triangles of a mesh pass through each other.

Triangles are sorted into the cells of a grid somewhat wider than they are; only those that share a cell
are tested, each pair in the lowest cell that both reach.
"""

from __future__ import annotations

import numpy as np

from cccd.geometry._jit import jit, jit_within
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, ranks_of
from cccd.geometry.triangles import Point, corners_of, point_of

__all__ = ["MovingTriangles", "passing_pairs"]

#: Volumes below this share of the cube of a triangle's size count as none: the triangles only touch.
_TOUCHING = 1e-12
#: Width of a cell by the mean extent of the triangles' boxes: fewer pairs share a narrower one, but more
#: triangles reach several.
_CELL = 1.5
#: Pairs for which there is room at first: where there are more, all are sought again.
_FIRST_PAIRS = 1024
#: Cells, about, of the grid in which triangles near those that have moved are looked up.
_MOST_CELLS = 2e6
#: Share of the triangles that are looked up there; the few that are longer always count as near.
_USUAL = 0.99


class MovingTriangles:
    """Triangles whose vertices move a few at a time: pairs of which neither has moved are not tested again.

    Parameters
    ----------
    faces : (F, 3) int64

    Examples
    --------
    >>> triangles = MovingTriangles(np.arange(6).reshape(2, 3))
    >>> points = np.array([(0.0, 0, 0), (2, 0, 0), (0, 2, 0), (0.5, 0.5, -1), (0.5, 0.5, 1), (9, 9, 0)])
    >>> triangles.passing_pairs(points).tolist()
    [[0, 1]]
    >>> points[3:] += (9, 0, 0)
    >>> triangles.passing_pairs(points).tolist()
    []
    """

    def __init__(self, faces: IntArray) -> None:
        self.faces = faces
        self._vertices: FloatArray | None = None
        self._pairs = np.zeros((0, 2), np.int64)

    def passing_pairs(self, vertices: FloatArray) -> IntArray:
        """Find the pairs (K, 2) that pass through each other, with the vertices (V, 3) as they are now."""
        if self._vertices is None:
            self._pairs = passing_pairs(vertices, self.faces)
        else:
            moved = _any_of_three(_any_of_three(vertices != self._vertices)[self.faces])
            still = self._pairs[~(moved[self._pairs[:, 0]] | moved[self._pairs[:, 1]])]
            near = np.flatnonzero(_near(vertices, self.faces, moved))
            found = near[passing_pairs(vertices, self.faces[near], moved[near])]
            self._pairs = np.concatenate([still, found])
        self._vertices = vertices.copy()
        return self._pairs


def _any_of_three(flags: BoolArray) -> BoolArray:
    """Whether any in a row (N, 3) is set: NumPy's own ``any`` takes ten times as long for rows so short."""
    return flags[:, 0] | flags[:, 1] | flags[:, 2]


def _near(vertices: FloatArray, faces: IntArray, moved: BoolArray) -> BoolArray:
    """Triangles (F,) that may reach the box of a moved one; and some more."""
    if not moved.any():
        return moved
    lower, upper = _corners_of_boxes(vertices, faces)
    side = (upper - lower).max(axis=1)
    usual = float(np.quantile(side, _USUAL))
    # what is no longer than usual reaches a box where its lower corner lies in it, or below it by so much
    first, last = lower[moved] - usual, upper[moved]
    origin, extent = first.min(axis=0), np.ptp(np.concatenate([first, last]), axis=0)
    width = max(usual, float(np.cbrt(extent.prod() / _MOST_CELLS)), 1e-12)
    cells = (extent / width).astype(np.int64) + 1
    marked = np.zeros(cells, np.bool_)
    marked.ravel()[_grid_entries(np.hstack([first - origin, last - origin]) / width, cells)[0]] = True
    place = np.floor((lower - origin) / width)
    within = ~_any_of_three((place < 0) | (place >= cells))
    near = side > usual
    near[within] |= marked[tuple(place[within].astype(np.int64).T)]
    return near


def passing_pairs(vertices: FloatArray, faces: IntArray, of: BoolArray | None = None) -> IntArray:
    """Find the pairs (K, 2) of triangles that pass through each other.

    Pairs that share an edge are not looked at; of pairs that share a vertex, the opposite edges are.
    Touching without passing through does not count.

    Parameters
    ----------
    vertices, faces : (V, 3) float64, (F, 3) int64
    of : (F,) bool, optional
        Triangles of which each pair has one at least; by default all.
    """
    if len(faces) == 0:
        return np.zeros((0, 2), np.int64)
    of = np.ones(len(faces), np.bool_) if of is None else of
    vertices, faces = np.ascontiguousarray(vertices, float), np.ascontiguousarray(faces, np.int64)
    boxes = _boxes(vertices, faces)
    cells = boxes[:, 3:].max(axis=0).astype(np.int64) + 1
    cell, member = _grid_entries(boxes, cells)
    cell, member = np.divmod(np.sort(cell * len(faces) + member), len(faces))  # faster than any argsort
    starts = np.concatenate([[0], np.flatnonzero(np.diff(cell)) + 1])
    ends = np.append(starts[1:], len(cell))
    several = (ends - starts > 1) & np.logical_or.reduceat(of[member], starts)
    starts, ends = starts[several], ends[several]
    places = np.column_stack(np.unravel_index(cell[starts], tuple(cells)))
    pairs = np.empty((_FIRST_PAIRS, 2), np.int64)
    ranges = np.column_stack([starts, ends])
    while (found := _pairs_in_cells(vertices, faces, of, boxes, member, ranges, places, pairs)) > len(pairs):
        pairs = np.empty((found, 2), np.int64)
    return pairs[:found]


def _boxes(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Bounding boxes (F, 6) in cells of the grid: the lower corner, then the upper."""
    lower, upper = _corners_of_boxes(vertices, faces)
    width = np.cumsum(upper - lower)[-1]  # in their order: `sum` adds in pairs
    width = _CELL * width / (3 * len(faces)) + 1e-12
    lowest = lower.min(axis=0)
    return np.hstack([(lower - lowest) / width, (upper - lowest) / width])


def _corners_of_boxes(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray]:
    """Lower and upper corners (F, 3) of the triangles' boxes."""
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _grid_entries(boxes: FloatArray, cells: IntArray) -> tuple[IntArray, IntArray]:
    """Every cell that a triangle's box reaches, and the triangle."""
    first, last = boxes[:, :3].astype(np.int64), boxes[:, 3:].astype(np.int64)
    reached = last - first + 1
    count = reached.prod(axis=1)
    member = np.repeat(np.arange(len(boxes)), count)
    rest, z = np.divmod(ranks_of(count), reached[member, 2])
    x, y = np.divmod(rest, reached[member, 1])
    start = (first[:, 0] * cells[1] + first[:, 1]) * cells[2] + first[:, 2]
    return start[member] + (x * cells[1] + y) * cells[2] + z, member


@jit
def _pairs_in_cells(
    vertices: FloatArray,
    faces: IntArray,
    of: BoolArray,
    boxes: FloatArray,
    member: IntArray,
    ranges: IntArray,
    places: IntArray,
    pairs: IntArray,
) -> int:
    """Write the pairs that pass through each other, as far as there is room, and return their number.

    Members from ``ranges[n, 0]`` up to ``ranges[n, 1]`` reach one cell.
    """
    found = 0
    for n in range(len(ranges)):
        for m in range(ranges[n, 0], ranges[n, 1]):
            for o in range(m + 1, ranges[n, 1]):
                f, g = member[m], member[o]
                if (
                    (of[f] or of[g])
                    and _meet_first_in(boxes, f, g, places, n)
                    and _pass(vertices, faces, f, g)
                ):
                    if found < len(pairs):
                        pairs[found, 0], pairs[found, 1] = f, g
                    found += 1
    return found


@jit_within
def _meet_first_in(boxes: FloatArray, f: int, g: int, places: IntArray, n: int) -> bool:
    """Whether two boxes overlap, and this is the lowest cell that both reach."""
    for axis in range(3):
        if boxes[f, axis] > boxes[g, axis + 3] or boxes[g, axis] > boxes[f, axis + 3]:
            return False
        if int(max(boxes[f, axis], boxes[g, axis])) != places[n, axis]:
            return False
    return True


@jit_within
def _pass(vertices: FloatArray, faces: IntArray, f: int, g: int) -> bool:
    """Whether an edge of one of two triangles pierces the other."""
    shared, own_f, own_g = 0, -1, -1
    for x in range(3):
        for y in range(3):
            if faces[f, x] == faces[g, y]:
                shared += 1
                own_f, own_g = x, y
    if (
        shared >= 2
        or _on_one_side(vertices, faces, f, g, own_g)
        or _on_one_side(vertices, faces, g, f, own_f)
    ):
        return False
    tiny = _TOUCHING * max(_extent(vertices, faces, f), _extent(vertices, faces, g)) ** 3
    for x in range(3):  # beside a shared corner only the opposite edge can pierce
        if (shared == 0 or x == (own_f + 1) % 3) and _edge_pierces(vertices, faces, f, x, g, tiny):
            return True
        if (shared == 0 or x == (own_g + 1) % 3) and _edge_pierces(vertices, faces, g, x, f, tiny):
            return True
    return False


@jit_within
def _on_one_side(vertices: FloatArray, faces: IntArray, f: int, g: int, shared: int) -> bool:
    """Whether the corners of ``g``, but for a shared one, lie on one side of the plane of ``f``."""
    p, q, r = corners_of(vertices, faces, f)
    above, below = False, False
    for x in range(3):
        if x != shared:
            side = _six_volumes(p, q, r, point_of(vertices, faces[g, x]))
            above, below = above or side > 0, below or side < 0
    return not (above and below)


@jit_within
def _extent(vertices: FloatArray, faces: IntArray, f: int) -> float:
    """Longest side of a triangle's box."""
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    extent = 0.0
    for axis in range(3):
        p, q, r = vertices[a, axis], vertices[b, axis], vertices[c, axis]
        extent = max(extent, max(p, q, r) - min(p, q, r))
    return extent


@jit_within
def _edge_pierces(vertices: FloatArray, faces: IntArray, f: int, x: int, g: int, tiny: float) -> bool:
    """Whether edge ``x`` of one triangle passes through the inside of another."""
    a, b = point_of(vertices, faces[f, x]), point_of(vertices, faces[f, (x + 1) % 3])
    p, q, r = corners_of(vertices, faces, g)
    start, end = _six_volumes(p, q, r, a), _six_volumes(p, q, r, b)
    if start * end >= 0 or abs(start) < tiny or abs(end) < tiny:
        return False
    s, t, w = _six_volumes(a, b, p, q), _six_volumes(a, b, q, r), _six_volumes(a, b, r, p)
    if abs(s) < tiny or abs(t) < tiny or abs(w) < tiny:
        return False
    return (s > 0) == (t > 0) == (w > 0)


@jit_within
def _six_volumes(a: Point, b: Point, c: Point, d: Point) -> float:
    """Six times the signed volume of a tetrahedron."""
    ax, ay, az = a[0] - d[0], a[1] - d[1], a[2] - d[2]
    bx, by, bz = b[0] - d[0], b[1] - d[1], b[2] - d[2]
    cx, cy, cz = c[0] - d[0], c[1] - d[1], c[2] - d[2]
    return ax * (by * cz - bz * cy) - ay * (bx * cz - bz * cx) + az * (bx * cy - by * cx)
