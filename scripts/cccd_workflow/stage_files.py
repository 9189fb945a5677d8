"""What stages leave for others next to structure and surface: pixels, ordered curves, their splines."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from cccd.containers import Boundaries, Curves, FittedCurves, Frame, Sections, Splines, Structure
from cccd.store import new_file, open_file, read_fields, read_structure, read_value, write_fields, write_value

Found = TypeVar("Found")


def by_organ(read: Callable[..., Found], *files: Iterable[str]) -> dict[str, Found]:
    """Read a file, or several together, of each organ of a case: its folder is the organ's name."""
    return {Path(own[0]).parent.name: read(*own) for own in zip(*files, strict=True)}


def read_sections(contours: str | Path, structure: str | Path) -> Sections:
    """Read what a surface is lofted from: ``contours.h5``, and what ``structure.h5`` knows of its slices."""
    return read_structure(structure).sections(read_curves(contours))


def read_compared(path: str | Path) -> Structure:
    """Read ``structure.h5`` for comparisons: a mask that knows some slices only is none to compare with."""
    structure = read_structure(path)
    if structure.annotation is not None:
        structure.mask = None
    return structure


def read_structure_facts(path: str | Path) -> tuple[Frame, dict[str, Any], list[str]]:
    """Read the frame, the provenance and the warnings of ``structure.h5``, and none of its arrays."""
    with open_file(path) as file:
        kinds = {"frame": Frame, "provenance": dict[str, Any], "warnings": list[str]}
        frame, provenance, warnings = (read_value(file, name, kind) for name, kind in kinds.items())
        return frame, provenance, warnings


def write_boundaries(path: str | Path, boundaries: Boundaries) -> None:
    """Write ``boundaries.h5``."""
    with new_file(path) as file:
        write_fields(file.create_group("pixels"), boundaries)


def read_boundaries(path: str | Path) -> Boundaries:
    """Read ``boundaries.h5``."""
    with open_file(path) as file:
        return read_fields(file["pixels"], Boundaries)


def write_contours(path: str | Path, curves: Curves, report: Mapping[str, Any]) -> None:
    """Write ``contours.h5``: ordered closed curves, the same whichever way they came.

    Parameters
    ----------
    path : path
        Where.
    curves : Curves
        The ordered curves.
    report : mapping
        Plain JSON: ``method``, and what that way counted.
    """
    with new_file(path) as file:
        write_value(file, "report", report, dict[str, Any])
        write_fields(file.create_group("ordered"), curves)


def write_curves(path: str | Path, fitted: FittedCurves) -> None:
    """Write ``curves.h5``: the ordered curves again, and what describes them beside them."""
    with new_file(path) as file:
        write_value(file, "report", fitted.report, dict[str, Any])
        write_fields(file.create_group("ordered"), fitted.curves)
        write_value(file, "chain_codes/codes", np.asarray(fitted.codes, np.uint8), np.uint8)
        write_value(file, "chain_codes/offsets", np.asarray(fitted.curves.offsets, np.int64), np.int64)
        write_value(file, "corners/points", np.asarray(fitted.corners, np.float64), np.float64)
        write_value(file, "corners/offsets", np.asarray(fitted.corner_offsets, np.int64), np.int64)
        write_fields(file.create_group("splines"), fitted.splines)


def read_curves(path: str | Path) -> Curves:
    """Read the ordered curves of ``contours.h5`` or ``curves.h5``."""
    with open_file(path) as file:
        return read_fields(file["ordered"], Curves)


def read_corners(path: str | Path) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Read the corner points (K, 2) of ``curves.h5`` and their offsets (C + 1,)."""
    with open_file(path) as file:
        return read_value(file, "corners/points", np.ndarray), read_value(file, "corners/offsets", np.ndarray)


def read_splines(path: str | Path) -> Splines:
    """Read the closed splines of ``curves.h5``."""
    with open_file(path) as file:
        return read_fields(file["splines"], Splines)
