"""From boundary pixels to masks and closed curves, batched over slices."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cccd.boundary import outline
from cccd.chaincode import broken_links, isolated_corners, junction_pixels
from cccd.containers import Boundaries, Curves, Frame
from cccd.geometry.arrays import concatenate_ragged
from cccd.junctions.complexes import REGION_GAPS_PX, Complex, fragments, join_complexes
from cccd.junctions.cut import minimum_cut
from cccd.junctions.decoding import fill_inside
from cccd.junctions.features import measure
from cccd.junctions.network import JunctionNetwork, make_batch
from cccd.junctions.reading import read_map
from cccd.tracing import trace_stack

__all__ = [
    "AREA_POWER",
    "BORDER_COST",
    "curves_from_masks",
    "label_inside",
    "order_boundaries",
    "predict_masks",
    "prior_logits",
]

#: Slices that are read by the network at once: enough to share overheads, few enough to stay in the cache.
SLICES_PER_BATCH = 8

#: A loop smaller than this many pixels, or than this share of its slice's largest, is debris.
SMALLEST_LOOP_PX = 6.0
SMALLEST_LOOP_SHARE = 0.005

# Pixels of an outline's tips, which enclose nothing: where more are left, something else is.
_TIP_PX = 1

#: Cost of a pixel of border per nat of doubt about its link, against a triangle's logit times this power of
#: its area: chosen on the frozen validation graphs.
BORDER_COST = 1.0
AREA_POWER = 0.75

# Without a network: cells walled in by links up to this long are inside, and longer links cost more.
_PLAIN_SCALE = 2


def prior_logits(graph: Complex) -> tuple[np.ndarray, np.ndarray]:
    """Give what the decoder assumes without a network.

    Inside is what walls of 8-neighbours and gaps up to 6 pixels enclose; short links are likely true. Of
    triangles that have no longer side themselves, as between the steps of a staircase, it says nothing.
    """
    wall = REGION_GAPS_PX[_PLAIN_SCALE]
    length = np.append(graph.link_lengths, np.inf)  # for the sides that have no link
    open_inside = length[graph.side_links].max(axis=1) > wall
    enclosed = graph.depths[:, _PLAIN_SCALE] > 0
    return np.where(enclosed, 2.0, -2.0) * open_inside, 2.0 - graph.link_lengths


def cut_inside(graph: Complex, inside_logit: np.ndarray, link_logit: np.ndarray) -> np.ndarray:
    """Inside triangles (T,) bool: the minimum cut of what the network says of triangles and links.

    A triangle's say grows with its extent, a link's cost with its length; the ring is outside.
    """
    gain = inside_logit * graph.areas**AREA_POWER
    gain[graph.outer] = -1e9
    cost = BORDER_COST * graph.link_lengths * np.logaddexp(0, -link_logit)
    return minimum_cut(gain, cost, graph.neighbours, graph.side_links, graph.triangle_offsets)


def label_inside(graph: Complex, inside_logit: np.ndarray, link_logit: np.ndarray) -> np.ndarray:
    """`cut_inside`, but maps that are outlines already are taken as they are.

    So are closed curves in a map where the cut finds nothing.
    """
    inside = cut_inside(graph, inside_logit, link_logit)
    enclosed, exact = _outlines(graph)
    plain = exact | ~np.logical_or.reduceat(inside, graph.triangle_offsets[:-1])
    return np.where(np.repeat(plain, np.diff(graph.triangle_offsets)), enclosed, inside)


def _outlines(graph: Complex) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (T,) that 8-neighbours enclose, and slices (S,) whose map is just the outline of these.

    Fragments as small as debris are left out, and an outline may end in a tip one pixel wide.
    """
    fragment = fragments(graph)
    debris = graph.drawn & (np.bincount(fragment)[fragment] < SMALLEST_LOOP_PX)
    enclosed = (graph.depths[:, 0] % 2 == 1) & ~debris[graph.triangles].any(axis=1)
    masks, origin = fill_inside(graph, enclosed)
    drawn = np.zeros_like(masks)
    slices = np.repeat(np.arange(len(masks)), np.diff(graph.node_offsets))
    kept = graph.drawn & ~debris
    i, j = (graph.points[kept].astype(np.int64) - origin).T
    drawn[slices[kept], i, j] = True
    around = outline(masks)
    left = (drawn & ~around).sum(axis=(1, 2))
    return enclosed, masks.any(axis=(1, 2)) & (around <= drawn).all(axis=(1, 2)) & (left <= _TIP_PX)


