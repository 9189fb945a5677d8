"""Closed meshes whose triangles are in named groups: walls, inlets and outlets for simulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cccd.errors import InputError
from cccd.extras import check_extra
from cccd.geometry.arrays import IntArray
from cccd.geometry.distance import nearest_faces
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import TetrahedraSettings
from cccd.store import atomic_path
from cccd_tetrahedra.files import WRITERS as TETRAHEDRA
from cccd_tetrahedra.filling import TetrahedralMesh, fill_organs
from cccd_vessels.files import vtp_text


@dataclass(frozen=True, eq=False)
class NamedMesh:
    """A closed mesh and what its triangles are.

    Attributes
    ----------
    mesh : Mesh
        In mm RAS.
    groups : (F,) int64
        Which of ``names`` a triangle is of.
    names : tuple of str
    """

    mesh: Mesh
    groups: IntArray
    names: tuple[str, ...]

    def group(self, name: str) -> Mesh:
        """Return the triangles of a group."""
        return Mesh(self.mesh.vertices, self.mesh.faces[self.groups == self.names.index(name)]).compact()


def check_named(path: Path) -> None:
    """Refuse a file that `write_named` could not write, before anything is computed.

    Raises
    ------
    InputError
        Another suffix, or tetrahedra without the extra ``fe``.
    """
    suffix = path.suffix[1:].lower()
    if suffix not in _WRITERS and suffix not in TETRAHEDRA:
        known = ", ".join(f".{name}" for name in (*_WRITERS, *TETRAHEDRA))
        raise InputError(
            str(path), f"{path.suffix!r} is no format with named boundaries", f"choose one of {known}"
        )
    if suffix in TETRAHEDRA:
        check_extra("fe", str(path))


def write_named(path: Path, named: NamedMesh, organ: str) -> None:
    """Write a mesh with its groups, or the tetrahedra that fill it; the suffix chooses the format.

    Parameters
    ----------
    path : path
        ``.vtp`` (cell array ``group``, from 1), ``.stl`` (text, a named solid per group), ``.obj`` (a group
        each), ``.msh``, ``.vtu``, ``.inp`` (tetrahedra with named boundaries).
    named : NamedMesh
    organ : str
        Name of the region that the tetrahedra fill.

    Raises
    ------
    InputError
        Another suffix, tetrahedra without the extra ``fe``, or a mesh that cannot be filled.
    """
    check_named(path)
    suffix = path.suffix[1:].lower()
    with atomic_path(path) as temporary:
        if suffix in TETRAHEDRA:
            TETRAHEDRA[suffix](temporary, _filled(named, organ))
        else:
            temporary.write_text(_WRITERS[suffix](named), encoding="ascii")


def _filled(named: NamedMesh, organ: str) -> TetrahedralMesh:
    """Fill a mesh; a boundary face is of the group of the triangle that is nearest to it."""
    filled = fill_organs({organ: named.mesh}, TetrahedraSettings())
    middles = filled.vertices[filled.triangles].mean(axis=1)
    groups = named.groups[nearest_faces(middles, named.mesh)]
    return replace(filled, groups=groups, group_names=named.names)


def _vtp(named: NamedMesh) -> str:
    mesh = named.mesh.to_polydata()
    mesh.cell_data["group"] = named.groups.astype(np.int32) + 1
    return vtp_text(mesh, group_names=list(named.names))


def _stl(named: NamedMesh) -> str:
    """Write text: a binary STL has no names."""
    rows: list[str] = []
    corners, normals = named.mesh.vertices[named.mesh.faces], named.mesh.unit_normals
    for number, name in enumerate(named.names):
        own = named.groups == number
        rows.append(f"solid {name}")
        rows += [
            "facet normal {:.6g} {:.6g} {:.6g}\nouter loop\n"
            "vertex {:.9g} {:.9g} {:.9g}\nvertex {:.9g} {:.9g} {:.9g}\nvertex {:.9g} {:.9g} {:.9g}\n"
            "endloop\nendfacet".format(*normal, *corner.ravel())
            for normal, corner in zip(normals[own], corners[own], strict=True)
        ]
        rows.append(f"endsolid {name}")
    return "\n".join(rows) + "\n"


def _obj(named: NamedMesh) -> str:
    rows = ["# CCCD; unit mm; space RAS"]
    rows += ["v {:.9g} {:.9g} {:.9g}".format(*vertex) for vertex in named.mesh.vertices]
    for number, name in enumerate(named.names):
        rows.append(f"g {name}")
        faces = named.mesh.faces[named.groups == number] + 1
        rows += ["f {} {} {}".format(*face) for face in faces.tolist()]
    return "\n".join(rows) + "\n"


_WRITERS: dict[str, Callable[[NamedMesh], str]] = {"vtp": _vtp, "stl": _stl, "obj": _obj}
