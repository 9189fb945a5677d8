"""The surface of one structure, as the later stages know it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from cccd.containers import Frame
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh

__all__ = ["Surface"]


def _nothing() -> dict[str, Any]:
    return {}


@dataclass
class Surface:
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
    """

    bodies: list[ControlMesh]
    mesh: Mesh
    frame: Frame
    report: dict[str, Any] = field(default_factory=_nothing)

    @property
    def vertices(self) -> FloatArray:
        """The mesh's vertices (V, 3) in mm RAS."""
        return self.mesh.vertices

    @property
    def faces(self) -> IntArray:
        """The mesh's faces (F, 3), counter-clockwise from outside."""
        return self.mesh.faces