def predict_masks(
    pixels: Sequence[np.ndarray], model: JunctionNetwork | None, greys: Sequence[np.ndarray | None]
) -> tuple[np.ndarray, np.ndarray]:
    """Label each slice's enclosed pixels; the network is asked only where a map is not an outline already.

    Parameters
    ----------
    pixels : sequence of (N, 2) int arrays
        Boundary pixels of each slice; none may be empty.
    model : JunctionNetwork or None
        ``None``: the decoder alone.
    greys : sequence of (I, J) arrays or None
        Grey slice of each, in the pixels' coordinates.

    Returns
    -------
    masks : (S, I, J) bool array
    origin : (2,) int64 array
        Pixel of ``masks[:, 0, 0]``.
    """
    shown = [None] * len(pixels) if model is None else greys
    graphs: list[Complex] = []
    inside: list[np.ndarray] = []
    for begin in range(0, len(pixels), SLICES_PER_BATCH):
        batch = slice(begin, begin + SLICES_PER_BATCH)
        built, seen = zip(*map(read_map, pixels[batch], shown[batch]), strict=True)
        graph = join_complexes(built)
        enclosed, exact = _outlines(graph)
        cells = np.split(enclosed, graph.triangle_offsets[1:-1])
        doubtful = np.flatnonzero(~exact)
        if len(doubtful):
            graph = join_complexes([built[n] for n in doubtful])
            if model is None:
                logits = prior_logits(graph)
            else:
                logits = model.predict(make_batch(graph, measure(graph, [seen[n] for n in doubtful])))
            cut = np.split(cut_inside(graph, *logits), graph.triangle_offsets[1:-1])
            for n, within in zip(doubtful, cut, strict=True):
                if within.any():  # else closed curves stay
                    cells[n] = within
        graphs += built
        inside += cells
    return fill_inside(join_complexes(graphs), np.concatenate(inside))


def curves_from_masks(masks: np.ndarray, origin: Sequence[int], frame: Frame) -> Curves:
    """Strictly simple closed pixel chains around masks (S, I, J), without debris.

    ``origin`` is the source index (k, i, j) of the stack's first voxel.
    """
    curves = trace_stack(masks, origin, frame)
    if not len(curves):
        return curves
    area = np.abs(curves.polygons.signed_areas)
    slices, member = np.unique(curves.slice, return_inverse=True)
    largest = np.zeros(len(slices))
    np.maximum.at(largest, member, area)
    kept = area >= np.maximum(SMALLEST_LOOP_PX, SMALLEST_LOOP_SHARE * largest[member])
    loops = np.split(curves.points, curves.offsets[1:-1])
    points, offsets = concatenate_ragged([loop for loop, keep in zip(loops, kept, strict=True) if keep])
    return Curves(points, offsets, curves.slice[kept], curves.hole[kept], frame)


def order_boundaries(
    boundaries: Boundaries,
    model: JunctionNetwork | None,
    image: np.ndarray | None = None,
    image_origin: Sequence[int] = (0, 0, 0),
) -> tuple[Curves, dict]:
    """Order every slice's boundary pixels into closed, strictly simple 8-connected pixel chains.

    Parameters
    ----------
    boundaries : Boundaries
    model : JunctionNetwork or None
        From `load_model`; ``None`` lets the decoder decide by walls and gaps alone.
    image : (S, I, J) array, optional
        Grey slices, used where given.
    image_origin : (3,) int
        Source index (k, i, j) of the image's first voxel.

    Returns
    -------
    curves : Curves
    report : dict
        Plain JSON. ``slices``: per slice its number ``k``, ``pixels``, ``junctions``, ``isolated_before``
        and ``isolated_after`` (Figure 4, in the map and in the ordered chains), ``outer`` and ``holes``;
        ``unclosed``: the numbers of slices that have no closed boundary; and the totals.
    """
    origin = np.asarray(image_origin)
    counts = np.diff(boundaries.offsets)
    filled = np.flatnonzero(counts > 0)
    chains = list(boundaries)
    pixels, greys = [], []
    for s in filled:
        pixels.append(chains[s] - origin[1:] if image is not None else chains[s])
        layer = int(boundaries.slice[s] - origin[0])
        seen = image is not None and 0 <= layer < len(image)
        greys.append(image[layer] if seen else None)
    if len(filled):
        masks, corner = predict_masks(pixels, model, greys)
        if image is not None:
            corner = corner + origin[1:]
        curves = curves_from_masks(masks, (0, *corner), boundaries.frame)
        curves.slice[:] = boundaries.slice[filled[curves.slice]]
    else:
        points, offsets = concatenate_ragged([])
        curves = Curves(points, offsets, np.zeros(0, np.int32), np.zeros(0, bool), boundaries.frame)
    return curves, _report(boundaries, curves)


def _report(boundaries: Boundaries, curves: Curves) -> dict:
    count = len(boundaries.slice)
    per_slice = {
        "pixels": np.diff(boundaries.offsets),
        "junctions": _per_slice(junction_pixels(boundaries), boundaries.offsets),
        "isolated_before": _per_slice(isolated_corners(boundaries), boundaries.offsets),
    }
    of = np.searchsorted(boundaries.slice, curves.slice)
    broken = np.repeat(of, np.diff(curves.offsets))[broken_links(curves.points, curves.offsets)]
    per_slice["isolated_after"] = np.bincount(broken, minlength=count)
    per_slice["outer"] = np.bincount(of[~curves.hole], minlength=count)
    per_slice["holes"] = np.bincount(of[curves.hole], minlength=count)
    rows = [
        {"k": int(k), **{name: int(values[n]) for name, values in per_slice.items()}}
        for n, k in enumerate(boundaries.slice)
    ]
    unclosed = boundaries.slice[per_slice["outer"] == 0]
    totals = {name: int(values.sum()) for name, values in per_slice.items()}
    return {"slices": rows, "unclosed": [int(k) for k in unclosed], **totals}


def _per_slice(flags: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    total = np.concatenate([[0], np.cumsum(flags)])
    return total[offsets[1:]] - total[offsets[:-1]]
