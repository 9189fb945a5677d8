"""Pixel corner detectors, fused with splines, on one structure: Tables 1 and 2, Figures 9 and 11."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
import pandas as pd

from cccd.chaincode import chain_codes, on_pixel_chain
from cccd.containers import Curves, Frame, Structure
from cccd.curves.corners import k_cosine_corners
from cccd.curves.fitting import corner_splines, fit_splines
from cccd.geometry.polygons import RaggedPolygons
from cccd.geometry.raster import rasterise
from cccd.settings.curves import CurveSettings
from cccd_paper.comparisons.active_contour import seed_circle
from cccd_paper.comparisons.baselines.corner_detectors import CORNER_DETECTORS
from cccd_paper.comparisons.baselines.reconstructions import reconstruct
from cccd_paper.comparisons.confusion import confusion
from cccd_paper.comparisons.corner_measures import SWEEP
from cccd_paper.comparisons.fuse import (
    ORDERS,
    closed_spline,
    near_boundary,
    order_by_angle,
    order_by_chain,
    order_by_links,
)
from cccd_paper.comparisons.paper_k import CCCD
from cccd_paper.comparisons.parameters import GRID, LARGEST_SHARE, grid_points, parameter_sets
from cccd_paper.comparisons.samples import SliceSample, choose_slices, middle_slice, outer_curves
from cccd_paper.comparisons.timing import timed
from cccd_paper.settings import SliceChoice
from cccd_viewers.page_files import Panel, SliceFigure

#: What the automatic fit below is run with, whatever the run's own curves are fitted with.
_AUTOMATIC_VALUES = f"tolerance {CurveSettings().tolerance_px:g} px"


def compare_corners(structure: Structure, curves: Curves, settings: SliceChoice) -> pd.DataFrame:
    """Run every detector with every parameter set, fuse its corners with a spline in every order; and CCCD.

    Parameters
    ----------
    structure : Structure
    curves : Curves
        The ordered curves, taken as the truth.
    settings : SliceChoice

    Returns
    -------
    DataFrame
        One row per slice, image (`SliceSample.images`; ``chain code`` for CCCD), detector, parameter set
        and order: ``corners`` found, those ``on_boundary``, the ``false_share``, ``boundary_pixels`` of
        the slice's longest curve, ``control_points`` used on it, whether the spline
        ``self_intersects``, equations 12-21 under their printed abbreviations (``DSC`` is the Dice
        score), ``corner_ms`` and ``curve_ms`` of processor time.

    Notes
    -----
    The equations count pixel centres. The truth holds the boundary pixels themselves, so any smooth
    curve, FUSE's and CCCD's alike, loses those whose corner it cuts: half a per cent of Dice here is less
    than a pixel's distance.
    """
    rows = []
    fused_spline(seed_circle((0, 0), 10), "tour", np.zeros((1, 2)))  # compiled before anything is timed
    for sample in choose_slices(structure, curves, settings.n_slices):
        labels = {"case": structure.case, "organ": structure.organ, "slice": sample.k}
        rows += [labels | row for row in _detectors(sample)]
        rows += [labels | row for row in _cccd(sample, curves.frame)]
    return pd.DataFrame(rows)


def _detectors(sample: SliceSample) -> Iterator[dict]:
    for image_name, image in sample.images.items():
        for name, method in CORNER_DETECTORS.items():
            for set_name, parameters in parameter_sets(name, image_name).items():
                corners, corner_s = timed(partial(method.run, image, **parameters))
                found = corners + sample.origin
                labels = {
                    "image": image_name,
                    "detector": name,
                    "method": method.title,
                    "parameters": set_name,
                    "values": ", ".join(f"{key} {value}" for key, value in parameters.items()) or "defaults",
                    "corner_ms": 1e3 * corner_s,
                }
                used = found[near_boundary(found, sample.curve)].astype(float)
                for order in ORDERS:
                    spline, curve_s = timed(fused_spline, used, order, sample.curve)
                    scores = _scores(sample, found, used, spline)
                    yield labels | {"order": order} | scores | {"curve_ms": 1e3 * curve_s}


def _cccd(sample: SliceSample, frame: Frame) -> Iterator[dict]:
    """Return CCCD's rows for a slice: the k-cosine's corners as control points, and the automatic fit."""
    curve = outer_curves([sample.curve], [sample.k], frame)
    chained = bool(on_pixel_chain(curve.points, curve.offsets).all())  # drawn contours are none
    for setting in (*SWEEP, "automatic"):
        begin = time.process_time()
        if setting == "automatic":
            splines, middle = fit_splines(curve), time.process_time()
            found = splines.control_points
        else:
            if chained:
                chain_codes(curve.points, curve.offsets)
            corners = k_cosine_corners(curve.points, curve.offsets, setting, "max")
            middle = time.process_time()
            splines = corner_splines(curve, corners)
            found = sample.curve[corners]
        spline = splines.sample().points
        end = time.process_time()
        yield {
            "image": "chain code",
            "detector": "cccd",
            "method": CCCD,
            "parameters": setting if setting == "automatic" else f"k = {setting}",
            "values": _AUTOMATIC_VALUES if setting == "automatic" else f"k {setting}, criterion max",
            "corner_ms": 1e3 * (middle - begin),
            "order": "chain",
            **_scores(sample, found, found, spline),
            "curve_ms": 1e3 * (end - middle),
        }


def _scores(sample: SliceSample, found: np.ndarray, used: np.ndarray, spline: np.ndarray) -> dict:
    true = near_boundary(found, sample.boundary)
    region = rasterise([spline] if len(spline) else [], sample.origin, sample.region.shape)
    simple = len(spline) > 0 and bool(RaggedPolygons.of([spline]).is_simple[0])
    rates = confusion(sample.region, region).printed
    return {
        "corners": len(found),
        "on_boundary": int(true.sum()),
        "false_share": 1 - float(true.mean()) if len(found) else np.nan,
        "boundary_pixels": len(sample.curve),
        "control_points": len(used),
        "self_intersects": len(spline) > 0 and not simple,
        **{name: float(value) for name, value in rates.items()},
    }


def corner_figures(structure: Structure, curves: Curves, settings: SliceChoice) -> dict[str, SliceFigure]:
    """Figure 6, the middle slice and its boundary; Figure 9, corners and fused splines over it.

    Of Figure 9 each detector has a column. The upper row has the paper's parameters of Figure 9 (the
    defaults of SUSAN), the lower row the best of the grid; corners are ordered by a short tour, which
    is what corners alone allow. Parameters as in `compare_corners`; nothing where there is no curve.
    """
    sample = middle_slice(structure, curves, settings.n_slices)
    if sample is None:
        return {}
    columns = [
        list(parameter_sets(name, sample.picture).items())  # the paper's set first, the grid's best last
        for name in CORNER_DETECTORS
    ]
    panels = [
        _fused_panel(sample, detector, *sets[row])
        for row in (0, -1)
        for detector, sets in zip(CORNER_DETECTORS, columns, strict=True)
    ]
    image = sample.images[sample.picture]
    raw = [Panel("slice", {}), Panel("its boundary", {"boundary": sample.curve})]
    return {
        "figure6": SliceFigure(raw, len(raw), sample.window, image),
        "figure9": SliceFigure(panels, len(columns), sample.window, image),
    }


def _fused_panel(sample: SliceSample, detector: str, set_name: str, parameters: Mapping) -> Panel:
    method = CORNER_DETECTORS[detector]
    found, used, spline = fuse(sample, method.run(sample.images[sample.picture], **parameters), "tour")
    score = f"Dice {sample.dice_percent(spline):.1f} %, {len(used)} of {len(found)}"
    layers = {"boundary": sample.curve, "corners": found, "spline": spline}
    return Panel(method.title, layers, f"{set_name}\n{score}")


def order_corners(corners: np.ndarray, order: str, curve: np.ndarray) -> np.ndarray:
    """Corners (K, 2) in an order (`cccd_paper.comparisons.fuse.ORDERS`); only ``chain`` sees the curve."""
    if order == "angle":
        return corners[order_by_angle(corners)]
    if order == "tour":
        return corners[order_by_links(corners, lambda points: reconstruct("tour", points))]
    return corners[order_by_chain(corners, curve)]


class Fused(NamedTuple):
    """A detector's corners in source (i, j), those used as control points, and their spline."""

    found: np.ndarray
    used: np.ndarray
    spline: np.ndarray


