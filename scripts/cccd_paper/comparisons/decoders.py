"""Classical decoders of boundary maps: from unordered pixels to one closed curve.

Each accepts the map's pixels (N, 2) and a point inside the organ, and returns the corners (n, 2) of a closed
polygon, empty when it finds none. The point is what an ideal user would click; those that need none
ignore it. `decode` turns any of these polygons into a strictly simple pixel chain.
"""

from __future__ import annotations

from collections.abc import Callable
from heapq import heappop, heappush

import cv2
import numpy as np
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from scipy.spatial import Delaunay
from skimage.morphology import skeletonize
from skimage.segmentation import watershed

from cccd.containers import Frame
from cccd.contours import trace_stack
from cccd.geometry._jit import jit
from cccd_paper.comparisons.reconstruction.connect2d import connect2d
from cccd_paper.comparisons.reconstruction.tour import tour
from cccd_paper.junctions.grid import follow_chains, keep_two

_FRAME = Frame(np.eye(4), 2, (1, 1, 1))
_MARGIN = 3


def _raster(pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Draw the map as a raster (I, J) with an empty margin; return its first element's pixel too."""
    origin = pixels.min(axis=0) - _MARGIN
    drawn = np.zeros(pixels.max(axis=0) + _MARGIN + 1 - origin, np.uint8)
    drawn[tuple((pixels - origin).T)] = 1
    return drawn, origin


def _largest_border(mask: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Return the largest strictly simple loop (n, 2) around a mask (I, J); empty when there is none."""
    curves = trace_stack(mask[None].astype(bool), (0, *origin), _FRAME)
    if not len(curves):
        return np.zeros((0, 2))
    best = int(np.argmax(curves.polygons.signed_areas))
    return curves.points[curves.offsets[best] : curves.offsets[best + 1]]


def decode(decoder: Callable, pixels: np.ndarray, seed: np.ndarray) -> np.ndarray:
    """Run a decoder and close its polygon to one strictly simple chain of 8-connected pixels (n, 2).

    Parameters
    ----------
    decoder : callable
        One of `cccd_paper.comparisons.baselines.decoders.DECODERS`.
    pixels : (N, 2) int array
    seed : (2,) array
        A point inside the organ.
    """
    pixels = np.asarray(pixels, np.int64)
    if np.linalg.matrix_rank(pixels - pixels[0]) < 2:  # on a line, which encloses nothing
        return np.zeros((0, 2))
    polygon = decoder(pixels, seed)
    if len(polygon) < 3:
        return np.zeros((0, 2))
    corners = np.rint(polygon).astype(np.int64)
    origin = corners.min(axis=0) - 1
    mask = np.zeros(corners.max(axis=0) + 2 - origin, np.uint8)
    cv2.fillPoly(mask, [(corners - origin)[:, ::-1].astype(np.int32)], 1)
    return _largest_border(mask, origin)


def seeded_watershed(pixels: np.ndarray, seed: np.ndarray) -> np.ndarray:
    """Flood from the seed and from outside over the distance to the map; they meet along the boundary.

    Narrow gaps are saddles of that distance, so that the floods meet there too (Vincent and Soille 1991).
    Stubs one pixel wide are opened away.
    """
    drawn, origin = _raster(pixels)
    away = cv2.distanceTransform(1 - drawn, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    markers = np.zeros(drawn.shape, np.int32)
    markers[0], markers[-1], markers[:, 0], markers[:, -1] = 1, 1, 1, 1
    at = np.clip(np.rint(seed - origin).astype(int), 0, np.array(drawn.shape) - 1)
    # the seed is a disc as large as the empty space around it
    cv2.circle(markers, (int(at[1]), int(at[0])), max(0, int(away[tuple(at)]) - 1), 2, -1)
    inside = watershed(-away, markers) == 2
    # the map's pixels beside the inside are the organ's own
    inside = cv2.dilate(inside.astype(np.uint8), np.ones((3, 3), np.uint8)) & (inside | drawn)
    inside = ndimage.binary_opening(inside, np.ones((2, 2), bool))
    return _largest_border(inside, origin)


#: Cost of a pixel off the map, relative to one on it.
_OFF_MAP = 12.0


def circular_path(pixels: np.ndarray, seed: np.ndarray) -> np.ndarray:
    """Cheapest closed path around the seed, length counted relative to the distance from it.

    A ray from the seed joins two sheets of the pixel grid; a path from a pixel on the ray to its twin on
    the other sheet winds around the seed once (Appleton and Sun 2003). Dijkstra (1959).
    """
    drawn, origin = _raster(pixels)
    centre = np.clip(np.rint(np.asarray(seed) - origin).astype(int), 1, np.array(drawn.shape) - 2)
    distance = cv2.distanceTransform(1 - drawn, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    cost = np.where(drawn > 0, 1.0, np.minimum(4 + 2 * distance, _OFF_MAP))
    row, column = np.mgrid[: drawn.shape[0], : drawn.shape[1]]
    cost = cost / np.maximum(np.hypot(row - centre[0], column - centre[1]), 1.0)
    ray = np.arange(centre[1] + 1, drawn.shape[1])
    starts = ray[np.argsort(cost[centre[0], ray], kind="stable")[:4]]
    best, least = np.zeros((0, 2)), np.inf
    for start in starts:
        path, total = _wind(cost, centre[0], centre[1], start)
        if total < least:
            best, least = path + origin, total
    return best


@jit
def _wind(cost, centre_row, centre_column, start):
    # sheet 0 and 1 meet where the ray (row of the seed, to its right) is crossed
    rows, columns = cost.shape
    size = rows * columns
    reached = np.full(2 * size, np.inf)
    came = np.full(2 * size, -1, np.int64)
    begin = centre_row * columns + start
    goal = size + begin
    reached[begin] = 0.0
    heap = [(0.0, begin)]
    while len(heap) > 0:
        total, node = heappop(heap)
        if node == goal:
            break
        if total > reached[node]:
            continue
        sheet, place = node // size, node % size
        i, j = place // columns, place % columns
        for di in range(-1, 2):
            for dj in range(-1, 2):
                a, b = i + di, j + dj
                if (di == 0 and dj == 0) or a < 0 or b < 0 or a >= rows or b >= columns:
                    continue
                if a == centre_row and b == centre_column:
                    continue
                crossing = b > centre_column and j > centre_column
                turned = sheet
                if (crossing and i < centre_row and a >= centre_row) or (
                    crossing and i >= centre_row and a < centre_row
                ):
                    turned = 1 - sheet
                step = 1.0 if di == 0 or dj == 0 else 1.4142135623730951
                through = total + step * 0.5 * (cost[i, j] + cost[a, b])
                following = turned * size + a * columns + b
                if through < reached[following]:
                    reached[following] = through
                    came[following] = node
                    heappush(heap, (through, following))
    length = 0
    node = goal
    while node >= 0:
        length += 1
        node = came[node]
    path = np.empty((length, 2), np.int64)
    node = goal
    for n in range(length):
        path[n, 0], path[n, 1] = (node % size) // columns, (node % size) % columns
        node = came[node]
    return path, reached[goal]


#: Branches of the skeleton that end within so many pixels are spurs.
_SPUR_PX = 12
#: Length that leaving a point out of the tour must save: more than a thin lobe's 1, less than a spur's 2.
_PRIZE_PX = 1.4
#: Most points that are left out in a row.
_LONGEST_SKIP = 80


def _prune(skeleton: np.ndarray, rounds: int) -> np.ndarray:
    """Wear branches of a skeleton (I, J) off that end within ``rounds`` pixels; other ends stay."""
    kernel = np.ones((3, 3), np.uint8)
    kernel[1, 1] = 0
    kept, worn = skeleton.astype(np.uint8), skeleton.astype(np.uint8)
    for _ in range(rounds):
        around = cv2.filter2D(worn, cv2.CV_8U, kernel, borderType=cv2.BORDER_CONSTANT)
        worn = worn & (around > 1)
    # what was worn off at an end that still stands grows back along the skeleton
    around = cv2.filter2D(worn, cv2.CV_8U, kernel, borderType=cv2.BORDER_CONSTANT)
    front = worn & (around <= 1)
    for _ in range(rounds):
        front = np.asarray(cv2.dilate(front, np.ones((3, 3), np.uint8)), np.uint8) & kept & (1 - worn)
        if not front.any():
            break
        worn |= front
    return worn


def prize_tour(pixels: np.ndarray, seed: np.ndarray) -> np.ndarray:
    """Thin and prune the map, tour all that is left, then leave out what costs more than it is worth."""
    drawn, origin = _raster(pixels)
    kept = np.argwhere(_prune(skeletonize(drawn > 0), _SPUR_PX)) + origin
    if len(kept) < 8:
        return kept[:0]
    (order,), _ = follow_chains(tour(kept.astype(float)), len(kept))
    return kept[_collect(kept[order].astype(float), _PRIZE_PX, _LONGEST_SKIP, order)]


@jit
def _collect(points, prize, window, order):
    # shortest path over the tour, twice around: the second half starts from a settled state
    count = len(points)
    total = np.full(3 * count, np.inf)
    came = np.full(3 * count, -1, np.int64)
    total[:1] = 0.0
    for n in range(1, 3 * count):
        a = points[n % count]
        for back in range(1, min(window, n, count - 3) + 1):
            b = points[(n - back) % count]
            length = np.hypot(a[0] - b[0], a[1] - b[1])
            # long jumps are unlikely: they cost more than their length
            value = total[n - back] + length * (1 + 0.02 * length) + prize * (back - 1)
            if value < total[n]:
                total[n], came[n] = value, n - back
    chosen = np.zeros(count, np.bool_)
    node = 3 * count - 1
    while node >= count:
        if node < 2 * count:
            chosen[node % count] = True
        node = came[node]
    return order[chosen]


#: A closing gap of this many pixels halves what the cycle's area counts.
_GAP_PX = 8.0


def best_tree_cycle(pixels: np.ndarray, seed: np.ndarray) -> np.ndarray:
    """Close the Euclidean minimum spanning tree by the one link whose cycle encloses most per gap."""
    points = pixels.astype(float)
    corners = Delaunay(points).simplices
    links = np.unique(np.sort(corners[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    length = np.linalg.norm(points[links[:, 0]] - points[links[:, 1]], axis=1)
    tree = minimum_spanning_tree(coo_matrix((length, links.T), (len(points), len(points))).tocsr())
    order, parent = breadth_first_order(tree, 0, directed=False)
    # the area swept from the root to a node, so that a cycle's area is a difference of two
    swept = np.zeros(len(points))
    for node in order[1:]:
        above = points[parent[node]]
        swept[node] = swept[parent[node]] + (above[0] * points[node, 1] - above[1] * points[node, 0]) / 2
    a, b = links.T
    closing = (points[a, 0] * points[b, 1] - points[a, 1] * points[b, 0]) / 2
    area = np.abs(swept[a] + closing - swept[b])
    worth = area / (1 + (length / _GAP_PX) ** 2)
    best = int(np.argmax(worth))
    # rooted at one end of the link, the tree leads from the other along the cycle
    _, towards = breadth_first_order(tree, a[best], directed=False)
    cycle = [b[best]]
    while cycle[-1] != a[best]:
        cycle.append(towards[cycle[-1]])
    return points[cycle[::-1]]


def connected_complex(pixels: np.ndarray, seed: np.ndarray) -> np.ndarray:
    """Return the closed polygon of Connect2D (Ohrhallinger and Mudur 2013)."""
    links = connect2d(pixels.astype(float))
    if len(links) < 3:
        return pixels[:0]
    kept = links[keep_two(links, np.ones(len(links)), len(pixels))]
    chains, _ = follow_chains(kept, len(pixels))
    return pixels[max(chains, key=len)]
