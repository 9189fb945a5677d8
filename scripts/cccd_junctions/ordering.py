"""From a volume's boundary pixels to ordered curves, and what is counted on the way.

A mask needs no network, for border following is exact (`cccd.contours`); the network earns its cost on
boundary maps and edges of grey images, with spurs, bridges and gaps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from cccd.chaincode import changed_pixels
from cccd.containers import Boundaries, Curves, Structure
from cccd.contours import check_closed
from cccd.errors import InputError
from cccd.extras import needing
from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray, IntArray, RealArray, owners_of, sum_per_part
from cccd.project import SHIPPED_WEIGHTS
from cccd.settings.junctions import BoundarySettings, InferenceSettings
from cccd_junctions.boundary import extract_boundaries
from cccd_junctions.decoding import closed_chains
from cccd_junctions.greedy_chains import isolated_corners, junction_pixels
from cccd_junctions.inference import LoopPredictor, Predictor, predict_slices
from cccd_junctions.uncertainty import CALIBRATED_WEIGHTS, listed_from

#: What holds where nobody decides.
DEFAULTS = InferenceSettings()


@needing("ordering boundary pixels", "gnn")
def order_maps(
    structure: Structure,
    boundaries: BoundarySettings,
    inference: InferenceSettings,
    weights: str | Path = SHIPPED_WEIGHTS,
) -> Curves:
    """Order the boundary pixels of a structure's maps, or of its image's region, by a network (PyTorch)."""
    pixels = extract_boundaries(structure, boundaries)
    return order_pixels(structure, pixels, weights, inference.model_dump())[0]


def order_pixels(
    structure: Structure, boundaries: Boundaries, weights: str | Path, decoding: Mapping[str, Any]
) -> tuple[Curves, dict[str, Any]]:
    """Order as `order_contours` does, by the network of a file and the section ``gnn.inference``."""
    from cccd_junctions.checkpoint import load_model  # torch takes two seconds to load

    return order_contours(structure, boundaries, load_model(weights), InferenceSettings(**decoding))


def order_contours(
    structure: Structure,
    boundaries: Boundaries,
    model: Predictor | LoopPredictor,
    settings: InferenceSettings = DEFAULTS,
) -> tuple[Curves, dict[str, Any]]:
    """Order the boundary pixels of every slice into closed simple curves.

    Parameters
    ----------
    structure : Structure
        Its image, and the rough region in it, are read beside the pixels, where it has them.
    boundaries : Boundaries
        Its boundary pixels.
    model : Predictor or LoopPredictor
        From `cccd_junctions.checkpoint.load_model`.
    settings : InferenceSettings

    Returns
    -------
    curves : Curves
        Closed, simple, oriented.
    report : dict
        Plain JSON: ``method``, and the counts of `order_boundaries`.

    Raises
    ------
    InputError
        The structure has drawn contours, which are ordered already, or no slice has a closed boundary.
    """
    if structure.contours is not None:
        raise InputError(
            f"{structure.case}/{structure.organ}",
            "its contours are drawn, and need no ordering",
            "its file has changed since the run was planned: run snakemake again",
        )
    curves, report = order_boundaries(
        boundaries,
        model,
        structure.stack("image"),
        structure.stack_origin,
        settings,
        structure.stack("region"),
    )
    return check_closed(curves, structure), {"method": "GNN", **report}


def order_boundaries(
    boundaries: Boundaries,
    model: Predictor | LoopPredictor | None,
    image: RealArray | None = None,
    image_origin: Sequence[int] | IntArray = (0, 0, 0),
    settings: InferenceSettings = DEFAULTS,
    region: BoolArray | None = None,
) -> tuple[Curves, dict[str, Any]]:
    """Order every slice's boundary pixels into closed, strictly simple 8-connected pixel chains.

    Parameters
    ----------
    boundaries : Boundaries
    model : Predictor, LoopPredictor or None
        From `cccd_junctions.checkpoint.load_model`; ``None`` lets the decoder decide by walls and gaps alone.
    image : (S, I, J) array, optional
        Grey slices, used where given.
    image_origin : (3,) int
        Source index (k, i, j) of the image's first voxel.
    settings : InferenceSettings
        Section ``gnn.inference`` of the configuration.
    region : (S, I, J) bool array, optional
        Where the organ roughly is, on the image's grid; read where our network orders.

    Returns
    -------
    curves : Curves
    report : dict
        Plain JSON. ``slices``: per slice its number ``k``, ``pixels``, ``junctions`` and
        ``isolated_corners`` of the map (Figure 4), its pixels that were ``kept`` and ``dropped``, those
        that were ``bridged`` (`count_changes`), ``outer`` and ``holes``; ``unclosed``: the numbers of
        slices that have no closed boundary; and the totals. Where our network was asked, the curves
        have their ``uncertainty``; ``doubtful`` lists the slices that should be looked at, the most doubtful
        first, ``expected_wrong`` is the sum of all slices' uncertainties, and ``unlisted_wrong`` the share
        of the others that may be wrong, ``None`` for weights of which nothing is guaranteed.
    """
    first, *corner = np.asarray(image_origin) if image is not None else np.zeros(3, np.int64)
    filled = [n for n, pixels in enumerate(boundaries) if len(pixels)]
    numbers = boundaries.slice[filled]
    maps = [pixels - corner for pixels in boundaries if len(pixels)]
    images, regions = (_slices_of(stack, numbers - first) for stack in (image, region))
    pixel_mm = float(np.sqrt(boundaries.frame.pixel_spacing.prod()))
    found = predict_slices(maps, model, images, numbers, settings.parts, regions, pixel_mm)
    curves = closed_chains(found.masks, found.origin + corner, numbers, boundaries.frame, settings.parts)
    report = _report(boundaries, curves)
    if found.uncertainty is None:
        return curves, report
    own = found.uncertainty[np.searchsorted(numbers, curves.slice)]
    report |= _doubts(numbers, found.uncertainty, settings.unlisted_wrong)
    if getattr(model, "weights_sha256", None) != CALIBRATED_WEIGHTS:
        report["unlisted_wrong"] = None
    return replace(curves, uncertainty=own), report


def _slices_of(stack: AnyArray | None, layers: IntArray) -> list[AnyArray | None]:
    """Take slices of a stack by their number, None where it has none."""
    count = 0 if stack is None else len(stack)
    return [stack[k] if stack is not None and 0 <= k < count else None for k in layers]


def _doubts(numbers: IntArray, uncertainty: FloatArray, unlisted_wrong: float) -> dict[str, Any]:
    """Say which slices should be looked at, the most doubtful first, and how many are probably wrong."""
    order = np.argsort(-uncertainty, kind="stable")
    doubtful = order[uncertainty[order] >= listed_from(unlisted_wrong)]
    return {
        "doubtful": [int(k) for k in numbers[doubtful]],
        "expected_wrong": round(float(uncertainty.sum()), 3),
        "unlisted_wrong": unlisted_wrong,
    }


def _report(boundaries: Boundaries, curves: Curves) -> dict[str, Any]:
    count = len(boundaries)
    of = np.searchsorted(boundaries.slice, curves.slice)
    dropped, bridged = changed_pixels(boundaries, curves)
    counts = {
        "pixels": np.diff(boundaries.offsets),
        "junctions": sum_per_part(junction_pixels(boundaries), boundaries.offsets),
        "isolated_corners": sum_per_part(isolated_corners(boundaries), boundaries.offsets),
        "kept": sum_per_part(~dropped, boundaries.offsets),
        "dropped": sum_per_part(dropped, boundaries.offsets),
        "bridged": np.bincount(of[owners_of(curves.offsets)[bridged]], minlength=count),
        "outer": np.bincount(of[~curves.hole], minlength=count),
        "holes": np.bincount(of[curves.hole], minlength=count),
    }
    slices = [
        {"k": int(k), **{name: int(values[n]) for name, values in counts.items()}}
        for n, k in enumerate(boundaries.slice)
    ]
    unclosed = boundaries.slice[counts["outer"] == 0]
    totals = {name: int(values.sum()) for name, values in counts.items()}
    return {"slices": slices, "unclosed": [int(k) for k in unclosed], **totals}


def count_changes(boundaries: Boundaries, curves: Curves) -> dict[str, int]:
    """Count what became of the boundary pixels on the way to the curves through them.

    Returns
    -------
    dict
        ``kept``: pixels of the map that lie on a curve; ``dropped``: those that lie on none; ``bridged``:
        pixels of the curves that are not the map's.
    """
    dropped, bridged = changed_pixels(boundaries, curves)
    return {
        "kept": int(np.count_nonzero(~dropped)),
        "dropped": int(np.count_nonzero(dropped)),
        "bridged": int(np.count_nonzero(bridged)),
    }
