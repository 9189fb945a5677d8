"""Centrelines to files: a table of branches (CSV), lines for viewers (VTP), samples for trees (SWC)."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cccd.errors import InputError
from cccd.geometry.mesh import xml_of
from cccd.store import atomic_path
from cccd_vessels.centrelines import Branch, Centrelines

if TYPE_CHECKING:
    import pyvista

#: Structure identifier of SWC samples: the format's 1 to 4 are parts of neurons.
_SWC_UNDEFINED = 0


def describe(branch: Branch) -> dict[str, Any]:
    """Return what the table has of a branch as plain JSON; None for what it does not have.

    Lengths are in mm, points in mm RAS, angles in degrees.
    """
    measured = branch.measured
    radii = branch.radius[measured]
    figures = {
        "length_mm": branch.length,
        "chord_mm": branch.chord,
        "tortuosity": branch.tortuosity,
        "mean_radius_mm": branch.mean_radius,
        "min_radius_mm": radii.min() if len(radii) else math.nan,
        "max_radius_mm": radii.max() if len(radii) else math.nan,
        "inscribed_radius_mm": branch.inscribed[measured].mean() if len(radii) else math.nan,
        "least_diameter_mm": branch.least_diameter[measured].mean() if len(radii) else math.nan,
        "largest_diameter_mm": branch.largest_diameter[measured].mean() if len(radii) else math.nan,
        "curvature_per_mm": branch.curvature[measured].mean() if len(radii) else math.nan,
        "angle_to_parent_deg": branch.angle_deg,
    }
    places = {
        f"{name}_{axis}": float(value)
        for name, point in (("start", branch.points[0]), ("end", branch.points[-1]))
        for axis, value in zip("xyz", point, strict=True)
    }
    return {
        "branch": branch.number,
        "parent": branch.parent or None,
        "generation": branch.generation,
        "start": branch.start,
        "end": branch.end,
        **{name: None if math.isnan(value) else round(float(value), 4) for name, value in figures.items()},
        **{name: round(value, 3) for name, value in places.items()},
    }


def check_suffix(path: Path) -> None:
    """Refuse a file that `write_centrelines` could not write.

    Raises
    ------
    InputError
        Another suffix.
    """
    if path.suffix.lower() not in _WRITERS:
        known = ", ".join(SUFFIXES)
        raise InputError(
            str(path), f"unknown format {path.suffix!r} of centrelines", f"choose one of {known}"
        )


def write_centrelines(path: Path, found: Centrelines) -> None:
    """Write centrelines; the suffix chooses the format.

    Parameters
    ----------
    path : path
        ``.csv``, ``.vtp`` or ``.swc``.
    found : Centrelines

    Raises
    ------
    InputError
        Another suffix.
    """
    check_suffix(path)
    with atomic_path(path) as temporary:
        temporary.write_text(_WRITERS[path.suffix.lower()](found), encoding="utf-8", newline="")


def _csv(found: Centrelines) -> str:
    import pandas as pd  # it and VTK take a second to load

    rows = [describe(branch) for branch in found.branches]
    return str(pd.DataFrame(rows, dtype=object).to_csv(index=False, lineterminator="\n"))


def _swc(found: Centrelines) -> str:
    """Write samples from the roots on; a branch goes on from the last sample of its parent."""
    lines = ["# CCCD centrelines; unit mm; space RAS", "# id type x y z radius parent"]
    last: dict[int, int] = {}
    number = 0
    for branch in found.branches:
        before = last.get(branch.parent, -1)
        first = 0 if before < 0 else 1  # a fork is a sample of the parent
        for (x, y, z), radius in zip(branch.points[first:], branch.radius[first:], strict=True):
            number += 1
            lines.append(f"{number} {_SWC_UNDEFINED} {x:.5f} {y:.5f} {z:.5f} {radius:.5f} {before}")
            before = number
        last[branch.number] = before
    return "\n".join(lines) + "\n"


def _vtp(found: Centrelines) -> str:
    """Write one line per branch, with what is known at its points, and of the branch as cell data."""
    import pyvista

    branches, counts = found.branches, [len(branch.points) for branch in found.branches]
    starts = np.cumsum([0, *counts[:-1]])
    lines = np.insert(np.arange(sum(counts)), starts, counts)
    mesh = pyvista.PolyData(np.concatenate([b.points for b in branches]), lines=lines)
    for name in ("radius", "inscribed", "least_diameter", "largest_diameter", "curvature"):
        mesh.point_data[name] = np.concatenate([getattr(b, name) for b in branches])
    mesh.point_data["measured"] = np.concatenate([b.measured for b in branches]).astype(np.uint8)
    for name in ("number", "parent", "generation", "length", "angle_deg"):
        column = {"number": "branch", "angle_deg": "angle"}.get(name, name)
        mesh.cell_data[column] = np.array([getattr(b, name) for b in branches])
    return vtp_text(mesh)


def vtp_text(mesh: pyvista.PolyData, **fields: list[str]) -> str:
    """Return VTK's XML of a mesh in mm RAS, with texts as field data."""
    for name, texts in {**fields, "SpaceUnit": ["mm"], "Space": ["RAS"]}.items():
        mesh.field_data[name] = np.array(texts)
    return xml_of(mesh)


_WRITERS: dict[str, Callable[[Centrelines], str]] = {".csv": _csv, ".vtp": _vtp, ".swc": _swc}

#: Suffixes of the files that `write_centrelines` writes.
SUFFIXES = tuple(_WRITERS)
