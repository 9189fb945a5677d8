"""The surface of one structure, as the later stages know it, and as its files give it back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from cccd.bands import Band
from cccd.containers import Frame
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd.store import (
    NOTE,
    atomic_path,
    read_band,
    read_bodies,
    read_ply,
    read_report,
    read_surface_frame,
    write_control_meshes,
    write_ply,
)

#: Vertices this near are the same; a PLY mesh keeps them exactly, older ones as single floats.
_SAME_POINT_MM = 1e-3


@dataclass
class LoftedSurface:
    """The surface of one structure.

    Attributes
    ----------
    bodies : list of ControlMesh
        Closed Catmull-Clark splines in mm RAS, a cavity's turned inside out.
    mesh : Mesh
        Their tessellation in mm RAS.
    frame : Frame
        The grid of the source volume.
    report : dict
        Plain JSON: bodies, cavities, cut ends, control points, bytes, warnings.
    band : Band or None
        How far off the mesh may be; None where nothing tells.
    whole : LoftedSurface or None
        With the spline's own tessellation, where triangles are few: intervals are of that.
    """

    bodies: list[ControlMesh]
    mesh: Mesh
    frame: Frame
    report: dict[str, Any] = field(default_factory=dict[str, Any])
    band: Band | None = None
    whole: LoftedSurface | None = None

    @property
    def vertices(self) -> FloatArray:
        """The mesh's vertices (V, 3) in mm RAS."""
        return self.mesh.vertices

    @property
    def volume_interval(self) -> tuple[float, float] | None:
        """Lowest and highest volume in mm^3, the spline's where triangles are few; None without a band."""
        whole = self.whole or self
        return self.band and whole.band and whole.band.volume_interval(whole.mesh)

    @property
    def band_figures(self) -> dict[str, Any]:
        """The band's share, volume interval in ml and mean width in mm; whether it is extrapolated."""
        interval, area = self.volume_interval, self.mesh.vertex_areas
        if self.band is None or interval is None:
            return {}
        return {
            "band": self.band.share,
            "volume_low_ml": interval[0] / 1000,
            "volume_high_ml": interval[1] / 1000,
            "inner_mean_mm": float(area @ self.band.inner / area.sum()),
            "outer_mean_mm": float(area @ self.band.outer / area.sum()),
            "band_extrapolated": self.band.extrapolated,
        }

    def sides(self) -> dict[str, LoftedSurface]:
        """Return the error band's surfaces, ``inner`` and ``outer``; nothing without a band."""
        if self.band is None:
            return {}
        meshes = self.band.sides(self.mesh).items()
        return {name: replace(self, bodies=[], mesh=mesh, band=None) for name, mesh in meshes}

    @property
    def faces(self) -> IntArray:
        """The mesh's faces (F, 3), counter-clockwise from outside."""
        return self.mesh.faces


def read_surface(path: str | Path, mesh_path: str | Path) -> LoftedSurface:
    """Read back what the lofting wrote: ``surface.h5`` and the PLY mesh.

    Organs that share their walls have another mesh than their control meshes': it has no ``bodies``.
    """
    mesh, bodies = read_ply(mesh_path), read_bodies(path)
    bodies = bodies if _is_of(mesh, bodies) else []
    band = read_band(path, mesh.vertices)
    return LoftedSurface(bodies, mesh, read_surface_frame(path), read_report(path), band)


def write_files(surface: LoftedSurface, path: str | Path, mesh_path: str | Path) -> None:
    """Write ``surface.h5`` and the PLY mesh, as `read_surface` reads them."""
    band = None if surface.band is None else (surface.band, surface.vertices)
    write_control_meshes(path, surface.bodies, surface.frame, surface.report, band)
    with atomic_path(mesh_path) as part:
        write_ply(part, surface.mesh, NOTE)


def _is_of(mesh: Mesh, bodies: Sequence[ControlMesh]) -> bool:
    """Whether a mesh is a tessellation of control meshes: it has their limits among its vertices."""
    limits = [body.tessellate(0).vertices for body in bodies]
    return all(bool(np.all(cKDTree(mesh.vertices).query(part)[0] < _SAME_POINT_MM)) for part in limits)
