"""Curve reconstruction from points on one structure: Tables 4 and 5, Figure 16."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from cccd.comparisons.baselines.corner_detectors import CORNER_DETECTORS
from cccd.comparisons.baselines.reconstructions import RECONSTRUCTIONS, reconstruct
from cccd.comparisons.links import count_links, enclosed_region, unique_links
from cccd.comparisons.orderers import Orderer
from cccd.comparisons.paper_k import CCCD
from cccd.comparisons.parameters import PAPER_TABLE_2
from cccd.comparisons.samples import SliceSample, choose_slices, middle_slice
from cccd.containers import Boundaries, Curves, Frame, Panel, SliceFigure, Structure
from cccd.metrics import dice
from cccd.settings.comparisons import ReconstructionSettings

__all__ = [
    "DENSE",
    "HARRIS",
    "JITTERED",
    "compare_reconstruction",
    "link_along_chain",
    "point_sets",
    "reconstruction_figures",
]

#: The point sets by the names that tables and figures show.
DENSE, HARRIS = "dense boundary", "Harris corners on the boundary"
JITTERED = "every {every}th pixel with jitter"

#: Methods of the paper's Figure 16, then the strongest of the others.
FIGURE_16 = ("connect2d", "crawl", "nn_crust", "tour")

#: Returns points (N, 2) and the links (M, 2) between them.
Run = Callable[[], tuple[np.ndarray, np.ndarray]]


def compare_reconstruction(
    structure: Structure,
    curves: Curves,
    settings: ReconstructionSettings,
    seed: int,
    orderers: Sequence[Orderer] = (),
) -> pd.DataFrame:
    """Link three point sets per slice by every registered method, and by CCCD.

    Parameters
    ----------
    structure : Structure
    curves : Curves
        The ordered curves, taken as the truth.
    settings : ReconstructionSettings
    seed : int
        Of the jitter.
    orderers : sequence of Orderer
        From `cccd.comparisons.orderers.load_orderers`: CCCD orders the dense boundary with each. A run
        without a network has none, and no such row.

    Returns
    -------
    DataFrame
        One row per slice, point set and method: ``points``, ``n_points``, ``connected``,
        ``disconnected``, ``open_ends``, ``junctions``, ``left_out``, ``closed`` (see
        `cccd.comparisons.links.LinkCounts`), ``dice`` of what the links enclose, ``ms`` of processor
        time (median of ``repeats``), and ``given``: what the method saw.

    Notes
    -----
    Bare boundary pixels CCCD orders itself (`cccd.junctions.order_boundaries`). It never throws the
    boundary away, so a corner carries its place in the chain code, and sparse points are linked along
    it. The other methods see the points alone. The rows say so in ``given``.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for sample in choose_slices(structure, curves, settings.n_slices, settings.min_contour_px):
        labels = {"case": structure.case, "organ": structure.organ, "slice": sample.k}
        for name, points in point_sets(sample, settings.every, settings.jitter_px, rng).items():
            runs: list[tuple[str, Run, str]] = [
                (method.title, lambda key=key, points=points: (points, reconstruct(key, points)), "points")
                for key, method in RECONSTRUCTIONS.items()
            ]
            runs += _cccd_runs(sample, name, points, orderers, curves.frame)
            for method, run, given in runs:
                (linked, links), ms = _timed(run, settings.repeats)
                counts = count_links(links, len(linked))
                region = enclosed_region(linked, links, sample.origin, sample.region.shape)
                score = float(dice(sample.region, region))
                row = {"points": name, "n_points": len(points), "method": method, "given": given}
                rows.append(labels | row | vars(counts) | {"dice": score, "ms": ms})
    return pd.DataFrame(rows)


