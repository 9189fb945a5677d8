"""A short closed tour through all points: greedy links, then 2-opt and Or-opt.

J. L. Bentley, Fast algorithms for geometric traveling salesman problems, ORSA J. Comput. 4 (1992)
387-411. That a shortest tour reconstructs well-sampled closed curves: J. Giesen, Curve reconstruction,
the traveling salesman problem and Menger's theorem on length, SoCG 1999.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from cccd.geometry._jit import jit
from cccd.tolerances import ROUNDING
from cccd_paper.comparisons.links import unique_links

#: Neighbours looked at per point.
NEIGHBOURS = 10


def tour(points: np.ndarray) -> np.ndarray:
    """Links of a tour that neither a 2-opt nor an Or-opt move among near neighbours makes shorter."""
    points = np.ascontiguousarray(points, float)
    if len(points) < 3:
        return np.arange(len(points)).reshape(-1, 2)[:1] if len(points) == 2 else np.zeros((0, 2), np.int64)
    count = min(NEIGHBOURS + 1, len(points))
    distance, near = map(np.asarray, cKDTree(points).query(points, count))
    near = np.where(near == np.arange(len(points))[:, None], near[:, :1], near)[:, 1:]
    pairs = np.column_stack([np.repeat(np.arange(len(points)), count - 1), near.ravel()])
    order = np.lexsort((pairs[:, 1], pairs[:, 0], distance[:, 1:].ravel()))
    route = _join(points, _greedy(len(points), pairs[order]))
    _improve(points, np.ascontiguousarray(near), route)
    return unique_links(np.column_stack([route, np.roll(route, -1)]))


@jit
def _root(parent, point):
    while parent[point] != point:
        parent[point] = parent[parent[point]]
        point = parent[point]
    return point


@jit
def _greedy(n_points, pairs):
    """Links (N, 2) of each point, -1 where free: shortest pairs first, no cycle, no third link."""
    links = np.full((n_points, 2), -1)
    parent = np.arange(n_points)
    for row in range(len(pairs)):
        one, other = pairs[row]
        if one == other or links[one, 1] >= 0 or links[other, 1] >= 0:
            continue
        root, other_root = _root(parent, one), _root(parent, other)
        if root != other_root:
            parent[root] = other_root
            links[one, 0 if links[one, 0] < 0 else 1] = other
            links[other, 0 if links[other, 0] < 0 else 1] = one
    return links


@jit
def _join(points, links):
    """Walk the fragments one after the other, from each end to the nearest end of another."""
    n_points = len(points)
    route = np.empty(n_points, np.int64)
    ends = np.flatnonzero(links[:, 1] < 0)
    done = np.zeros(n_points, np.bool_)
    here = ends[0]
    for place in range(n_points):
        route[place] = here
        done[here] = True
        following = -1
        for slot in range(2):
            if links[here, slot] >= 0 and not done[links[here, slot]]:
                following = links[here, slot]
        if following < 0:
            nearest = np.inf
            for end in ends:
                if not done[end]:
                    gap = (points[end, 0] - points[here, 0]) ** 2 + (points[end, 1] - points[here, 1]) ** 2
                    if gap < nearest:
                        following, nearest = end, gap
        here = following
    return route


@jit
def _distance(points, one, other):
    return np.hypot(points[one, 0] - points[other, 0], points[one, 1] - points[other, 1])


@jit
def _reverse(route, place, first, last):
    """Reverse the stretch between two places of the cyclic route, or its complement if that is shorter."""
    size = len(route)
    inner = (last - first) % size + 1
    if 2 * inner > size:
        first, last = (last + 1) % size, (first - 1) % size
        inner = size - inner
    for _ in range(inner // 2):
        one, other = route[first], route[last]
        route[first], route[last] = other, one
        place[other], place[one] = first, last
        first, last = (first + 1) % size, (last - 1) % size


@jit
def _improve(points, near, route):
    size = len(route)
    place = np.empty(size, np.int64)
    place[route] = np.arange(size)
    improved = True
    while improved:
        improved = False
        for point in range(size):
            while _two_opt(points, near, route, place, point) or _or_opt(points, near, route, place, point):
                improved = True


@jit
def _two_opt(points, near, route, place, a):
    """Replace links (a, b) and (c, d) by (a, c) and (b, d), b and d both after or both before."""
    size = len(route)
    for step in (1, -1):
        b = route[(place[a] + step) % size]
        link = _distance(points, a, b)
        for c in near[a]:
            gap = _distance(points, a, c)
            if gap >= link:
                break
            d = route[(place[c] + step) % size]
            gain = link + _distance(points, c, d) - gap - _distance(points, b, d)
            if c != b and d != a and gain > ROUNDING * link:
                if step == 1:
                    _reverse(route, place, place[b], place[c])
                else:
                    _reverse(route, place, place[c], place[b])
                return True
    return False


@jit
def _or_opt(points, near, route, place, a):
    """Move a stretch of one to three points that begins at ``a`` between two neighbours elsewhere."""
    size = len(route)
    for step in (1, -1):
        before = route[(place[a] - step) % size]
        link = _distance(points, before, a)
        for length in range(1, 4):
            if size < length + 3:
                break
            last = route[(place[a] + step * (length - 1)) % size]
            after = route[(place[last] + step) % size]
            saved = link + _distance(points, last, after) - _distance(points, before, after)
            for c in near[a]:
                gap = _distance(points, a, c)
                if gap >= saved:
                    break
                if (step * (place[c] - place[a])) % size < length:
                    continue  # within the stretch
                for side in (1, -1):
                    d = route[(place[c] + side) % size]
                    if (step * (place[d] - place[a])) % size < length:
                        continue
                    gain = saved + _distance(points, c, d) - gap - _distance(points, last, d)
                    if gain > ROUNDING * saved:
                        _move(route, place, a, last, step, c, d)
                        return True
    return False


@jit
def _move(route, place, a, last, step, c, d):
    """Cut the stretch a..last out and put it between c and d, a next to c."""
    size = len(route)
    length = (step * (place[last] - place[a])) % size + 1
    stretch = np.empty(length, np.int64)
    for number in range(length):
        stretch[number] = route[(place[a] + step * number) % size]
    rest = np.empty(size, np.int64)
    count = 0
    here = (place[last] + step) % size
    for number in range(size - length):  # what stays, in the direction of the step
        point = route[here]
        rest[count] = point
        count += 1
        here = (here + step) % size
        if number == size - length - 1:
            break
        if point == c and route[here] == d:
            rest[count : count + length] = stretch
            count += length
        elif point == d and route[here] == c:
            rest[count : count + length] = stretch[::-1]
            count += length
    route[:] = rest
    place[route] = np.arange(size)
