"""When an ordered slice counts as correct."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from cccd.containers import Frame
from cccd.geometry.arrays import AnyArray, BoolArray, ByteArray, FloatArray, IntArray
from cccd.geometry.opencv import borders_of
from cccd.geometry.polygons import RaggedPolygons
from cccd.geometry.raster import dice
from cccd_junctions.decoding import closed_chains, fill_inside
from cccd_junctions.delaunay import DelaunayGraph
from cccd_training.junctions.labels import fill_contours

#: A slice is correct when its curves agree with the true ones at least so well.
CORRECT_DICE = 0.98
CORRECT_HAUSDORFF_PX = 5.0

_FLAT = Frame(np.eye(4), 2, (1, 1, 1))


@dataclass(frozen=True)
class SliceScore:
    """Agreement of a slice's curves with the truth; lengths in pixels."""

    correct: bool
    dice: float
    hausdorff: float
    outer: int
    holes: int


def _draw(chains: Sequence[AnyArray], low: AnyArray, shape: AnyArray) -> ByteArray:
    canvas = np.zeros(shape, np.uint8)
    cv2.polylines(canvas, [(chain - low)[:, ::-1].astype(np.int32) for chain in chains], True, 1)
    return canvas


def hausdorff(chains: Sequence[AnyArray], others: Sequence[AnyArray]) -> float:
    """Hausdorff distance of two sets of closed pixel chains; infinite when one is empty."""
    if not len(chains) or not len(others):
        return float("inf")
    points = np.concatenate([*chains, *others])
    low = np.floor(points.min(axis=0)).astype(np.int64)
    shape = np.ceil(points.max(axis=0)).astype(np.int64) - low + 1
    drawn = [_draw(part, low, shape) for part in (chains, others)]
    away = [cv2.distanceTransform(1 - canvas, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) for canvas in drawn]
    return float(max(away[0][drawn[1] > 0].max(), away[1][drawn[0] > 0].max()))


def score_slice(chains: Sequence[AnyArray], truth: Sequence[AnyArray]) -> SliceScore:
    """Score a slice's closed chains, each (n, 2), against the true ones.

    Correct: as many outer curves and holes as in truth (one per component), Dice at least
    `CORRECT_DICE`, Hausdorff distance at most `CORRECT_HAUSDORFF_PX`. Outer curves are those of positive
    area when chains come from `Curves`; truth may come in either orientation.
    """
    everything = [*chains, *truth]
    low = np.floor(np.concatenate(everything).min(axis=0)).astype(np.int64)
    shape = np.ceil(np.concatenate(everything).max(axis=0)).astype(np.int64) - low + 1
    drawn, true = (fill_contours([c - low for c in part], shape) > 0 for part in (chains, truth))
    area = RaggedPolygons.of([np.asarray(chain, float) for chain in chains]).signed_areas
    parts, holes = _counts(drawn)
    true_parts, true_holes = _counts(true)
    overlap = float(dice(true, drawn)) if len(chains) else 0.0
    distance = hausdorff(chains, truth)
    one_each = (parts, holes) == (true_parts, true_holes) and len(area) == parts + holes
    correct = one_each and overlap >= CORRECT_DICE and distance <= CORRECT_HAUSDORFF_PX
    return SliceScore(bool(correct), overlap, distance, int((area > 0).sum()), int((area < 0).sum()))


def score_labels(
    graph: DelaunayGraph, inside: BoolArray, truth: Sequence[AnyArray], parts: int | None = None
) -> SliceScore:
    """Score the closed chains around a slice's inside triangles (T,) as `score_slice` does; so many parts."""
    (mask,), origin = fill_inside(graph, inside)
    return score_slice(chains_around(mask, origin, parts), truth)


def chains_around(mask: BoolArray, origin: IntArray, parts: int | None = None) -> list[FloatArray]:
    """Find the closed chains (n, 2) around what a slice encloses (I, J), from pixel ``origin`` on."""
    return list(closed_chains(mask[None], origin, np.zeros(1, np.int64), _FLAT, parts))


def _counts(mask: BoolArray) -> tuple[int, int]:
    """Components (8-connected) and holes (4-connected) of a mask."""
    hole = borders_of(mask)[1]
    return int(np.count_nonzero(~hole)), int(np.count_nonzero(hole))
