"""A graph and its features as tensors: what the network's layers read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from cccd.geometry.arrays import AnyArray, IntArray, owners_of
from cccd.junctions.delaunay import DelaunayGraph
from cccd.junctions.features import INTENSITIES, GraphFeatures, measure_features
from cccd.junctions.intensity import IntensitySlice
from cccd.tolerances import LEAST_PX

__all__ = ["CORNER_WIDTH", "POOLED_SCALES", "GraphBatch", "make_batch"]

#: Scales of `REGION_GAPS_PX` at which triangles and links are pooled.
POOLED_SCALES = (0, 2)

#: Columns of `GraphBatch.corner_direction`.
CORNER_WIDTH = 5


@dataclass(frozen=True, eq=False)
class GraphBatch:
    """A `DelaunayGraph` and its `GraphFeatures` as tensors; -1 indices are replaced by what adds nothing.

    Attributes
    ----------
    nodes : (V, NODES.width) uint8
    links : (L, LINKS.width) float32
    triangles : (T, TRIANGLES.width) float32
    link_nodes : (2, L) int64
    link_direction : (L, 2) float32
        Unit vector from the first node to the second.
    corners : (T, 3) int64
        Nodes of each triangle.
    corner_direction : (T, 3, CORNER_WIDTH) float32
        Cosine and sine of a corner's angle at the centroid, of twice the angle, and the log of its distance.
    neighbours : (T, 3) int64
        Own index beyond the ghost points.
    triangle_links : (T, 3) int64
        L beyond the ghost points.
    link_triangles : (2, L) int64
    regions : tuple of (T,) int64
        Region of each triangle, per pooled scale.
    link_groups : tuple of (L,) int64
        Links between the same two regions, per pooled scale; the same two branches; the same two
        good-continuation groups.
    intensities : (T, len(BLURS)) float32
    extents : (T,) float32
        Weight of a triangle in its slice's mean intensity.
    slices : (T,) int64
    """

    nodes: Tensor
    links: Tensor
    triangles: Tensor
    link_nodes: Tensor
    link_direction: Tensor
    corners: Tensor
    corner_direction: Tensor
    neighbours: Tensor
    triangle_links: Tensor
    link_triangles: Tensor
    regions: tuple[Tensor, ...]
    link_groups: tuple[Tensor, ...]
    intensities: Tensor
    extents: Tensor
    slices: Tensor

    def to(self, device: torch.device | str) -> GraphBatch:
        """Move all tensors."""
        own: dict[str, Tensor | tuple[Tensor, ...]] = vars(self)
        moved: dict[str, Any] = {
            name: value.to(device) if isinstance(value, Tensor) else tuple(part.to(device) for part in value)
            for name, value in own.items()
        }
        return GraphBatch(**moved)


def make_batch(graph: DelaunayGraph, intensities: Sequence[IntensitySlice | None]) -> GraphBatch:
    """Measure a graph's features (one slice or many) and put all into tensors."""
    features = measure_features(graph, intensities)
    return GraphBatch(
        torch.as_tensor(features.nodes),
        _real(features.links),
        _real(features.triangles),
        _index(graph.links.T),
        _real(_link_directions(graph)),
        _index(graph.triangles),
        _real(_corner_directions(graph)),
        _index(_or_else(graph.neighbours, np.arange(len(graph.triangles))[:, None])),
        _index(_or_else(graph.triangle_links, len(graph.links))),
        _index(graph.link_triangles.T),
        tuple(_index(graph.regions[:, g]) for g in POOLED_SCALES),
        _link_groups(graph, features),
        _real(features.triangles[:, INTENSITIES]),
        _real(np.where(graph.outer, 0, graph.areas)),
        _index(owners_of(graph.triangle_offsets)),
    )


def _index(array: AnyArray) -> Tensor:
    return torch.as_tensor(np.ascontiguousarray(array, np.int64))


def _real(array: AnyArray) -> Tensor:
    return torch.as_tensor(np.ascontiguousarray(array, np.float32))


def _or_else(index: AnyArray, instead: AnyArray | int) -> AnyArray:
    return np.where(index >= 0, index, instead)


def _link_directions(graph: DelaunayGraph) -> AnyArray:
    first, second = graph.links.T
    step = graph.points[second] - graph.points[first]
    return step / np.linalg.norm(step, axis=1, keepdims=True)


def _corner_directions(graph: DelaunayGraph) -> AnyArray:
    corners = graph.points[graph.triangles]
    spoke = corners - corners.mean(axis=1, keepdims=True)
    reach = np.maximum(np.linalg.norm(spoke, axis=2), LEAST_PX)
    cosine, sine = spoke[..., 1] / reach, spoke[..., 0] / reach
    return np.stack([cosine, sine, cosine**2 - sine**2, 2 * cosine * sine, np.log(reach)], axis=2)


def _link_groups(graph: DelaunayGraph, features: GraphFeatures) -> tuple[Tensor, ...]:
    pairs = [graph.regions[graph.link_triangles, g] for g in POOLED_SCALES]
    pairs += [labels[graph.links] for labels in (features.branch, features.group)]
    return tuple(_index(_same_pair(pair.astype(np.int64))) for pair in pairs)


def _same_pair(pair: IntArray) -> IntArray:
    """Assign equal unordered pairs (L, 2) equal numbers (L,)."""
    low, high = np.minimum(*pair.T), np.maximum(*pair.T)
    return cast(Any, pd).factorize(low * (high.max() + 1) + high)[0]
