"""The sparse graph of a slice's boundary pixels: their Delaunay triangulation.

Pixels are the nodes. The triangulation's edges are the candidate links: links between 8-neighbours,
short gap links, and long ones across empty space. Its triangles are the cells that a closed curve parts
into inside and outside, so that any labelling of the triangles has closed curves as its border.
A ring of far points around the pixels makes the outside known. Nodes, links and triangles of all slices
of a batch stand in common ragged arrays; memory grows with their number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numba
import numpy as np
from scipy.spatial import Delaunay

from cccd.junctions.branches import join_nodes

__all__ = [
    "HASHES",
    "REGION_GAPS_PX",
    "Complex",
    "build_complex",
    "fragments",
    "join_complexes",
    "pixel_hash",
]

#: Points on the ring that encloses a slice's pixels.
RING_POINTS = 12

#: Links up to these lengths count as walls when regions and depths are found: 8-neighbours, and gaps closed
#: up to about 3, 6 and 12 pixels.
REGION_GAPS_PX = (1.5, 3.2, 6.4, 12.8)

#: Different numbers of `pixel_hash`.
HASHES = 65521

# Grid points are cocircular; a shift this small makes their triangulation unique and changes nothing else.
_SHIFT_PX = 1e-3


@dataclass
class Complex:
    """Nodes, links and triangles of one slice or of a batch of slices.

    Attributes
    ----------
    points : (V, 2) float64
        Pixels (i, j) of a slice's map, edges of its image besides, and its ring of far points.
    ring : (V,) bool
        Whether a node is one of the ring.
    drawn : (V,) bool
        Whether a node is a pixel of the map; else it is one of the ring, or an edge of the image besides.
    triangles : (T, 3) int32
        Nodes of each triangle, in the sense of positive area in (i, j).
    neighbours : (T, 3) int32
        Triangle opposite to each node; -1 beyond the ring.
    side_links : (T, 3) int32
        Link opposite to each node; -1 where there is no neighbour.
    links : (L, 2) int32
        The two nodes of a link.
    sides : (L, 2) int32
        The two triangles that share a link.
    regions : (T, G) int32
        Region of each triangle when links up to ``REGION_GAPS_PX[g]`` are walls, numbered from 0.
    depths : (T, G) int16
        Fewest such walls between a triangle and the outside.
    node_offsets, triangle_offsets, link_offsets : (S + 1,) int64
        Where each slice begins.
    """

    points: np.ndarray
    ring: np.ndarray
    drawn: np.ndarray
    triangles: np.ndarray
    neighbours: np.ndarray
    side_links: np.ndarray
    links: np.ndarray
    sides: np.ndarray
    regions: np.ndarray
    depths: np.ndarray
    node_offsets: np.ndarray
    triangle_offsets: np.ndarray
    link_offsets: np.ndarray

    @property
    def nbytes(self) -> int:
        """Memory of all arrays in bytes."""
        return sum(getattr(self, field.name).nbytes for field in fields(self))

    @property
    def link_lengths(self) -> np.ndarray:
        """Length (L,) of every link in pixels."""
        return np.hypot(*(self.points[self.links[:, 0]] - self.points[self.links[:, 1]]).T)

    @property
    def areas(self) -> np.ndarray:
        """Area (T,) of every triangle in pixels."""
        a, b, c = (self.points[self.triangles[:, n]] for n in range(3))
        ab, ac = b - a, c - a
        return np.abs(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]) / 2

    @property
    def outer(self) -> np.ndarray:
        """Whether a triangle (T,) touches the ring: certainly outside."""
        first, second, third = self.triangles.T
        return self.ring[first] | self.ring[second] | self.ring[third]


def _far_ring(pixels: np.ndarray) -> np.ndarray:
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    radius = 0.75 * np.hypot(*(high - low)) + 20
    angle = 2 * np.pi * np.arange(RING_POINTS) / RING_POINTS
    return np.rint((low + high) / 2 + radius * np.column_stack([np.sin(angle), np.cos(angle)]))


def pixel_hash(i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """Give every pixel a number below `HASHES`, as good as random and always the same."""
    return (i * 7919 + j * 104729) % HASHES


def _scatter(points: np.ndarray) -> np.ndarray:
    """Shift points by less than `_SHIFT_PX`, the same way wherever a slice lies."""
    local = (points - points.min(axis=0)).astype(np.int64)
    mixed = pixel_hash(*local.T)
    hashed = np.column_stack([mixed * 40503 % HASHES, (mixed * 30011 + 17) % HASHES])
    return points + _SHIFT_PX * (hashed / HASHES - 0.5)


def build_complex(pixels: np.ndarray, edges: np.ndarray | None = None) -> Complex:
    """Triangulate one slice's boundary pixels.

    Parameters
    ----------
    pixels : (N, 2) int array
        Distinct pixels (i, j) of the map, N >= 1.
    edges : (E, 2) int array, optional
        Further pixels through which a boundary may run, within 13 pixels of the map's extent.
    """
    nodes = pixels if edges is None else np.vstack([pixels, edges])
    points = np.vstack([nodes, _far_ring(pixels)]).astype(float)
    ring = np.arange(len(points)) >= len(nodes)
    drawn = np.arange(len(points)) < len(pixels)
    triangulation = Delaunay(_scatter(points))
    triangles = triangulation.simplices.astype(np.int32)
    neighbours = triangulation.neighbors.astype(np.int32)
    # every link once, from the triangle of lower index
    first, side = np.nonzero(neighbours > np.arange(len(triangles))[:, None])
    second = neighbours[first, side]
    other_side = np.where(neighbours[second, 0] == first, 0, np.where(neighbours[second, 1] == first, 1, 2))
    links = np.column_stack([triangles[first, (side + 1) % 3], triangles[first, (side + 2) % 3]])
    side_links = np.full(triangles.shape, -1, np.int32)
    side_links[first, side] = np.arange(len(first))
    side_links[second, other_side] = np.arange(len(first))
    length = np.hypot(*(points[links[:, 0]] - points[links[:, 1]]).T)
    outer = (triangles >= len(nodes)).any(axis=1)
    gaps = np.array(REGION_GAPS_PX)
    regions, depths = _regions_and_depths(neighbours, side_links, length, outer, gaps)
    return Complex(
        points,
        ring,
        drawn,
        triangles,
        neighbours,
        side_links,
        links.astype(np.int32),
        np.column_stack([first, second]).astype(np.int32),
        regions,
        depths,
        *(np.array([0, n], np.int64) for n in (len(points), len(triangles), len(links))),
    )


def join_complexes(parts: Sequence[Complex]) -> Complex:
    """One complex of several, in order; indices are shifted, regions renumbered."""
    joined = {}
    base = {
        name: np.concatenate([[0], np.cumsum([getattr(p, f"{name}_offsets")[-1] for p in parts])])
        for name in ("node", "triangle", "link")
    }
    region_base = np.zeros(len(REGION_GAPS_PX), np.int32)
    regions = []
    for part in parts:
        regions.append(part.regions + region_base)
        region_base = region_base + part.regions.max(axis=0) + 1
    joined["regions"] = np.concatenate(regions)
    for name in ("points", "ring", "drawn", "depths"):
        joined[name] = np.concatenate([getattr(part, name) for part in parts])
    for name, kind in (
        ("triangles", "node"),
        ("neighbours", "triangle"),
        ("side_links", "link"),
        ("links", "node"),
        ("sides", "triangle"),
    ):
        arrays = [getattr(part, name) for part in parts]
        shifts = base[kind][:-1].astype(np.int32)
        joined[name] = np.concatenate(
            [np.where(a >= 0, a + s, -1).astype(np.int32) for a, s in zip(arrays, shifts, strict=True)]
        )
    for name in ("node", "triangle", "link"):
        offsets = [getattr(p, f"{name}_offsets")[:-1] + b for p, b in zip(parts, base[name], strict=False)]
        joined[f"{name}_offsets"] = np.concatenate([*offsets, base[name][-1:]])
    return Complex(**joined)


@numba.njit(cache=True)
def _regions_and_depths(neighbours, side_links, length, outer, gaps):
    # flood fill numbers the regions; a 0-1 breadth-first search from the outside counts walls
    count = len(neighbours)
    regions = np.full((count, len(gaps)), -1, np.int32)
    depths = np.full((count, len(gaps)), 32767, np.int16)
    queue = np.empty(8 * count + 8, np.int32)
    for g in range(len(gaps)):
        number = 0
        for start in range(count):
            if regions[start, g] >= 0:
                continue
            regions[start, g] = number
            queue[0] = start
            height = 1
            while height > 0:
                height -= 1
                cell = queue[height]
                for side in range(3):
                    beyond = neighbours[cell, side]
                    if beyond >= 0 and regions[beyond, g] < 0 and length[side_links[cell, side]] > gaps[g]:
                        regions[beyond, g] = number
                        queue[height] = beyond
                        height += 1
            number += 1
        current = np.empty(4 * count + 4, np.int32)
        following = np.empty(4 * count + 4, np.int32)
        filled = 0
        for cell in range(count):
            if outer[cell]:
                depths[cell, g] = 0
                current[filled] = cell
                filled += 1
        level = 0
        while filled > 0:
            ahead = 0
            while filled > 0:
                filled -= 1
                cell = current[filled]
                if depths[cell, g] != level:
                    continue
                for side in range(3):
                    beyond = neighbours[cell, side]
                    if beyond < 0:
                        continue
                    wall = length[side_links[cell, side]] <= gaps[g]
                    reached = level + 1 if wall else level
                    if reached < depths[beyond, g]:
                        depths[beyond, g] = reached
                        if wall:
                            following[ahead] = beyond
                            ahead += 1
                        else:
                            current[filled] = beyond
                            filled += 1
            current, following = following, current
            filled = ahead
            level += 1
    return regions, depths


def fragments(graph: Complex) -> np.ndarray:
    """Lowest node (V,) of the 8-connected fragment that each node is part of."""
    return join_nodes(len(graph.points), graph.links[graph.link_lengths <= REGION_GAPS_PX[0]])
