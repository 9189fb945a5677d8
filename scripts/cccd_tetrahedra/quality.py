"""What tetrahedra are worth to a solver: their angles and shapes, and the volume that they hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cccd.geometry.arrays import FloatArray
from cccd.geometry.mesh import Mesh
from cccd.tolerances import SOLID_VOLUME
from cccd_tetrahedra.filling import TetrahedralMesh
from cccd_tetrahedra.quadratic import jacobian_bounds
from cccd_tetrahedra.shapes import dihedral_angles, radius_ratios, scaled_jacobians

#: A tetrahedron with an angle below this makes a solver's equations badly conditioned (Shewchuk 2002).
LEAST_DIHEDRAL_DEG = 5.0


def measure_tetrahedra(filled: TetrahedralMesh, organs: Mapping[str, Mesh]) -> dict[str, Any]:
    """Measure the tetrahedra of each organ, and count the faces of each group.

    Parameters
    ----------
    filled : TetrahedralMesh
    organs : mapping of str to Mesh
        The surfaces that were filled.

    Returns
    -------
    dict
        Plain JSON: ``tetrahedra``, ``vertices``, ``groups`` (faces of each) and ``organs``: of each
        ``tetrahedra``, ``volume_ml``, ``volume_ratio`` (within the surface, by its own),
        ``least_dihedral_deg`` with ``min``, ``p5`` and ``median`` of the tetrahedra's smallest angles,
        ``radius_ratio`` and ``scaled_jacobian`` likewise; of quadratic ones also ``jacobian``, the least
        anywhere in each by that of the straight one. Quadratic meshes also have ``boundary_edges`` and, of
        these, ``straight_edges``.
    """
    curved = (
        {}
        if filled.middles is None
        else {"boundary_edges": filled.boundary_edges, "straight_edges": filled.straight_edges}
    )
    return {
        "tetrahedra": len(filled.tetrahedra),
        "vertices": len(filled.vertices),
        **curved,
        "groups": dict(zip(filled.group_names, np.bincount(filled.groups).tolist(), strict=True)),
        "organs": {name: _measure_organ(filled, n, organs[name]) for n, name in enumerate(filled.names)},
    }


def _measure_organ(filled: TetrahedralMesh, region: int, surface: Mesh) -> dict[str, Any]:
    own = filled.regions == region
    corners = filled.vertices[filled.tetrahedra[own]]
    volume = float(filled.volumes[own].sum())
    curved = (
        {}
        if filled.middles is None
        else {"jacobian": _low_end(jacobian_bounds(filled.vertices[filled.nodes[own]])[:, 0])}
    )
    return {
        "tetrahedra": int(own.sum()),
        "volume_ml": volume / 1000,
        "volume_ratio": float(filled.volumes[filled.inside[:, region]].sum()) / surface.volume,
        "least_dihedral_deg": _low_end(dihedral_angles(corners).min(axis=1)),
        "radius_ratio": _low_end(radius_ratios(corners)),
        "scaled_jacobian": _low_end(scaled_jacobians(corners)),
        **curved,
    }


def _low_end(values: FloatArray) -> dict[str, float]:
    least, low, median = np.percentile(values, [0, 5, 50]).tolist()
    return {"min": least, "p5": low, "median": median}


def warnings_of(report: Mapping[str, Any]) -> list[str]:
    """Say what the tetrahedra of a report fall short of."""
    found: list[str] = []
    for name, organ in report["organs"].items():
        if abs(organ["volume_ratio"] - 1) > SOLID_VOLUME:
            found.append(
                f"the tetrahedra have {organ['volume_ratio']:.2%} of the volume of {name}: "
                "lower surface.tetrahedra.tolerance_mm"
            )
        least = organ["least_dihedral_deg"]["min"]
        if least < LEAST_DIHEDRAL_DEG:
            found.append(
                f"the tetrahedra of {name} have angles down to {least:.1f} degrees: "
                "lower surface.tetrahedra.edge_mm"
            )
    return found
