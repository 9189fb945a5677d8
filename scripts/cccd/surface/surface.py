"""The surface of one structure, as the later stages know it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from cccd.containers import Frame
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.bsplines import Patch
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh

__all__ = ["Surface"]


def _nothing() -> dict[str, Any]:
    return {}


def _no_bodies() -> list[ControlMesh]:
    return []


@dataclass
class Surface:
    """The surface of one structure.

    Attributes
    ----------
    patches : list of Patch
        Control nets in mm RAS.
    mesh : Mesh
        Their closed mesh in mm RAS, blended where tubes meet.
    frame : Frame
        The grid of the source volume.
    report : dict
        Plain JSON: tubes, branches, caps, cut ends, control points, bytes, warnings.
    bodies : list of ControlMesh
        Closed Catmull-Clark splines in mm RAS of which ``mesh`` is the tessellation, a cavity's turned
        inside out; none where the surface was made of tubes.
    """

    patches: list[Patch]
    mesh: Mesh
    frame: Frame
    report: dict[str, Any] = field(default_factory=_nothing)
    bodies: list[ControlMesh] = field(default_factory=_no_bodies)

    @property
    def vertices(self) -> FloatArray:
        """The mesh's vertices (V, 3) in mm RAS."""
        return self.mesh.vertices

    @property
    def faces(self) -> IntArray:
        """The mesh's faces (F, 3), counter-clockwise from outside."""
        return self.mesh.faces
