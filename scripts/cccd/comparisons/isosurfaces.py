"""Our surface beside those of today's methods, on the same structure, measured alike."""

from __future__ import annotations

import time

import pandas as pd

from cccd.comparisons.baselines.surfaces import SURFACES
from cccd.containers import Curves, Structure
from cccd.settings.comparisons import IsosurfaceSettings
from cccd.surface import Surface
from cccd.surface.measure import measure_mesh

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
        Ours.
    settings : IsosurfaceSettings
        Names the methods to run.

    Returns
    -------
    DataFrame
        One row per method: Dice, ASSD and 95 % Hausdorff distance in mm, volume bias, bending per
        area, triangles, bytes (of the mesh; of the control net for ours), seconds, soundness.
    """
    ours = measure_mesh(surface.mesh, structure)
    rows = [{"method": "CCCD", **ours, "bytes": surface.report["control_bytes"], "seconds": None}]
    wanted = settings.methods if structure.mask is not None else []
    for name, method in SURFACES.items():
        if name not in wanted:
            continue
        start = time.perf_counter()
        mesh = method.run(structure, curves)
        seconds = time.perf_counter() - start
        rows.append({"method": method.title, **measure_mesh(mesh, structure), "seconds": seconds})
    return pd.DataFrame(rows)
