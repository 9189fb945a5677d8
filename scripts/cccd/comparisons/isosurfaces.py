"""Our surface beside those of today's methods, on the same structure, measured alike."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import pandas as pd

from cccd.comparisons.point_meshes import alpha_shape, ball_pivoting, poisson
from cccd.comparisons.volume_meshes import (
    Mesh,
    distance_isosurface,
    flying_edges,
    marching_cubes,
    surface_nets,
    windowed_sinc,
)
from cccd.containers import Curves, Structure
from cccd.surface import Surface
from cccd.surface.measure import measure_mesh

__all__ = ["compare_isosurfaces"]


def compare_isosurfaces(
    structure: Structure, curves: Curves, surface: Surface, settings: Mapping
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
    settings : mapping
        Section ``comparisons`` of the configuration: ``isosurfaces.methods`` names those to run.

    Returns
    -------
    DataFrame
        One row per method: Dice, ASSD and 95 % Hausdorff distance in mm, volume bias, bending per
        area, triangles, bytes (of the mesh; of the control net for ours), seconds, soundness.
    """
    ours = measure_mesh(surface.vertices, surface.faces, structure)
    rows = [{"method": "CCCD", **ours, "bytes": surface.report["control_bytes"], "seconds": None}]
    makers: dict[str, Callable[[], Mesh]] = {
        "marching cubes": lambda: marching_cubes(structure),
        "flying edges + windowed sinc": lambda: windowed_sinc(flying_edges(structure)),
        "surface nets": lambda: surface_nets(structure),
        "signed distance + isosurface": lambda: distance_isosurface(structure),
        "signed distance + isosurface + windowed sinc": lambda: windowed_sinc(distance_isosurface(structure)),
        "ball pivoting": lambda: ball_pivoting(curves),
        "Poisson": lambda: poisson(curves),
        "alpha shape": lambda: alpha_shape(curves),
    }
    if structure.mask is None:
        makers = {}
    wanted = settings["isosurfaces"]["methods"]
    makers = {method: make for method, make in makers.items() if method in wanted}
    for method, make in makers.items():
        start = time.perf_counter()
        mesh = make()
        seconds = time.perf_counter() - start
        rows.append({"method": method, **measure_mesh(*mesh, structure), "seconds": seconds})
    return pd.DataFrame(rows)
