"""Surfaces to tetrahedra and what they are worth."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cccd.containers import Frame
from cccd.geometry.mesh import Mesh
from cccd.inputs.grid import Volume
from cccd.settings.surface import TetrahedraSettings
from cccd_tetrahedra.filling import TetrahedralMesh, fill_organs, sizes_in_mm
from cccd_tetrahedra.materials import assign_materials, check_materials
from cccd_tetrahedra.quality import measure_tetrahedra, warnings_of


def fill_and_measure(
    organs: Mapping[str, Mesh],
    settings: TetrahedraSettings,
    frames: Mapping[str, Frame],
    scans: Mapping[str, Volume] | None = None,
) -> tuple[TetrahedralMesh, dict[str, Any]]:
    """Fill organs as `fill_organs` does, give them the grey values of their scans, and report it.

    Parameters
    ----------
    organs, settings, frames
        See `fill_organs`.
    scans : mapping of str to Volume, optional
        Each organ's scan; a table of materials (``settings.materials``) needs it.

    Returns
    -------
    TetrahedralMesh
    dict
        Plain JSON: ``edge_mm`` and ``tolerance_mm`` as asked for, ``seconds``, what
        `measure_tetrahedra` and `assign_materials` find, ``warnings``.
    """
    scans = scans or {}
    rows = check_materials(settings.materials, organs, scans) if settings.materials else None
    began = time.perf_counter()
    filled = fill_organs(organs, settings, frames)
    seconds = round(time.perf_counter() - began, 1)
    edge, tolerance = sizes_in_mm(organs, settings)
    report: dict[str, Any] = {"edge_mm": edge, "tolerance_mm": tolerance, "seconds": seconds}
    report |= measure_tetrahedra(filled, organs)
    if scans.keys() >= organs.keys():
        filled, found = assign_materials(filled, scans, rows, Path(settings.materials or "").name)
        report |= found
    return filled, {**report, "warnings": warnings_of(report)}
