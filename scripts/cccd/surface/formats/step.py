"""STEP: every patch as a (rational) B-spline face for CAD, by OpenCASCADE."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray
from cccd.geometry.bsplines import Patch
from cccd.surface.formats import NOTE, Scan
from cccd.surface.surface import Surface

__all__ = ["write"]


def write(path: Path, surface: Surface, scan: Scan) -> None:
    """Write the patches in mm RAS, periodic where they are closed."""
    try:
        from OCP import BRepBuilderAPI, IFSelect, Interface, STEPControl
    except ImportError:
        raise InputError(
            str(path), "STEP needs OpenCASCADE", "pip install 'cadquery-ocp-novtk>=8.0'"
        ) from None
    writer = STEPControl.STEPControl_Writer()
    Interface.Interface_Static.SetCVal_s("write.step.unit", "MM")
    Interface.Interface_Static.SetCVal_s("write.step.product.name", NOTE)
    for patch in surface.patches:
        face = BRepBuilderAPI.BRepBuilderAPI_MakeFace(_bspline_surface(patch), 1e-6).Face()
        writer.Transfer(face, STEPControl.STEPControl_AsIs)
    if writer.Write(str(path)) != IFSelect.IFSelect_RetDone:
        raise InputError(
            str(path), "OpenCASCADE could not write the file", "check the folder's space and rights"
        )


def _bspline_surface(patch: Patch) -> Any:
    """Turn a patch into a ``Geom_BSplineSurface``; a closed direction becomes a periodic one."""
    from OCP import Geom, collections, gp

    nu, nv = patch.weights.shape
    poles, weights = collections.Array2_gp_Pnt(1, nu, 1, nv), collections.Array2_double(1, nu, 1, nv)
    for a in range(nu):
        for b in range(nv):
            poles.SetValue(a + 1, b + 1, gp.gp_Pnt(*(float(x) for x in patch.control_points[a, b])))
            weights.SetValue(a + 1, b + 1, float(patch.weights[a, b]))
    ku, mu = _knots(patch.knots_u, patch.degree_u, patch.closed_u)
    kv, mv = _knots(patch.knots_v, patch.degree_v, patch.closed_v)
    return Geom.Geom_BSplineSurface(
        poles, weights, ku, kv, mu, mv, patch.degree_u, patch.degree_v, patch.closed_u, patch.closed_v
    )


def _knots(vector: FloatArray, degree: int, closed: bool) -> tuple[Any, Any]:
    """Distinct knots, and how often each one stands there."""
    from OCP import collections

    values, times = np.unique(vector[degree : len(vector) - degree], return_counts=True)
    if not closed:
        times[[0, -1]] += degree
    knots = collections.Array1_double(1, len(values))
    multiplicities = collections.Array1_int(1, len(values))
    for n, (value, count) in enumerate(zip(values, times, strict=True)):
        knots.SetValue(n + 1, float(value))
        multiplicities.SetValue(n + 1, int(count))
    return knots, multiplicities
