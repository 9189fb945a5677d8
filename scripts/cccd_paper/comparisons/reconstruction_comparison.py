"""Curve reconstruction from points on one structure: Tables 4 and 5, Figure 16."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from cccd.containers import Boundaries, Curves, Frame, Structure
from cccd.geometry.arrays import offsets_of, successors
from cccd.geometry.raster import dice
from cccd_paper.comparisons.baselines.corner_detectors import CORNER_DETECTORS
from cccd_paper.comparisons.baselines.reconstructions import RECONSTRUCTIONS, reconstruct
from cccd_paper.comparisons.links import count_links, enclosed_region, unique_links
from cccd_paper.comparisons.orderers import Orderer
from cccd_paper.comparisons.paper_k import CCCD
from cccd_paper.comparisons.parameters import PAPER_TABLE_2
from cccd_paper.comparisons.samples import SliceSample, choose_slices, middle_slice
from cccd_paper.comparisons.timing import timed
from cccd_paper.settings import SliceChoice
from cccd_viewers.page_files import Panel, SliceFigure

#: The point sets by the names that tables and figures show.
DENSE, HARRIS = "dense boundary", "Harris corners on the boundary"
JITTERED = "every {every}th pixel with jitter"

#: What a method sees, by the names that tables and remarks show: the points alone; the points and their
#: places in the true chain code; the points and the boundary's pixels, whose order it has to find.
POINTS, GIVEN_ORDER, ALONG_PIXELS = "points", "points and chain code", "points and boundary pixels"

# The sparse point set: a quarter of the pixels, moved off the pixel grid by noise of this standard deviation.
_EVERY, _JITTER_PX = 4, 0.3

# Times are medians of so many runs: one may be disturbed.
_REPEATS = 3

#: Methods of the paper's Figure 16, then the strongest of the others.
FIGURE_16 = ("connect2d", "crawl", "nn_crust", "tour")

#: What the figure writes over CCCD's panels.
_PANELS = {
    GIVEN_ORDER: "CCCD, order given",
    POINTS: "CCCD, order of points found",
    ALONG_PIXELS: "CCCD, order of pixels found",
}

#: Returns links (M, 2) between points.
Run = Callable[[], np.ndarray]


def compare_reconstruction(
    structure: Structure, curves: Curves, settings: SliceChoice, seed: int, orderers: Sequence[Orderer] = ()
) -> pd.DataFrame:
    """Link three point sets per slice by every registered method, and by CCCD.

    Parameters
    ----------
    structure : Structure
    curves : Curves
        The ordered curves, taken as the truth.
    settings : SliceChoice
    seed : int
        Of the jitter.
    orderers : sequence of Orderer
        From `cccd_paper.comparisons.orderers.load_orderers`: with each CCCD finds an order itself. A run
        without a network has none, and no such rows.

    Returns
    -------
    DataFrame
        One row per slice, point set and method: ``points``, ``n_points``, ``connected``,
        ``disconnected``, ``open_ends``, ``junctions``, ``left_out``, ``closed`` (see
        `cccd_paper.comparisons.links.LinkCounts`), ``dice`` of what the links enclose, ``ms`` of processor
        time (median of three runs), and ``given``: what the method saw.

    Notes
    -----
    The other methods see the points alone. CCCD has up to three rows, which ``given`` tells apart: linked
    along the true chain code, which orders them; linked along what it finds of the boundary's pixels
    (`cccd_junctions.ordering.order_boundaries`), as the boundary is never thrown away; and, like the others,
    ordered from the points alone, as if they were a boundary map.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for sample in choose_slices(structure, curves, settings.n_slices):
        labels = {"case": structure.case, "organ": structure.organ, "slice": sample.k}
        for name, points in point_sets(sample, rng).items():
            runs: list[tuple[str, str, Run]] = [
                (method.title, POINTS, partial(reconstruct, key, points))
                for key, method in RECONSTRUCTIONS.items()
            ]
            runs += [(CCCD, *run) for run in _cccd_runs(sample, name, points, orderers, curves.frame)]
            for method, given, run in runs:
                links, ms = _timed(run)
                counts = count_links(links, len(points))
                region = enclosed_region(points, links, sample.origin, sample.region.shape)
                score = float(dice(sample.region, region))
                row = {"points": name, "n_points": len(points), "method": method, "given": given}
                rows.append(labels | row | vars(counts) | {"dice": score, "ms": ms})
    return pd.DataFrame(rows)


