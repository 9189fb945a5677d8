"""The other reading of the paper's graphs (section 4.3): nodes are corners, not pixels.

"The proposed model uses corners only (Figure 7a), while to train the GNN, random corner edges are generated
(Figure 7b) ... 1917 different corner points are identified and an adjacency matrix of 1917 x 1917 is
registered for every graph." Read so, the corner points of a whole data set have one numbering, and every
graph has all of them as nodes: true links run along the outlines of its slice, from corner to corner, random
ones are added, and the network says which are true. How many are added is not printed: here as many as there
are true ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from torch_geometric.data import Data

from cccd.containers import Curves
from cccd.curves.corners import k_cosine_corners
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, SingleArray
from cccd_paper.junctions.grid import keep_two
from cccd_paper.junctions.network import link_data

# A ring of fewer corners encloses nothing.
_FEWEST = 3


@dataclass(frozen=True, eq=False)
class CornerGraph:
    """Corners of one slice among those of the data set, and links between them.

    Attributes
    ----------
    present : (N,) bool
        Which of the data set's corner points are the slice's.
    links : (L, 2) int64
        Pairs of them, each once: true ones first, then random ones.
    true : (L,) bool
        Which links run along an outline.
    """

    present: BoolArray
    links: IntArray
    true: BoolArray


def number_corners(curves: Curves, k: int) -> tuple[FloatArray, list[list[IntArray]]]:
    """Give numbers to the different corner points of all curves, by Definition 3 at ``k``.

    Returns
    -------
    points : (N, 2)
        In source (i, j); a pixel that is a corner on several slices counts once.
    rings : list of list of (n,) int64
        By slice, the numbers along each of its curves.
    """
    corner = k_cosine_corners(curves.points, curves.offsets, k)
    points, number = np.unique(curves.points[corner], axis=0, return_inverse=True)
    curve = np.repeat(np.arange(len(curves)), np.diff(curves.offsets))[corner]
    along = [number[curve == c].astype(np.int64) for c in range(len(curves))]
    slices = [
        [along[c] for c in np.flatnonzero(curves.slice == k) if len(along[c]) >= _FEWEST]
        for k in np.unique(curves.slice)
    ]
    return points, [rings for rings in slices if rings]


def draw_graph(rings: Sequence[IntArray], count: int, rng: np.random.Generator) -> CornerGraph:
    """Link a slice's corners along its outlines, and add as many random links.

    Parameters
    ----------
    rings : sequence of (n,) int64
        Numbers of the corners along each curve.
    count : int
        Corner points of the data set, N.
    rng : Generator
    """
    present = np.zeros(count, bool)
    present[np.concatenate(rings)] = True
    true = np.unique(
        np.sort(np.concatenate([np.column_stack([ring, np.roll(ring, -1)]) for ring in rings])), axis=0
    )
    pairs = np.column_stack(np.triu_indices(int(present.sum()), 1))
    others = np.flatnonzero(present)[pairs]
    others = others[~np.isin(others @ (count, 1), true @ (count, 1))]
    random = others[rng.choice(len(others), min(len(true), len(others)), replace=False)]
    links = np.concatenate([true, random])
    return CornerGraph(present, links, np.arange(len(links)) < len(true))


def draw_splits(
    slices: Sequence[Sequence[IntArray]], count: int, graphs: Mapping[str, int], seed: int
) -> dict[str, list[CornerGraph]]:
    """Draw so many graphs of every split; no two splits share a slice.

    Parameters
    ----------
    slices : sequence of rings
        From `number_corners`. A slice serves several graphs, each with random links of its own.
    count : int
        Corner points of the data set.
    graphs : mapping of split to number
    seed : int
    """
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(slices))
    ends = np.rint(np.cumsum(list(graphs.values())) / sum(graphs.values()) * len(slices)).astype(int)
    shares: list[list[int]] = [share.tolist() for share in np.split(order, ends[:-1])]
    return {
        split: [draw_graph(slices[share[n % len(share)]], count, rng) for n in range(number)]
        for (split, number), share in zip(graphs.items(), shares, strict=True)
    }


def corner_data(graph: CornerGraph, points: FloatArray | None) -> Data:
    """Make a graph for PyTorch Geometric: +1 at the slice's corners and -1 at the others, as printed.

    With ``points`` (N, 2) nodes also have their places, which the paper does not mention: all places of the
    data set within [-1, 1].
    """
    features = np.where(graph.present, 1.0, -1.0)[:, None]
    if points is not None:
        low, high = points.min(axis=0), points.max(axis=0)
        features = np.column_stack([features, 2 * (points - low) / (high - low) - 1])
    return link_data(features, graph.links, graph.links)


def is_right(graph: CornerGraph, scores: FloatArray) -> bool:
    """Say whether at most two links per corner, best first, leave the outlines and nothing else."""
    return bool(np.array_equal(keep_two(graph.links, scores, len(graph.present)), graph.true))


def dense_matrices(graph: CornerGraph) -> tuple[SingleArray, SingleArray]:
    """Adjacency of all links and of the true ones, (N, N) float32 each: what the paper keeps per graph."""
    count = len(graph.present)
    both: list[SingleArray] = []
    for links in (graph.links, graph.links[graph.true]):
        matrix: SingleArray = np.zeros((count, count), np.float32)
        matrix[tuple(links.T)] = matrix[tuple(links[:, ::-1].T)] = 1
        both.append(matrix)
    return both[0], both[1]
