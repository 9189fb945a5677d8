"""The sweep over k on one structure, Figures 10, 12, 13 and 14, and section 2's detectors beside it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial

import numpy as np
import pandas as pd

from cccd.containers import Curves, Frame, Structure
from cccd.curves.corners import CRITERIA, k_cosine_corners
from cccd.geometry.arrays import split_ragged
from cccd.geometry.raster import dice, rasterise
from cccd_paper.comparisons.chain_corners import DETECTORS
from cccd_paper.comparisons.corner_measures import measure_corners, paper_splines
from cccd_paper.comparisons.paper_k import OUTLINES
from cccd_paper.comparisons.parameters import (
    BEST_OF_GRID,
    CHAIN_BEST,
    CHAIN_GRID,
    LARGEST_SHARE,
    UNTUNED,
    grid_points,
)
from cccd_paper.comparisons.repeatability import CHANGES, Detector, repeatability
from cccd_paper.comparisons.samples import choose_slices, middle_curve, outer_curves
from cccd_paper.comparisons.timing import timed
from cccd_paper.settings import SliceChoice
from cccd_viewers.page_files import Panel, SliceFigure

#: Detector, criterion, k, name and values of the parameters.
_Row = tuple[str, str, float, str, str]

#: What stands for the criterion of detectors that have one of their own.
OWN = "its own"


def compare_k(
    structure: Structure, curves: Curves, ks: Sequence[int], settings: SliceChoice, seed: int
) -> pd.DataFrame:
    """Measure the paper's own splines for each k and criterion, and section 2's detectors beside them.

    Parameters
    ----------
    structure : Structure
        Its mask is the truth; without one the filled curves are.
    curves : Curves
    ks : sequence of int
    settings : SliceChoice
        The slices on which corners are looked for again.
    seed : int
        Of the noise.

    Returns
    -------
    DataFrame
        One row per detector, for the k-cosine per criterion and k, for the others per set of ``parameters``
        (its defaults, and the best of a grid on training phantoms): ``detector``, ``criterion``, ``k``,
        ``parameters`` and their ``values``, what `measure_corners` says, ``ms`` of
        processor time for the corners of all curves, and how often corners are found again under
        ``rotation``, ``scale`` and ``noise``, 0 to 1 (`cccd_paper.comparisons.repeatability.repeatability`,
        means over their amounts).
    """
    detectors = dict(_detectors(ks))
    truth, origin = structure.stack("mask"), structure.stack_origin
    rows = []
    for (name, criterion, k, parameters, values), detect in detectors.items():
        corner, seconds = timed(detect, curves.points, curves.offsets)
        row = {
            "detector": name, "criterion": criterion, "k": k, "parameters": parameters, "values": values,
        }  # fmt: skip
        rows.append(row | measure_corners(curves, corner, truth, origin) | {"ms": 1e3 * seconds})
    samples = choose_slices(structure, curves, settings.n_slices)
    again = _found_again([sample.curve for sample in samples], curves.frame, detectors, seed)
    return pd.concat([pd.DataFrame(rows), again], axis=1)


def _detectors(ks: Sequence[int]) -> Iterator[tuple[_Row, Detector]]:
    """Every row's detector, criterion, k, name and values of its parameters; and what finds its corners."""
    for criterion in CRITERIA:
        for k in ks:
            detect = partial(k_cosine_corners, k=k, criterion=criterion)
            yield ("k-cosine", criterion, float(k), f"k = {k}", f"k {k}"), detect
    for name, best in CHAIN_BEST.items():
        values = ", ".join(f"{key} {value}" for key, value in best.items())
        yield (name, OWN, np.nan, UNTUNED, "defaults"), DETECTORS[name]
        yield (name, OWN, np.nan, BEST_OF_GRID, values), partial(DETECTORS[name], **best)


def search_chain(
    outlines: Sequence[np.ndarray], frame: Frame, grids: Mapping[str, Mapping[str, tuple]] = CHAIN_GRID
) -> pd.DataFrame:
    """Score every point of the grids of the detectors on the chain code on training outlines.

    Parameters
    ----------
    outlines : sequence of (n, 2) arrays
        Pixel chains of structures that nothing is reported on.
    frame : Frame
    grids : dict of dict of str to tuple, optional
        Values of each detector's parameters.

    Returns
    -------
    DataFrame
        ``detector``, ``parameters`` (dict), ``DSC`` of the splines through its corners, mean ``share`` of
        the pixels that are corners, and ``eligible``: few enough; within each detector the best eligible
        first.
    """
    curves = outer_curves(outlines, range(len(outlines)), frame)
    rows = []
    for detector in grids:
        for parameters in grid_points(detector, grids):
            corner = DETECTORS[detector](curves.points, curves.offsets, **parameters)
            measured = measure_corners(curves, corner)
            share = float(np.mean([part.mean() for part in split_ragged(corner, curves.offsets)]))
            rows.append((detector, parameters, measured["DSC"], share, share <= LARGEST_SHARE))
    scores = pd.DataFrame(rows, columns=["detector", "parameters", "DSC", "share", "eligible"])
    columns = ["detector", "eligible", "DSC", "share"]
    return scores.sort_values(columns, ascending=[True, False, False, True]).reset_index(drop=True)


def _found_again(
    outlines: Sequence[np.ndarray], frame: Frame, detectors: Mapping[tuple, Detector], seed: int
) -> pd.DataFrame:
    """Repeatability of every detector, a row each, by what changed the outlines."""
    curves = outer_curves(outlines, range(len(outlines)), frame)
    named = {str(number): detect for number, detect in enumerate(detectors.values())}
    table = repeatability(curves, np.random.default_rng(seed), named)
    means = table.groupby(["detector", "change"])["repeatability"].mean().unstack("change")
    return means.loc[list(named), list(CHANGES)].reset_index(drop=True)


def outline_figures(curves: Curves) -> dict[str, SliceFigure]:
    """Outline the middle slice for the k of Figures 10, 12 and 14; nothing where there is no outer curve."""
    curve = middle_curve(curves)
    if curve is None:
        return {}
    return {figure: SliceFigure([_outline(curve, k) for k in ks]) for figure, ks in OUTLINES.items()}


def _outline(curve: Curves, k: int) -> Panel:
    """Boundary, corners and the paper's spline: corners at maxima of curvature as control points (eq. 9)."""
    splines = paper_splines(curve, k)
    line = splines.sample().polygons
    low = np.floor(np.minimum(curve.points.min(axis=0), line.points.min(axis=0))).astype(int) - 2
    shape = np.ceil(np.maximum(curve.points.max(axis=0), line.points.max(axis=0))).astype(int) + 3 - low
    score = dice(rasterise([curve.points], low, shape), rasterise([line.points], low, shape))
    control = splines.control_points
    return Panel(
        f"k = {k}",
        {"boundary": curve.points, "spline": line.points, "corners": control},
        detail=f"{len(control)} points, Dice {100 * score:.2f} %"
        + ("" if line.is_simple.all() else ", crosses itself"),
    )
