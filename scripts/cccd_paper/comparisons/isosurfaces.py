"""Our surface beside those of today's methods, on the same structure, measured alike."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import pandas as pd

from cccd.containers import Curves, Structure
from cccd.contours import trace_contours
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import LoftSettings
from cccd.store import bodies_bytes
from cccd.surface.loft import loft_surface
from cccd.surface.surface import LoftedSurface
from cccd_paper.comparisons.baselines.surfaces import FAMILIES, SURFACES
from cccd_paper.comparisons.timing import timed
from cccd_paper.comparisons.tuning import SAMPLES, Truth, tuned_rows
from cccd_paper.settings import IsosurfaceSettings
from cccd_workflow.surface_measures import Reference, measure_mesh


def compare_isosurfaces(
    structure: Structure,
    curves: Curves,
    surface: LoftedSurface,
    settings: IsosurfaceSettings,
    lofting: LoftSettings,
) -> pd.DataFrame:
    """Measure every method on one structure.

    Parameters
    ----------
    structure : Structure
        With its mask; without one only our own row can be measured.
    curves : Curves
        Whose points the point-based methods get.
    surface : LoftedSurface
        Ours, as it came from the run.
    settings : IsosurfaceSettings
        Names the methods to run. One whose package is not installed has no row.
    lofting
        Section ``surface`` of the configuration: ours is made once more by it, to be timed as the others are,
        from the mask on.

    Returns
    -------
    DataFrame
        One row per method, and up to three for a tuned one (`cccd_paper.comparisons.tuning`): Dice, ASSD and
        95 % Hausdorff distance in mm, volume bias, bending per area, triangles, bytes (of the mesh; ours
        those of its control mesh as stored, beside ``mesh_bytes``), processor seconds, soundness.
    """
    if structure.mask is None:
        return pd.DataFrame([_own_row(surface, partial(measure_mesh, structure=structure), None)])
    truth = Truth(Reference.of(structure))

    def measure(mesh: Mesh) -> dict[str, Any]:
        return measure_mesh(mesh, structure, reference=truth.reference, samples=SAMPLES)

    _, seconds = timed(lambda: loft_surface(structure.sections(trace_contours(structure)), lofting))
    rows = [_own_row(surface, measure, seconds)]
    bends = rows[0]["curvature_per_area_mm"]
    for name in settings.methods:
        if name in SURFACES and SURFACES[name].available():
            mesh, seconds = timed(SURFACES[name].run, structure, curves)
            rows.append({"method": name, **measure(mesh), "seconds": seconds})
        elif name in FAMILIES and FAMILIES[name].available():
            rows += tuned_rows(FAMILIES[name], structure, structure, truth, bends)
    return pd.DataFrame(rows)


def _own_row(
    surface: LoftedSurface, measure: Callable[[Mesh], dict[str, Any]], seconds: float | None
) -> dict[str, Any]:
    """Measure our mesh in the bytes of the splines that it is read off."""
    figures = measure(surface.mesh)
    size = {"bytes": bodies_bytes(surface.bodies), "mesh_bytes": figures["bytes"]}
    return {"method": "CCCD", "chosen": None, "setting": None, **figures, "seconds": seconds, **size}