def reconstruction_figures(
    structure: Structure, curves: Curves, settings: SliceChoice, seed: int, orderers: Sequence[Orderer] = ()
) -> dict[str, SliceFigure]:
    """Figure 16: what reconstruction makes of Harris corners: ground truth, the paper's three, a tour, CCCD.

    CCCD with the order given, and with the order found where there is a network. Parameters as in
    `compare_reconstruction`; nothing where there is no curve, or where the middle slice has fewer than three
    Harris corners.
    """
    sample = middle_slice(structure, curves, settings.n_slices)
    if sample is None:
        return {}
    sets = point_sets(sample, np.random.default_rng(seed))
    if HARRIS not in sets:
        return {}
    points = sets[HARRIS]
    linked = {RECONSTRUCTIONS[key].title: reconstruct(key, points) for key in FIGURE_16}
    for given, run in _cccd_runs(sample, HARRIS, points, orderers[:1], curves.frame):
        linked[_PANELS[given]] = run()
    panels = [Panel("Ground truth", {"boundary": sample.curve})]
    panels += [_link_panel(title, points, links) for title, links in linked.items()]
    window = np.array([np.floor(sample.curve.min(0)) - 4, np.ceil(sample.curve.max(0)) + 4], np.int64)
    return {"figure16": SliceFigure(panels, 3, window)}


def _link_panel(title: str, points: np.ndarray, links: np.ndarray) -> Panel:
    counts = count_links(links, len(points))
    gaps = "closed" if counts.closed else f"{counts.open_ends} open ends, {counts.junctions} junctions"
    layers = {"links": points[links], "corners": points}
    return Panel(title, layers, f"{counts.connected} connected, {gaps}")


def point_sets(sample: SliceSample, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Point sets (N, 2) of a slice's longest curve, unordered (raster order).

    The dense boundary pixels; the Harris corners (the paper's Table 2 parameters, on the organ's mask)
    that are boundary pixels; every fourth pixel, moved by Gaussian noise.
    """
    harris = CORNER_DETECTORS["harris"].run(sample.images["mask"], **PAPER_TABLE_2["harris"]) + sample.origin
    on_curve = cKDTree(sample.curve).query(harris)[0] == 0 if len(harris) else np.zeros(0, bool)
    sparse = sample.curve[::_EVERY]
    sets = {
        DENSE: sample.curve,
        HARRIS: harris[on_curve].astype(float),
        JITTERED.format(every=_EVERY): sparse + rng.normal(0, _JITTER_PX, sparse.shape),
    }
    return {name: points[np.lexsort(points.T[::-1])] for name, points in sets.items() if len(points) >= 3}


def _cccd_runs(
    sample: SliceSample, name: str, points: np.ndarray, orderers: Sequence[Orderer], frame: Frame
) -> list[tuple[str, Run]]:
    """CCCD's ways of linking a point set, and what each is given."""
    seen = {POINTS: points} if name == DENSE else {POINTS: points, ALONG_PIXELS: sample.curve}
    runs: list[tuple[str, Run]] = [(GIVEN_ORDER, partial(_link_along, points, sample.curve, sample.curve))]
    for orderer in orderers:
        for given, pixels in seen.items():
            runs.append((given, partial(_link_as_found, points, _as_map(pixels, sample.k, frame), orderer)))
    return runs


def _as_map(pixels: np.ndarray, k: int, frame: Frame) -> Boundaries:
    """Boundary map of slice ``k`` with a pixel at every one of ``pixels`` (N, 2), rounded."""
    distinct = np.unique(np.rint(pixels).astype(np.int32), axis=0)
    return Boundaries(distinct, np.array([0, len(distinct)]), np.array([k], np.int32), frame)


def _link_as_found(points: np.ndarray, pixels: Boundaries, orderer: Orderer) -> np.ndarray:
    """Links (M, 2) of points along the chains that an orderer finds of boundary pixels."""
    ordered = orderer(pixels)
    return _link_along(points, pixels.points.astype(float), ordered.points, ordered.offsets)


def _link_along(
    points: np.ndarray, pixels: np.ndarray, chains: np.ndarray, offsets: np.ndarray | None = None
) -> np.ndarray:
    """Join points in the order of their places on closed pixel chains."""
    # A point's place is that of the nearest of the pixels; where that lies on no chain, it is left out.
    bounds = np.array([0, len(chains)]) if offsets is None else offsets
    if not len(chains):
        return np.zeros((0, 2), np.int64)
    apart, nearest = map(np.asarray, cKDTree(pixels).query(points))
    off_chain, place = map(np.asarray, cKDTree(chains).query(pixels[nearest]))
    linked = np.flatnonzero(off_chain == 0)
    order = linked[np.lexsort((apart[linked], place[linked]))]
    owner = np.searchsorted(bounds, place[order], side="right") - 1
    each = offsets_of(np.bincount(owner, minlength=len(bounds) - 1))
    return unique_links(np.column_stack([order, order[successors(each)]]))


def _timed(run):
    """Return the result of ``run`` and the median of its processor times in ms, after a call to warm up."""
    result = run()
    return result, 1e3 * float(np.median([timed(run)[1] for _ in range(_REPEATS)]))
