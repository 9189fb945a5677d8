"""The forward path: from boundary maps to what they enclose, batched over slices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray, IntArray, RealArray
from cccd_junctions.decoding import border_loops, fill_loops, find_outline
from cccd_junctions.delaunay import REGION_GAPS_PX, DelaunayGraph
from cccd_junctions.energy import Logits
from cccd_junctions.labelling import Labelled
from cccd_junctions.observation import ObservedSlice, observe
from cccd_junctions.stacks import ReadSlice, label_slices, region_evidence, without_lone_parts

#: Slices that a network reads at once. Of 1 to 24 the fastest: they share overheads, and memory is not asked
#: for again each time.
SLICES_PER_BATCH = 4

# The prior: triangles walled in by links up to this of `REGION_GAPS_PX` are inside; longer links cost more.
_PRIOR_SCALE = 2


class Predictor(Protocol):
    """What tells inside from outside and true links from others: a network, or the prior."""

    def logits(self, slices: Sequence[ObservedSlice]) -> list[Logits]:
        """Logits of every slice: that its triangles (T,) are inside and that its links (L,) are true."""
        ...


@runtime_checkable
class LoopPredictor(Protocol):
    """What orders a map's pixels by itself: another package's network (`cccd.plugins`)."""

    def find_loops(self, maps: Sequence[AnyArray]) -> list[list[IntArray]]:
        """Find closed loops (n, 2) of pixels in every map (N, 2)."""
        ...


class Prior:
    """What is assumed without a network."""

    def logits(self, slices: Sequence[ObservedSlice]) -> list[Logits]:
        """Say inside of what walls of 8-neighbours and gaps up to 6 pixels enclose, true of short links.

        Of triangles that have no longer side themselves, as between the steps of a staircase, it says
        nothing.
        """
        return [self._logits(observed.graph) for observed in slices]

    def _logits(self, graph: DelaunayGraph) -> Logits:
        length = np.append(graph.link_lengths, np.inf)  # for the sides that have no link
        open_inside = length[graph.triangle_links].max(axis=1) > REGION_GAPS_PX[_PRIOR_SCALE]
        enclosed = graph.depths[:, _PRIOR_SCALE] > 0
        return np.where(enclosed, 2.0, -2.0) * open_inside, 2.0 - graph.link_lengths


#: The decoder alone.
PRIOR = Prior()


def read_slices(
    maps: Sequence[AnyArray], images: Sequence[RealArray | None], predictor: Predictor
) -> list[ReadSlice]:
    """Read maps (N, 2) and their grey slices batch by batch; outlines need no predictor."""
    read: list[ReadSlice] = []
    for begin in range(0, len(maps), SLICES_PER_BATCH):
        batch = slice(begin, begin + SLICES_PER_BATCH)
        slices = [observe(*both) for both in zip(maps[batch], images[batch], strict=True)]
        outlines = [find_outline(observed.graph) for observed in slices]
        doubtful = [observed for observed, outline in zip(slices, outlines, strict=True) if not outline.exact]
        logits = iter(predictor.logits(doubtful) if doubtful else [])
        read += [
            ReadSlice(observed.graph, outline, None if outline.exact else next(logits))
            for observed, outline in zip(slices, outlines, strict=True)
        ]
    return read


@dataclass(frozen=True, eq=False)
class Prediction:
    """What slices enclose.

    Attributes
    ----------
    masks : (S, I, J) bool array
    origin : (2,) int64 array
        Pixel of ``masks[:, 0, 0]``.
    uncertainty : (S,) array or None
        Probability that a slice's curves are wrong, where our network was asked and alternatives were
        weighed.
    """

    masks: BoolArray
    origin: IntArray
    uncertainty: FloatArray | None


def predict_slices(
    maps: Sequence[AnyArray],
    predictor: Predictor | LoopPredictor | None,
    images: Sequence[RealArray | None],
    numbers: AnyArray,
    parts: int | None = None,
    regions: Sequence[BoolArray | None] | None = None,
    pixel_mm: float = 1.0,
) -> Prediction:
    """Fill what each slice's boundary map encloses.

    Parameters
    ----------
    maps : sequence of (N, 2) int arrays
        Boundary pixels of each slice; none may be empty.
    predictor : Predictor, LoopPredictor or None
        ``None``: the decoder alone, by its prior; it looks at no image. A `LoopPredictor` looks at
        none either, and its loops are taken as they are.
    images : sequence of (I, J) arrays or None
        Grey slice of each, in the pixels' coordinates.
    numbers : (S,) int array
        Ascending numbers of the slices; consecutive ones are neighbours (`cccd_junctions.stacks`).
    parts : int, optional
        Pieces of the organ on a slice at most, none of which has a hole.
    regions : sequence of (I, J) bool arrays or None, optional
        Where the organ roughly is, of each slice, in the pixels' coordinates: evidence beside the network's.
    pixel_mm : float
        Size of a pixel, by which the evidence of regions fades with the distance from their border.
    """
    if isinstance(predictor, LoopPredictor):
        return Prediction(*_filled(predictor.find_loops(maps)), None)
    read, labelled = _read_and_labelled(maps, predictor, images, numbers, parts, regions, pixel_mm)
    known = [one.uncertainty for one in labelled if one.uncertainty is not None]
    uncertainty = np.array(known) if predictor is not None and len(known) == len(labelled) else None
    masks, origin = _filled(_border_loops(read, labelled))
    if regions is not None and predictor is not None:
        masks = without_lone_parts(masks, origin, regions, numbers, pixel_mm)
    return Prediction(masks, origin, uncertainty)


def predict_masks(
    maps: Sequence[AnyArray], predictor: Predictor | LoopPredictor | None, images: Sequence[RealArray | None]
) -> tuple[BoolArray, IntArray]:
    """Masks and their origin, as from `predict_slices`, of maps that are no neighbours."""
    if isinstance(predictor, LoopPredictor):
        return _filled(predictor.find_loops(maps))
    apart = 2 * np.arange(len(maps))
    return _filled(_border_loops(*_read_and_labelled(maps, predictor, images, apart)))


def _read_and_labelled(
    maps: Sequence[AnyArray],
    predictor: Predictor | None,
    images: Sequence[RealArray | None],
    numbers: AnyArray,
    parts: int | None = None,
    regions: Sequence[BoolArray | None] | None = None,
    pixel_mm: float = 1.0,
) -> tuple[list[ReadSlice], list[Labelled]]:
    """Read slices, and label the triangles of each, its neighbours considered.

    What the prior says is taken as the cut has it: alternatives are scored by a network's logits.
    """
    shown = [None] * len(maps) if predictor is None else images
    read = read_slices(maps, shown, predictor or PRIOR)
    if regions is not None and predictor is not None:
        read = [
            one if region is None else replace(one, evidence=region_evidence(one.graph, region, pixel_mm))
            for one, region in zip(read, regions, strict=True)
        ]
    return read, label_slices(read, numbers, parts, rerank=predictor is not None)


def _border_loops(read: Sequence[ReadSlice], labelled: Sequence[Labelled]) -> list[list[IntArray]]:
    return [border_loops(one.graph, found.inside) for one, found in zip(read, labelled, strict=True)]


def _filled(loops: Sequence[Sequence[IntArray]]) -> tuple[BoolArray, IntArray]:
    """Fill every slice's loops on one raster, just large enough; its origin."""
    corners = np.concatenate([np.zeros((0, 2), np.int64), *(loop for around in loops for loop in around)])
    if not len(corners):
        return np.zeros((len(loops), 1, 1), bool), np.zeros(2, np.int64)
    origin = corners.min(axis=0) - 1
    return fill_loops(loops, origin, corners.max(axis=0) + 2 - origin), origin
