"""The frozen graphs, drawn once and kept in ``graphs.h5``: training, validation and test."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import cast

import numpy as np

from cccd.geometry.arrays import (
    ByteArray,
    IntArray,
    SingleArray,
    concatenate_ragged,
    offsets_of,
    split_ragged,
)
from cccd.tolerances import ROUNDING
from cccd_junctions.delaunay import build_graph
from cccd_networks.graphs import GraphSplit, read_graphs, write_graphs
from cccd_networks.settings import GraphSettings
from cccd_training.junctions.labels import inside_shares, link_labels
from cccd_training.junctions.synthetic_maps import (
    ALL_KINDS,
    KIND_WEIGHTS,
    RandomStream,
    SyntheticMap,
    draw_large_map,
    draw_map,
)

logger = logging.getLogger(__name__)

SPLITS = ("training", "validation", "test")

#: Graphs and nodes of each that took 6.4 GB as dense matrices (sections 4.3 and 8).
PAPER_GRAPHS, PAPER_NODES = 209, 1917

# How many of that size are drawn to tell what they take.
_PAPER_SHOWN = 4


def generate_graphs(settings: GraphSettings, seed: int, path: str | Path) -> None:
    """Draw the frozen training, validation and test graphs and write ``graphs.h5``.

    Parameters
    ----------
    settings : GraphSettings
        How many of each split.
    seed : int
    path : path
    """
    counts = {"training": settings.training, "validation": settings.validation, "test": settings.test}
    maps = {split: _draw_split(counts[split], seed, n) for n, split in enumerate(SPLITS)}
    splits = {split: pack_graphs(drawn) for split, drawn in maps.items()}
    nodes = [len(drawn.pixels) for split in maps.values() for drawn in split]
    streams = [np.random.default_rng([seed, RandomStream.LARGE_MAPS, n]) for n in range(_PAPER_SHOWN)]
    large = pack_graphs([draw_large_map(rng, PAPER_NODES) for rng in streams])
    attributes: dict[str, int | str] = {
        "seed": seed,
        "kinds": ",".join(ALL_KINDS),
        "bytes": sum(split.graph_bytes for split in splits.values()),
        "bytes_images": sum(split.image_values.nbytes for split in splits.values()),
        "bytes_dense": sum(map(_dense_bytes, nodes)),
        "bytes_paper": PAPER_GRAPHS * large.graph_bytes // _PAPER_SHOWN,
        "bytes_paper_dense": PAPER_GRAPHS * _dense_bytes(PAPER_NODES),
    }
    write_graphs(path, splits, attributes)
    logger.info("graphs: %s; %d bytes on disk", attributes, Path(path).stat().st_size)


def _draw_split(count: int, seed: int, number: int) -> list[SyntheticMap]:
    """Draw maps of kinds in the proportions of their weights, the same for every split."""
    bounds = np.cumsum(np.array([KIND_WEIGHTS[kind] for kind in ALL_KINDS], float))
    places = (np.arange(count) + 0.5) / max(count, 1) * bounds[-1]
    kinds = [ALL_KINDS[int(kind)] for kind in cast(IntArray, np.searchsorted(bounds, places))]
    streams = [np.random.default_rng([seed, RandomStream.FROZEN_MAPS, number, n]) for n in range(count)]
    return [draw_map(rng, kind) for rng, kind in zip(streams, kinds, strict=True)]


def _dense_bytes(nodes: int) -> int:
    """Two dense float32 matrices of a graph, adjacency and labels, as section 4.3 keeps them."""
    return 2 * 4 * nodes**2


def _quantised(image: SingleArray | None) -> ByteArray:
    """Grey values (n,) in 256 steps; none of a missing image."""
    if image is None:
        return np.zeros(0, np.uint8)
    low, high = float(image.min()), float(image.max())
    return np.rint((image - low) * (255 / max(high - low, ROUNDING))).astype(np.uint8).ravel()


def pack_graphs(maps: Sequence[SyntheticMap]) -> GraphSplit:
    """Ragged columns of a split's graphs, labels, true contours and images."""
    graphs = [build_graph(drawn.pixels) for drawn in maps]
    shares = [inside_shares(graph, drawn.contours) for graph, drawn in zip(graphs, maps, strict=True)]
    labels = [np.where(link_labels(g, y), 1, -1) for g, y in zip(graphs, shares, strict=True)]
    pixels, pixel_offsets = concatenate_ragged([drawn.pixels for drawn in maps])
    contours, contour_offsets = concatenate_ragged([c for drawn in maps for c in drawn.contours])
    images = [_quantised(drawn.image) for drawn in maps]
    links, link_offsets = concatenate_ragged([graph.links for graph in graphs])
    return GraphSplit(
        pixels=pixels.astype(np.int16),
        pixel_offsets=pixel_offsets,
        links=links.astype(np.int16),
        link_labels=np.concatenate(labels).astype(np.int8),
        link_offsets=link_offsets,
        inside_shares=np.rint(255 * np.concatenate(shares)).astype(np.uint8),
        triangle_offsets=offsets_of([len(share) for share in shares]),
        contours=contours.astype(np.int16),
        contour_offsets=contour_offsets,
        contour_graph=np.repeat(np.arange(len(maps)), [len(drawn.contours) for drawn in maps]),
        image_values=np.concatenate(images),
        image_offsets=offsets_of([image.size for image in images]),
        shape=np.array([drawn.shape for drawn in maps], np.int32),
        kind=np.array([ALL_KINDS.index(drawn.kind) for drawn in maps], np.uint8),
    )


def read_maps(path: str | Path, split: str) -> list[SyntheticMap]:
    """Boundary maps of a frozen split (``training``, ``validation`` or ``test``) with their truth."""
    kept = read_graphs(path, split)
    pixels = split_ragged(kept.pixels.astype(np.int32), kept.pixel_offsets)
    images = split_ragged(kept.image_values, kept.image_offsets)
    contours = split_ragged(kept.contours.astype(np.int32), kept.contour_offsets)
    return [
        SyntheticMap(
            pixels[n],
            [contours[c] for c in np.flatnonzero(kept.contour_graph == n)],
            ALL_KINDS[int(kept.kind[n])],
            (int(rows), int(columns)),
            images[n].reshape(rows, columns).astype(np.float32) if images[n].size else None,
        )
        for n, (rows, columns) in enumerate(kept.shape)
    ]
