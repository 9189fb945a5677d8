"""The ways to ordered contours that need no network: a mask is traced, drawn contours are taken.

The third way, for boundary pixels that still need ordering, is `cccd_junctions.ordering`. Which one a
structure goes the workflow decides from the cohort sheet, before any job starts.
"""

from __future__ import annotations

from collections.abc import Mapping
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


def doubtful_slices(report: Mapping[str, Any], most: int = 10) -> list[str]:
    """Say, of what `cccd_junctions.ordering.order_boundaries` reports, which slices should be looked at.

    Examples
    --------
    >>> found = {"slices": 4 * [{}], "doubtful": [7, 3], "expected_wrong": 1.24, "unlisted_wrong": 0.1}
    >>> print(*doubtful_slices(found))
    check these slices, the most doubtful first: 7, 3 (2 of 4; about 1.2 are expected to be wrong; of the \
others at most 10 % on average)
    >>> print(*doubtful_slices(found | {"doubtful": [3, 1, 0]}))
    most slices are doubtful (3 of 4; about 1.2 are expected to be wrong): check each of them
    """
    doubtful = report.get("doubtful", [])
    if not doubtful:
        return []
    whole = len(report["slices"])
    wrong = f"about {report['expected_wrong']:.2g} are expected to be wrong"
    if len(doubtful) > whole / 2:  # such a list helps nobody to choose
        return [f"most slices are doubtful ({len(doubtful)} of {whole}; {wrong}): check each of them"]
    listed = ", ".join(map(str, doubtful[:most])) + (" and so on" if len(doubtful) > most else "")
    if report["unlisted_wrong"] is not None:
        wrong += f"; of the others at most {100 * report['unlisted_wrong']:.3g} % on average"
    return [f"check these slices, the most doubtful first: {listed} ({len(doubtful)} of {whole}; {wrong})"]


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
