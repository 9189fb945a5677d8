"""The ways to ordered contours that need no network: a mask is traced, drawn contours are taken.

The third way, for boundary pixels that still need ordering, is `cccd_junctions.ordering`. Which one a
structure goes the workflow decides from the cohort sheet, before any job starts.
"""

from __future__ import annotations

from typing import Any

from cccd.containers import Curves, Structure
from cccd.errors import InputError
from cccd.tracing import left_out, level_curves, trace_stack

_CHANGED = "its file has changed since the run was planned: run snakemake again"


def trace_contours(structure: Structure) -> tuple[Curves, dict[str, Any]]:
    """Follow the borders of a mask's slices: exact, so that no network could add to it.

    Of probabilities it is their level of one half, which runs between the pixels.

    Parameters
    ----------
    structure : Structure
        With a mask, and probabilities where there are some.

    Returns
    -------
    curves : Curves
        Closed, simple, oriented; see `cccd.tracing.trace_stack`.
    report : dict
        Plain JSON: ``method``, and in ``left_out`` what of the mask has no polygon: surfaces have it.

    Raises
    ------
    InputError
        There is no mask, or nothing in it.
    """
    mask = structure.stack("mask")
    if mask is None:
        raise InputError(f"{structure.case}/{structure.organ}", "there is no mask to trace", _CHANGED)
    probability = structure.probability_stack
    if probability is None:
        method, curves = "traced mask", trace_stack(mask, structure.stack_origin, structure.frame)
    else:
        method, curves = "level of probabilities", level_curves(probability, structure.frame)
    report = {"method": method, "left_out": left_out(mask, structure.stack_origin, curves)}
    # what is one pixel wide everywhere has no curve through its pixels' centres, but it has a border
    traced = curves if probability is None and mask.any() else check_closed(curves, structure)
    return traced, report


def take_contours(structure: Structure) -> tuple[Curves, dict[str, Any]]:
    """Take drawn contours (RTSTRUCT) as they are.

    Parameters
    ----------
    structure : Structure
        With contours.

    Returns
    -------
    curves : Curves
        The contours.
    report : dict
        Plain JSON: ``method``.

    Raises
    ------
    InputError
        There are no drawn contours.
    """
    if structure.contours is None:
        raise InputError(f"{structure.case}/{structure.organ}", "there are no drawn contours", _CHANGED)
    return check_closed(structure.contours, structure), {"method": "contours as given"}


def check_closed(curves: Curves, structure: Structure) -> Curves:
    """Return the curves, provided that there is one.

    Raises
    ------
    InputError
        No slice has a closed boundary.
    """
    if not len(curves):
        raise InputError(
            f"{structure.case}/{structure.organ}",
            "no slice has a closed boundary",
            "check the input's slices: none shows an outline that closes",
        )
    return curves
