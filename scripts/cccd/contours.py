"""The ways to ordered contours that need no network: a mask is traced, drawn contours are taken.

The third way, for boundary pixels that still need ordering, is `cccd.junctions.ordering`. Which one a
structure goes the workflow decides from the cohort sheet, before any job starts.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cccd.containers import Curves, Structure
from cccd.errors import InputError
from cccd.tracing import left_out, level_curves, trace_stack

__all__ = ["check_closed", "doubtful_slices", "missing_parts", "take_contours", "trace_contours"]

#: Voxels in pieces and spurs one pixel wide are told where they are more than this share of the mask.
_THIN_SHARE = 0.03

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
        Plain JSON: ``method``, and in ``left_out`` what of the mask has no polygon.

    Raises
    ------
    InputError
        There is no mask, or no slice of it has a closed boundary.
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
    return check_closed(curves, structure), report


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


def missing_parts(report: Mapping[str, Any]) -> list[str]:
    """Say, of what `trace_contours` reports, what of the mask the curves do not know.

    That is parts without a curve on any slice, and pieces and spurs one pixel wide of the others where these
    are more than a few in a hundred.

    Examples
    --------
    >>> lost = {"parts": 2, "part_voxels": 3, "component_pixels": 5, "spur_pixels": 4, "voxels": 60}
    >>> for line in missing_parts({"method": "traced mask", "left_out": lost}):
    ...     print(line)
    not in the surface, because no slice has an outline of them: 2 parts of 3 voxels in all
    dropped, because they are only one voxel wide: 6 of 60 voxels in pieces and spurs of slices
    """
    lost = report.get("left_out", {})
    lines: list[str] = []
    if lost.get("parts"):
        count = (
            f"{lost['parts']} part{'s' if lost['parts'] > 1 else ''} of {lost['part_voxels']} voxels in all"
        )
        lines.append(f"not in the surface, because no slice has an outline of them: {count}")
    thin = sum(lost.get(name, 0) for name in ("component_pixels", "spur_pixels")) - lost.get("part_voxels", 0)
    if thin > _THIN_SHARE * lost.get("voxels", float("inf")):
        count = f"{thin} of {lost['voxels']} voxels"
        lines.append(f"dropped, because they are only one voxel wide: {count} in pieces and spurs of slices")
    return lines


def doubtful_slices(report: Mapping[str, Any], most: int = 10) -> list[str]:
    """Say, of what `cccd.junctions.order_boundaries` reports, which slices should be looked at.

    Examples
    --------
    >>> found = {"slices": 4 * [{}], "doubtful": [7, 3], "expected_wrong": 1.24, "unlisted_wrong": 0.1}
    >>> print(*doubtful_slices(found))
    check these slices, the most doubtful first: 7, 3 (2 of 4; about 1.2 are expected to be wrong; of the \
others at most 10 % on average)
    """
    doubtful = report.get("doubtful", [])
    if not doubtful:
        return []
    listed = ", ".join(map(str, doubtful[:most])) + (" and so on" if len(doubtful) > most else "")
    wrong = f"about {report['expected_wrong']:.2g} are expected to be wrong"
    if report["unlisted_wrong"] is not None:
        wrong += f"; of the others at most {100 * report['unlisted_wrong']:.3g} % on average"
    count = f"{len(doubtful)} of {len(report['slices'])}"
    return [f"check these slices, the most doubtful first: {listed} ({count}; {wrong})"]


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
            "check the input's slices, or lower the smallest area that counts",
        )
    return curves