def reconstruction_figures(
    structure: Structure,
    curves: Curves,
    settings: ReconstructionSettings,
    seed: int,
    orderers: Sequence[Orderer] = (),
) -> dict[str, SliceFigure]:
    """Figure 16: what reconstruction makes of Harris corners: ground truth, the paper's three, a tour, CCCD.

    Parameters as in `compare_reconstruction`; nothing where there is no curve, or where the middle slice has
    fewer than three Harris corners.
    """
    sample = middle_slice(structure, curves, settings.n_slices, settings.min_contour_px)
    if sample is None:
        return {}
    sets = point_sets(sample, settings.every, settings.jitter_px, np.random.default_rng(seed))
    if HARRIS not in sets:
        return {}
    points = sets[HARRIS]
    linked = {RECONSTRUCTIONS[key].title: reconstruct(key, points) for key in FIGURE_16}
    linked[CCCD] = link_along_chain(points, sample.curve)
    panels = [Panel("Ground truth", {"boundary": sample.curve})]
    panels += [_link_panel(title, points, links) for title, links in linked.items()]
    window = np.array([np.floor(sample.curve.min(0)) - 4, np.ceil(sample.curve.max(0)) + 4], np.int64)
    return {"figure16": SliceFigure(panels, 3, window)}


def _link_panel(title: str, points: np.ndarray, links: np.ndarray) -> Panel:
    counts = count_links(links, len(points))
    gaps = "closed" if counts.closed else f"{counts.open_ends} open ends, {counts.junctions} junctions"
    layers = {"links": points[links], "corners": points}
    return Panel(title, layers, f"{counts.connected} connected, {gaps}")


def point_sets(
    sample: SliceSample, every: int, jitter_px: float, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """Point sets (N, 2) of a slice's longest curve, unordered (raster order).

    The dense boundary pixels; the Harris corners (the paper's Table 2 parameters, on the organ's mask)
    that are boundary pixels; every ``every``-th pixel, moved by Gaussian noise of ``jitter_px``.
    """
    harris = CORNER_DETECTORS["harris"].run(sample.images["mask"], **PAPER_TABLE_2["harris"]) + sample.origin
    on_curve = cKDTree(sample.curve).query(harris)[0] == 0 if len(harris) else np.zeros(0, bool)
    sparse = sample.curve[::every]
    sets = {
        DENSE: sample.curve,
        HARRIS: harris[on_curve].astype(float),
        JITTERED.format(every=every): sparse + rng.normal(0, jitter_px, sparse.shape),
    }
    return {name: points[np.lexsort(points.T[::-1])] for name, points in sets.items() if len(points) >= 3}


def link_along_chain(points: np.ndarray, curve: np.ndarray) -> np.ndarray:
    """Links (N, 2) that join points in the order of their places on an ordered closed ``curve`` (n, 2)."""
    distance, place = cKDTree(curve).query(points)
    order = np.lexsort((np.asarray(distance), np.asarray(place)))
    return unique_links(np.column_stack([order, np.roll(order, -1)]))


def _cccd_runs(
    sample: SliceSample, name: str, points: np.ndarray, orderers: Sequence[Orderer], frame: Frame
) -> list[tuple[str, Run, str]]:
    """CCCD's ways of linking a point set, and what each is given."""
    if name != DENSE:
        return [(CCCD, lambda: (points, link_along_chain(points, sample.curve)), "points and chain code")]
    pixels = Boundaries(
        points.astype(np.int32), np.array([0, len(points)]), np.array([sample.k], np.int32), frame
    )
    return [(CCCD, partial(_link_as_ordered, orderer, pixels, points), "points") for orderer in orderers]


def _link_as_ordered(
    orderer: Orderer, pixels: Boundaries, points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Links of what ``orderer`` makes of boundary pixels, and the points (N, 2) that they join."""
    ordered = orderer(pixels)
    # the chains' points among the given ones, then those that fill gaps
    everything, number = np.unique(np.concatenate([points, ordered.points]), axis=0, return_inverse=True)
    chain = number.ravel()[len(points) :]
    return everything, unique_links(np.column_stack([chain, chain[ordered.polygons.successors]]))


def _timed(run, repeats: int):
    """Return the result of ``run`` and the median of its processor times in ms, after a call to warm up."""
    result, times = run(), []
    for _ in range(repeats):
        begin = time.process_time()
        run()
        times.append(1e3 * (time.process_time() - begin))
    return result, float(np.median(times))
