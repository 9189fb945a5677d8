"""The sparse graph of a slice's boundary pixels: their Delaunay triangulation.

Pixels are the nodes. The triangulation's edges are the candidate links: links between 8-neighbours,
short gap links, and long ones across empty space. Its triangles are the cells that a closed curve splits
into inside and outside, so that any labelling of the triangles has closed curves as its border.
Ghost points on a wide circle around the pixels make the outside known. Memory grows with the number of links.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import Delaunay

from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray, IntArray, connected_parts
from cccd_junctions.branches import connected_nodes

IndexArray = npt.NDArray[np.int32]
DepthArray = npt.NDArray[np.int16]

#: Ghost points on the circle that encloses a slice's pixels.
GHOST_POINTS = 12

#: Links up to these lengths count as walls when regions and depths are found: 8-neighbours, and gaps closed
#: up to about 3, 6 and 12 pixels. Part of the features' definition: other values need other weights.
REGION_GAPS_PX = (1.5, 3.2, 6.4, 12.8)

#: Different numbers of `pixel_hash`.
HASHES = 65521

# Grid points are cocircular; a shift this small makes their triangulation unique and changes nothing else.
_SHIFT_PX = 1e-3


@dataclass(frozen=True, eq=False)
class DelaunayGraph:
    """Nodes, links and triangles of one slice.

    Attributes
    ----------
    points : (V, 2) float64
        Pixels (i, j) of a slice's boundary map, edges of its image besides, and its ghost points.
    ghost : (V,) bool
        Whether a node is a ghost point.
    observed : (V,) bool
        Whether a node is a pixel of the boundary map; else it is a ghost point or an edge of the image.
    triangles : (T, 3) int32
        Nodes of each triangle, in the sense of positive area in (i, j).
    neighbours : (T, 3) int32
        Triangle opposite to each node; -1 beyond the ghost points.
    triangle_links : (T, 3) int32
        Link opposite to each node; -1 where there is no neighbour.
    links : (L, 2) int32
        The two nodes of a link.
    link_triangles : (L, 2) int32
        The two triangles that share a link.
    regions : (T, G) int32
        Region of each triangle when links up to ``REGION_GAPS_PX[g]`` are walls, numbered from 0.
    depths : (T, G) int16
        Fewest such walls between a triangle and the outside.
    """

    points: FloatArray
    ghost: BoolArray
    observed: BoolArray
    triangles: IndexArray
    neighbours: IndexArray
    triangle_links: IndexArray
    links: IndexArray
    link_triangles: IndexArray
    regions: IndexArray
    depths: DepthArray

    @property
    def nbytes(self) -> int:
        """Memory of all arrays in bytes."""
        return sum(getattr(self, field.name).nbytes for field in fields(self))

    @cached_property
    def link_lengths(self) -> FloatArray:
        """Length (L,) of every link in pixels."""
        step = self.points[self.links[:, 0]] - self.points[self.links[:, 1]]
        return np.hypot(step[:, 0], step[:, 1])

    @cached_property
    def areas(self) -> FloatArray:
        """Area (T,) of every triangle in pixels."""
        a, b, c = (self.points[self.triangles[:, n]] for n in range(3))
        ab, ac = b - a, c - a
        return np.abs(ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]) / 2

    @cached_property
    def outer(self) -> BoolArray:
        """Whether a triangle (T,) touches a ghost point: certainly outside."""
        return any_corner(self.ghost, self.triangles)

    @cached_property
    def fragments(self) -> IntArray:
        """Lowest node (V,) of the 8-connected fragment that each node is part of."""
        return connected_nodes(len(self.points), self.links[self.link_lengths <= REGION_GAPS_PX[0]])


def any_corner(marked: BoolArray, triangles: IndexArray) -> BoolArray:
    """Whether any corner of a triangle (T,) is a marked node (V,)."""
    first, second, third = triangles.T  # many times faster than any(axis=1)
    return marked[first] | marked[second] | marked[third]


def _ghost_points(pixels: AnyArray) -> FloatArray:
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    radius = 0.75 * np.hypot(*(high - low)) + 20
    angle = 2 * np.pi * np.arange(GHOST_POINTS) / GHOST_POINTS
    return np.rint((low + high) / 2 + radius * np.column_stack([np.sin(angle), np.cos(angle)]))


def pixel_hash(i: IntArray, j: IntArray) -> IntArray:
    """Assign every pixel a number below `HASHES`, as good as random and always the same."""
    return (i * 7919 + j * 104729) % HASHES


def _scatter(points: FloatArray) -> FloatArray:
    """Shift points by less than `_SHIFT_PX`, the same way wherever a slice lies."""
    local = (points - points.min(axis=0)).astype(np.int64)
    mixed = pixel_hash(*local.T)
    hashed = np.column_stack([mixed * 40503 % HASHES, (mixed * 30011 + 17) % HASHES])
    return points + _SHIFT_PX * (hashed / HASHES - 0.5)


def build_graph(pixels: AnyArray, edges: AnyArray | None = None) -> DelaunayGraph:
    """Triangulate one slice's boundary pixels.

    Parameters
    ----------
    pixels : (N, 2) int array
        Distinct pixels (i, j) of the boundary map, N >= 1.
    edges : (E, 2) int array, optional
        Further pixels through which a boundary may run, within 13 pixels of the map's extent.

    Examples
    --------
    >>> graph = build_graph(np.array([(5, 5), (5, 6), (6, 5), (6, 6)]))
    >>> graph.areas[~graph.outer].tolist(), graph.depths[~graph.outer, 0].tolist()
    ([0.5, 0.5], [1, 1])
    """
    nodes = pixels if edges is None else np.vstack([pixels, edges])
    points = np.vstack([nodes, _ghost_points(pixels)]).astype(float)
    ghost = np.arange(len(points)) >= len(nodes)
    triangulation = Delaunay(_scatter(points))
    triangles = triangulation.simplices.astype(np.int32)
    neighbours = triangulation.neighbors.astype(np.int32)
    links, link_triangles, triangle_links = _links(triangles, neighbours)
    step = points[links[:, 0]] - points[links[:, 1]]
    length = np.hypot(step[:, 0], step[:, 1])
    outer = any_corner(ghost, triangles)
    regions, depths = _regions_and_depths(link_triangles, length, outer)
    return DelaunayGraph(
        points,
        ghost,
        np.arange(len(points)) < len(pixels),
        triangles,
        neighbours,
        triangle_links,
        links,
        link_triangles,
        regions,
        depths,
    )


def _links(triangles: IndexArray, neighbours: IndexArray) -> tuple[IndexArray, IndexArray, IndexArray]:
    """List every link once, from its triangle of lower index: `links`, `link_triangles`, `triangle_links`."""
    first, side = np.nonzero(neighbours > np.arange(len(triangles))[:, None])
    second = neighbours[first, side]
    other_side = np.where(neighbours[second, 0] == first, 0, np.where(neighbours[second, 1] == first, 1, 2))
    links = np.column_stack([triangles[first, (side + 1) % 3], triangles[first, (side + 2) % 3]])
    triangle_links = np.full(triangles.shape, -1, np.int32)
    triangle_links[first, side] = np.arange(len(first))
    triangle_links[second, other_side] = np.arange(len(first))
    return links.astype(np.int32), np.column_stack([first, second]).astype(np.int32), triangle_links


def _regions_and_depths(
    link_triangles: IndexArray, length: FloatArray, outer: BoolArray
) -> tuple[IndexArray, DepthArray]:
    """Regions and depths (T, G) for every scale of `REGION_GAPS_PX`."""
    regions: list[IntArray] = []
    depths: list[FloatArray] = []
    sides = link_triangles.astype(np.int64)
    for gap in REGION_GAPS_PX:
        open_side, wall = sides[length > gap], sides[length <= gap]
        region = connected_parts(open_side[:, 0], open_side[:, 1], len(outer))
        count = int(region.max()) + 1
        between = np.ones(len(wall)), (region[wall[:, 0]], region[wall[:, 1]])
        beside = csr_array(between, shape=(count, count))
        outside = np.unique(region[outer])
        depth = dijkstra(beside, directed=False, indices=outside, unweighted=True, min_only=True)
        regions.append(region)
        depths.append(depth[region])
    return np.column_stack(regions).astype(np.int32), np.column_stack(depths).astype(np.int16)
