"""Our surface beside those of today's methods, on the same structure, measured alike."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import pandas as pd

from cccd.comparisons.baselines.surfaces import FAMILIES, SURFACES
from cccd.comparisons.tuning import SAMPLES, Truth, tuned_rows
from cccd.containers import Curves, Structure
from cccd.geometry.mesh import Mesh
from cccd.settings.comparisons import IsosurfaceSettings
from cccd.surface import Surface
from cccd.surface.measure import Reference, measure_mesh, patches_mesh

__all__ = ["NETS", "compare_isosurfaces"]

#: Our surface as its control nets hold it: before its tubes are blended, and in their few bytes.
NETS = "CCCD, control nets alone"


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
        Ours.
    settings : IsosurfaceSettings
        Names the methods to run.

    Returns
    -------
    DataFrame
        One row per method, and up to two for a tuned one (see `cccd.comparisons.tuning`): Dice, ASSD and
        95 % Hausdorff distance in mm, volume bias, bending per area, triangles, bytes (of the mesh; of the
        control nets for the nets alone), seconds, soundness.
    """
    if structure.mask is None:
        return pd.DataFrame(_own_rows(surface, partial(measure_mesh, structure=structure)))
    truth = Truth(Reference.of(structure))

    def measure(mesh: Mesh) -> dict[str, Any]:
        return measure_mesh(mesh, structure, reference=truth.reference, samples=SAMPLES)

    rows = _own_rows(surface, measure)
    bends = rows[0]["curvature_per_area_mm"]
    for name in settings.methods:
        if name in SURFACES:
            start = time.perf_counter()
            mesh = SURFACES[name].run(structure, curves)
            seconds = time.perf_counter() - start
            rows.append({"method": name, **measure(mesh), "seconds": seconds})
        elif FAMILIES[name].available():
            rows += tuned_rows(FAMILIES[name], structure, structure, truth, bends)
    return pd.DataFrame(rows)


def _own_rows(surface: Surface, measure: Callable[[Mesh], dict[str, Any]]) -> list[dict[str, Any]]:
    """Measure our mesh and, in their own bytes, its control nets alone."""
    nets = measure(patches_mesh(surface)) | {"bytes": surface.report["control_bytes"]}
    return [
        {"method": "CCCD", "chosen": None, "setting": None, **measure(surface.mesh), "seconds": None},
        {"method": NETS, **nets, "seconds": None},
    ]