def fuse(sample: SliceSample, corners: np.ndarray, order: str) -> Fused:
    """Fuse the corners (K, 2) that a detector marks in a sample's image with a spline.

    Those near the sample's curve are the control points.
    """
    found = corners + sample.origin
    used = found[near_boundary(found, sample.curve)].astype(float)
    return Fused(found, used, fused_spline(used, order, sample.curve))


def fused_spline(corners: np.ndarray, order: str, curve: np.ndarray) -> np.ndarray:
    """Draw the closed B-spline (n, 2) of ordered corners; it is empty for fewer than three corners."""
    if len(corners) < 3:
        return np.zeros((0, 2))
    return closed_spline(order_corners(corners, order, curve))


def search(samples: Iterable[SliceSample]) -> pd.DataFrame:
    """Score every point of every detector's grid on training slices.

    Parameters
    ----------
    samples : iterable of SliceSample
        Slices of structures that nothing is reported on.

    Returns
    -------
    DataFrame
        ``image``, ``detector``, ``parameters`` (dict), mean ``DSC`` over slices with the corners in their
        true order, mean ``share`` of the boundary's pixels used and of corners ``found`` in all to
        boundary pixels, ``eligible`` (both small enough); within each image and detector the best
        eligible first.
    """
    rows = [
        (image_name, detector, number, *scores)
        for sample in samples
        for image_name, image in sample.images.items()
        for detector in GRID
        for number, scores in enumerate(_searched(sample, image, detector))
    ]
    scores = pd.DataFrame(rows, columns=["image", "detector", "number", "DSC", "share", "found"])
    scores = scores.groupby(["image", "detector", "number"]).mean().reset_index()
    grids = {detector: list(grid_points(detector)) for detector in GRID}
    numbers = zip(scores["detector"], scores.pop("number"), strict=True)
    scores["parameters"] = [grids[detector][number] for detector, number in numbers]
    scores["eligible"] = (scores["share"] <= LARGEST_SHARE) & (scores["found"] <= 1)
    columns = ["image", "detector", "eligible", "DSC", "share"]
    return scores.sort_values(columns, ascending=[True, True, False, False, True]).reset_index(drop=True)


def _searched(sample: SliceSample, image: np.ndarray, detector: str) -> Iterator[tuple[float, float, float]]:
    """Dice, share of the pixels used and corners found to boundary pixels, for each point of a grid.

    Many points mark the same corners, on an image of two values most of all; these are fused once.
    """
    known: dict[bytes, tuple[float, float, float]] = {}
    for parameters in grid_points(detector):
        corners = CORNER_DETECTORS[detector].run(image, **parameters)
        key = corners.tobytes()
        if key not in known:
            fused = fuse(sample, corners, "chain")
            used, found = len(fused.used) / len(sample.curve), len(fused.found) / len(sample.boundary)
            known[key] = sample.dice_percent(fused.spline) / 100, used, found
        yield known[key]
