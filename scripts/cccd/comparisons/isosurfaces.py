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
from cccd.surface.measure import Reference, control_bytes, measure_mesh, patches_mesh

__all__ = ["NETS", "compare_isosurfaces"]

#: A surface of tubes as its control nets hold it: before they are blended, and in their few bytes.
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
        95 % Hausdorff distance in mm, volume bias, bending per area, triangles, bytes (of the mesh; ours
        those of its control mesh as stored, beside ``mesh_bytes``, or of tubes a second row for their control
        nets alone), seconds, soundness.
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
    """Measure our mesh in the bytes of the splines that it is read off; of tubes, which are not it, apart."""
    figures, kept = measure(surface.mesh), {"bytes": control_bytes(surface)}
    ours = {"method": "CCCD", "chosen": None, "setting": None, **figures, "seconds": None}
    if surface.bodies:
        return [ours | kept | {"mesh_bytes": figures["bytes"]}]
    return [ours, {"method": NETS, **measure(patches_mesh(surface)), **kept, "seconds": None}]
