"""A slice's graph and its features as `torch_geometric.data.HeteroData`: what the network's layers read.

==================== ===============================================================================
stored at            holds
==================== ===============================================================================
``pixel``            ``x`` (V, NODES.width) uint8
``link``             ``x`` (L, LINKS.width), ``direction`` (L, 2): unit vector from first pixel to second
``triangle``         ``x`` (T, TRIANGLES.width), ``intensity`` (T, len(BLURS)), ``extent`` (T,): its weight in
                     the slice's mean intensity
``pool_index``       of triangles (`TRIANGLE_POOLS`, T) their region, at two scales; of links
                     (`LINK_POOLS`, L) what they share with others: the same two regions, at two scales,
                     the same two branches, the same two good-continuation groups
`PIXEL_LINKS`        the two pixels of every link, each link once, in the order of ``link``
`TRIANGLE_LINKS`     the two triangles that share a link, in the same order
`CORNERS`            pixels to the triangles that they are corners of; ``edge_attr`` (3 T, CORNER_WIDTH):
                     cosine and sine of the corner's angle at the centroid, of twice the angle, log of its
                     distance
==================== ===============================================================================

`torch_geometric.data.Batch` joins slices: it shifts indices by what they count, pools included.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch_geometric.data import HeteroData

from cccd.geometry.arrays import AnyArray, IntArray
from cccd.tolerances import LEAST_PX
from cccd_junctions.delaunay import DelaunayGraph
from cccd_junctions.features import INTENSITIES, GraphFeatures, measure_features
from cccd_junctions.intensity import IntensitySlice

#: Types of edges.
PIXEL_LINKS = ("pixel", "link", "pixel")
TRIANGLE_LINKS = ("triangle", "link", "triangle")
CORNERS = ("pixel", "corner", "triangle")

#: Rows of ``pool_index``.
TRIANGLE_POOLS, LINK_POOLS = 2, 4

#: Columns of the corners' ``edge_attr``.
CORNER_WIDTH = 5

# Scales of `REGION_GAPS_PX` at which triangles and links are pooled: near and far.
_POOLED_SCALES = (0, 2)


class SliceData(HeteroData):
    """A `HeteroData` whose pools are shifted as well when slices are joined."""

    def __cat_dim__(self, key: str, value: Any, *args: Any, **kwargs: Any) -> Any:
        """Along which dimension slices are joined."""
        return 1 if key == "pool_index" else super().__cat_dim__(key, value, *args, **kwargs)

    def __inc__(self, key: str, value: Any, *args: Any, **kwargs: Any) -> Any:
        """By how much the next slice's numbers are raised."""
        if key == "pool_index":
            return value.amax(dim=1, keepdim=True) + 1
        return super().__inc__(key, value, *args, **kwargs)


def make_data(graph: DelaunayGraph, intensity: IntensitySlice | None) -> HeteroData:
    """Measure a slice's features and put graph and features into tensors."""
    features = measure_features(graph, intensity)
    data = SliceData()
    data["pixel"].x = torch.as_tensor(features.nodes)
    data["link"].x = real_tensor(features.links)
    data["link"].direction = real_tensor(_link_directions(graph))
    data["triangle"].x = real_tensor(features.triangles)
    data["triangle"].intensity = real_tensor(features.triangles[:, INTENSITIES])
    data["triangle"].extent = real_tensor(np.where(graph.outer, 0, graph.areas))
    data[PIXEL_LINKS].edge_index = _index(graph.links.T)
    data[TRIANGLE_LINKS].edge_index = _index(graph.link_triangles.T)
    owners = np.arange(len(graph.triangles)).repeat(3)
    data[CORNERS].edge_index = _index(np.stack([graph.triangles.ravel(), owners]))
    data[CORNERS].edge_attr = real_tensor(_corner_directions(graph))
    data["triangle"].pool_index = _index(graph.regions[:, _POOLED_SCALES].T)
    data["link"].pool_index = _index(_link_pools(graph, features))
    return data


def _index(array: AnyArray) -> Tensor:
    return torch.as_tensor(np.ascontiguousarray(array, np.int64))


def real_tensor(array: AnyArray) -> Tensor:
    """Float32 of an array."""
    return torch.as_tensor(np.ascontiguousarray(array, np.float32))


def _link_directions(graph: DelaunayGraph) -> AnyArray:
    first, second = graph.links.T
    return (graph.points[second] - graph.points[first]) / graph.link_lengths[:, None]


def _corner_directions(graph: DelaunayGraph) -> AnyArray:
    i, j = (values[graph.triangles] for values in graph.points.T)
    up, along = ((values - values @ np.full((3, 1), 1 / 3)).ravel() for values in (i, j))
    reach = np.maximum(np.hypot(up, along), LEAST_PX)
    cosine, sine = along / reach, up / reach
    return np.stack([cosine, sine, cosine**2 - sine**2, 2 * cosine * sine, np.log(reach)], axis=1)


def _link_pools(graph: DelaunayGraph, features: GraphFeatures) -> IntArray:
    pairs = [graph.regions[graph.link_triangles, g] for g in _POOLED_SCALES]
    pairs += [labels[graph.links] for labels in (features.branch, features.group)]
    return np.stack([_same_pair(pair.astype(np.int64)) for pair in pairs])


def _same_pair(pair: IntArray) -> IntArray:
    """Assign equal unordered pairs (L, 2) equal numbers (L,)."""
    low, high = np.minimum(*pair.T), np.maximum(*pair.T)
    return np.unique(low * (int(pair.max()) + 1) + high, return_inverse=True)[1]
