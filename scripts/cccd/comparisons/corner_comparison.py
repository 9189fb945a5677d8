"""Pixel corner detectors, fused with splines, on one structure: Tables 1 and 2, Figures 9 and 11."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd

from cccd.chaincode import is_simple
from cccd.comparisons.fuse import (
    ORDERS,
    closed_spline,
    near_boundary,
    order_by_angle,
    order_by_chain,
    order_by_links,
)
from cccd.comparisons.parameters import GRID, LARGEST_SHARE, grid_points, parameter_sets
from cccd.comparisons.registry import CORNER_DETECTORS, reconstruct
from cccd.comparisons.samples import SliceSample, choose_slices
from cccd.containers import Curves, Structure
from cccd.metrics import confusion, rasterise_slice

__all__ = ["compare_corners", "fused_spline", "order_corners", "search"]


def compare_corners(structure: Structure, curves: Curves, settings: Mapping, seed: int) -> pd.DataFrame:
    """Run every detector with every parameter set, and fuse its corners with a spline in every order.

    Parameters
    ----------
    structure : Structure
    curves : Curves
        The ordered curves, taken as the truth.
    settings : mapping
        The configuration's ``comparisons``; ``corners`` is used.
    seed : int
        Unused by the detectors, which draw nothing.

    Returns
    -------
    DataFrame
        One row per slice, image (``mask``, ``grey``), detector, parameter set and order: ``corners``
        found, those ``on_boundary``, their ``false_share``, ``boundary_pixels`` of the slice's longest
        curve, ``control_points`` used on it, ``self_intersects``, equations 12-21 under their printed
        abbreviations (``DSC`` is the Dice score), ``corner_ms`` and ``curve_ms`` of processor time.
    """
    section = settings["corners"]
    rows = []
    for sample in choose_slices(structure, curves, section["n_slices"], section["min_contour_px"]):
        for image_name, image in sample.images.items():
            for name, method in CORNER_DETECTORS.items():
                for set_name, parameters in parameter_sets(name, image_name).items():
                    begin = time.process_time()
                    found = method.run(image, **parameters) + sample.origin
                    corner_ms = 1e3 * (time.process_time() - begin)
                    labels = {
                        "case": structure.case,
                        "organ": structure.organ,
                        "slice": sample.k,
                        "image": image_name,
                        "detector": name,
                        "method": method.title,
                        "parameters": set_name,
                        "values": ", ".join(f"{key} {value}" for key, value in parameters.items()),
                    }
                    for row in _fuse_in_every_order(sample, found, section["on_boundary_px"]):
                        rows.append(labels | row | {"corner_ms": corner_ms})
    return pd.DataFrame(rows)


def _fuse_in_every_order(
    sample: SliceSample, corners: np.ndarray, distance_px: float, orders: Iterable[str] = ORDERS
) -> Iterable[dict]:
    true = near_boundary(corners, sample.boundary, distance_px)
    used = corners[near_boundary(corners, sample.curve, distance_px)].astype(float)
    for order in orders:
        begin = time.process_time()
        spline = fused_spline(used, order, sample.curve)
        curve_ms = 1e3 * (time.process_time() - begin)
        region = rasterise_slice([spline] if len(spline) else [], sample.origin, sample.region.shape)
        simple = len(spline) > 0 and bool(is_simple(spline, np.array([0, len(spline)]))[0])
        yield {
            "corners": len(corners),
            "on_boundary": int(true.sum()),
            "false_share": 1 - float(true.mean()) if len(corners) else np.nan,
            "boundary_pixels": len(sample.curve),
            "order": order,
            "control_points": len(used),
            "self_intersects": len(spline) > 0 and not simple,
            **{name: float(value) for name, value in confusion(sample.region, region).printed.items()},
            "curve_ms": curve_ms,
        }


def order_corners(corners: np.ndarray, order: str, curve: np.ndarray) -> np.ndarray:
    """Corners (K, 2) in one of `cccd.comparisons.fuse.ORDERS`; only ``chain`` looks at the true curve."""
    if order == "angle":
        return corners[order_by_angle(corners)]
    if order == "tour":
        return corners[order_by_links(corners, lambda points: reconstruct("tour", points))]
    return corners[order_by_chain(corners, curve)]


def fused_spline(corners: np.ndarray, order: str, curve: np.ndarray) -> np.ndarray:
    """Closed B-spline (n, 2) with the corners as control points; empty for fewer than three corners."""
    if len(corners) < 3:
        return np.zeros((0, 2))
    return closed_spline(order_corners(corners, order, curve))


def search(samples: Iterable[SliceSample], distance_px: float) -> pd.DataFrame:
    """Score every point of every detector's grid on training slices.

    Parameters
    ----------
    samples : iterable of SliceSample
        Slices of structures that nothing is reported on.
    distance_px : float
        As in the comparison.

    Returns
    -------
    DataFrame
        ``image``, ``detector``, ``parameters`` (dict), mean ``DSC`` over slices with the corners in their
        true order, mean ``share`` of the boundary's pixels used, ``eligible`` (share small enough);
        within each image and detector the best eligible first.
    """
    rows = []
    for sample in samples:
        for image_name, image in sample.images.items():
            for detector in GRID:
                for number, parameters in enumerate(grid_points(detector)):
                    corners = CORNER_DETECTORS[detector].run(image, **parameters) + sample.origin
                    (row,) = _fuse_in_every_order(sample, corners, distance_px, ["chain"])
                    share = row["control_points"] / row["boundary_pixels"]
                    rows.append((image_name, detector, number, row["DSC"], share))
    scores = pd.DataFrame(rows, columns=["image", "detector", "number", "DSC", "share"])
    scores = scores.groupby(["image", "detector", "number"]).mean().reset_index()
    grids = {detector: list(grid_points(detector)) for detector in GRID}
    numbers = zip(scores["detector"], scores.pop("number"), strict=True)
    scores["parameters"] = [grids[detector][number] for detector, number in numbers]
    scores["eligible"] = scores["share"] <= LARGEST_SHARE
    columns = ["image", "detector", "eligible", "DSC", "share"]
    return scores.sort_values(columns, ascending=[True, True, False, False, True]).reset_index(drop=True)
