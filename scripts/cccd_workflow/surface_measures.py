"""What ``metrics.json`` tells of a structure's surface."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cccd.containers import Structure
from cccd.geometry.mesh import Mesh
from cccd.store import bodies_bytes
from cccd.surface.measure import Reference, is_known, measure_band, measure_mesh
from cccd.surface.surface import LoftedSurface
from cccd.tolerances import VOLUME_BIAS

#: What of the lofting's report is no figure, or measured anew.
_UNMEASURED = ("warnings", "vertices")


def volume_warnings(figures: Mapping[str, Any]) -> list[str]:
    """Say so when a surface holds much more or less than its organ, as one does that lost a part."""
    bias = float(figures.get("volume_bias", 0.0))
    if abs(bias) <= VOLUME_BIAS:
        return []
    return [
        f"the surface's volume is {abs(bias):.0%} {'below' if bias < 0 else 'above'} the organ's: check it"
    ]


def measure_surface(surface: LoftedSurface, structure: Structure) -> dict[str, Any]:
    """Everything for ``metrics.json``: the mesh's figures, what the lofting reported, the bytes kept."""
    reported = {key: value for key, value in surface.report.items() if key not in _UNMEASURED}
    reference = Reference.of(structure) if is_known(structure) else None
    kept = bodies_bytes(surface.bodies)
    compactness = {"compactness": reported["marching_cubes_bytes"] / kept} if kept else {}
    compared = {"reference": "mask" if structure.truth is None else "true surface"} if reference else {}
    return {
        **measure_mesh(surface.mesh, structure, reference),
        **_size_and_place(surface.mesh),
        **compared,
        **measure_band(surface),
        **reported,
        "control_bytes": kept,
        **compactness,
    }


def _size_and_place(mesh: Mesh) -> dict[str, Any]:
    """Area, bounding box (its lowest and its highest corner) and centre of mass of a closed mesh, mm RAS."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    corners = mesh.vertices[mesh.faces] - low  # of tetrahedra whose fourth corner is the box's lowest
    volumes = np.linalg.det(corners)
    return {
        "area_mm2": mesh.area,
        "bounding_box_mm": [low.tolist(), high.tolist()],
        "centroid_mm": (low + volumes @ corners.sum(axis=1) / (4 * volumes.sum())).tolist(),
    }
