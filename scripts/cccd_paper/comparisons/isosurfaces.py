"""Our surface beside those of today's methods, on the same structure, measured alike."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import pandas as pd

from cccd.containers import Curves, Structure
from cccd.geometry.mesh import Mesh
from cccd.surface import Surface
from cccd.surface.measure import Reference, control_bytes, measure_mesh
from cccd_paper.comparisons.baselines.surfaces import FAMILIES, SURFACES
from cccd_paper.comparisons.tuning import SAMPLES, Truth, tuned_rows
from cccd_paper.settings import IsosurfaceSettings

__all__ = ["compare_isosurfaces"]


def compare_isosurfaces(
    structure: Structure, curves: Curves, surface: Surface, settings: IsosurfaceSettings
) -> pd.DataFrame:
    """Measure every method on one structure.

    Parameters
    ----------
    structure : Structure
        With its mask; without one only our own row can be measured.
    curves : Curves
        Whose points the point-based methods get.
    surface : Surface
        Ours; it comes from the run and is not made again, so it has no seconds here.
    settings : IsosurfaceSettings
        Names the methods to run. One whose package is not installed has no row.

    Returns
    -------
    DataFrame
        One row per method, and up to two for a tuned one (`cccd_paper.comparisons.tuning`): Dice, ASSD and
        95 % Hausdorff distance in mm, volume bias, bending per area, triangles, bytes (of the mesh; ours
        those of its control mesh as stored, beside ``mesh_bytes``), seconds, soundness.
    """
    if structure.mask is None:
        return pd.DataFrame([_own_row(surface, partial(measure_mesh, structure=structure))])
    truth = Truth(Reference.of(structure))

    def measure(mesh: Mesh) -> dict[str, Any]:
        return measure_mesh(mesh, structure, reference=truth.reference, samples=SAMPLES)

    rows = [_own_row(surface, measure)]
    bends = rows[0]["curvature_per_area_mm"]
    for name in settings.methods:
        if name in SURFACES and SURFACES[name].available():
            start = time.perf_counter()
            mesh = SURFACES[name].run(structure, curves)
            seconds = time.perf_counter() - start
            rows.append({"method": name, **measure(mesh), "seconds": seconds})
        elif name in FAMILIES and FAMILIES[name].available():
            rows += tuned_rows(FAMILIES[name], structure, structure, truth, bends)
    return pd.DataFrame(rows)


def _own_row(surface: Surface, measure: Callable[[Mesh], dict[str, Any]]) -> dict[str, Any]:
    """Measure our mesh in the bytes of the splines that it is read off."""
    figures = measure(surface.mesh)
    size = {"bytes": control_bytes(surface), "mesh_bytes": figures["bytes"]}
    return {"method": "CCCD", "chosen": None, "setting": None, **figures, "seconds": None, **size}
