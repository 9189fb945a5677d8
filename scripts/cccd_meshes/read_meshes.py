"""Surfaces from files: triangle meshes, our own splines, and CAD solids, in mm RAS.

Coordinates are taken as mm in RAS. A file that says otherwise is converted: one with a line ``SPACE=LPS``, as
3D Slicer writes it, and glTF, which is in metres with y up by its standard.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from cccd.errors import InputError
from cccd.extras import needing
from cccd.files import TO_GLTF
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import DRAWN, LARGE
from cccd.inputs.grid import LPS_TO_RAS
from cccd.inputs.readers import guarded
from cccd.plugins import find, table
from cccd.store import read_bodies, read_ply

#: Suffixes of solids, which another package reads.
CAD_SUFFIXES = tuple(kind for kind, reader in table("READERS").items() if reader.holds == "mesh")

#: A glTF file whose organ would be longer than this was written in mm, against the standard.
_MOST_METRES = 10.0

#: Text formats and headers say within so many bytes in which space they are.
_HEAD = 4096


class MeshFile(NamedTuple):
    """A surface as it was read.

    Attributes
    ----------
    mesh : Mesh
        In mm RAS, equal vertices merged; it may be open, and turned inside out.
    notes : tuple of str
        What a user should know about the reading, one line each.
    """

    mesh: Mesh
    notes: tuple[str, ...] = ()


def is_mesh(path: Path) -> bool:
    """Whether a file's name is that of a surface that `read_mesh` reads."""
    return path.name.lower().endswith(MESH_SUFFIXES)


def read_mesh(path: str | Path) -> MeshFile:
    """Read a surface.

    Parameters
    ----------
    path : path
        PLY, STL, OBJ, GLB, glTF, VTP, GIfTI, the workflow's ``surface.h5``, STEP, IGES or BREP.

    Raises
    ------
    InputError
        Another suffix, not readable, or without triangles.

    Examples
    --------
    >>> import tempfile
    >>> from cccd.files import binary_stl
    >>> corner = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    >>> tetrahedron = Mesh(corner, np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]))
    >>> path = Path(tempfile.mkdtemp()) / "solid.stl"
    >>> _ = path.write_bytes(binary_stl(tetrahedron, "mm"))
    >>> read_mesh(path).mesh.is_closed_manifold
    True
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if not is_mesh(path):
        raise InputError(path.name, "not a surface", f"give one of {', '.join(MESH_SUFFIXES)}")
    if not path.is_file():
        raise InputError(path.name, "there is no such file", "correct the path")
    with guarded(path.name, "not a readable surface", "export it again"):
        found = _READERS[suffix](path)
    if not len(found.mesh.faces):
        raise InputError(path.name, "it contains no triangles", "export it as a triangle mesh")
    if not np.isfinite(found.mesh.vertices).all():
        raise InputError(path.name, "it contains coordinates that are not finite", "export it again")
    return found


def _polygons(path: Path) -> MeshFile:
    """Read PLY, STL or OBJ."""
    import trimesh

    loaded = cast(Any, trimesh).load(path, process=False, force="mesh")
    mesh = _merged(loaded.vertices, loaded.faces)
    with path.open("rb") as file:
        head = file.read(_HEAD)
    return MeshFile(mesh.transformed(LPS_TO_RAS) if b"SPACE=LPS" in head else mesh)


def _gltf(path: Path) -> MeshFile:
    import trimesh

    scene = cast(Any, trimesh).load(path, process=False, force="scene")
    parts: list[Mesh] = []
    for node in scene.graph.nodes_geometry:
        affine, name = scene.graph[node]
        if hasattr(scene.geometry[name], "faces"):
            part = _merged(scene.geometry[name].vertices, scene.geometry[name].faces)
            parts.append(part.transformed(np.asarray(affine, float)))
    mesh = Mesh.joined(parts)
    metres = float(np.ptp(mesh.vertices, axis=0).max()) if len(mesh.vertices) else 0.0
    if metres > _MOST_METRES:
        note = f"{path.name}: taken as mm RAS; in metres, glTF's unit, it would be {metres:.4g} m long"
        return MeshFile(mesh, (note,))
    return MeshFile(mesh.transformed(np.linalg.inv(TO_GLTF)))


def _vtp(path: Path) -> MeshFile:
    import pyvista  # VTK takes a second to load

    found = cast(Any, pyvista).read(path, force_ext=".vtp").triangulate()
    mesh = _merged(found.points, found.regular_faces)
    said = [found.field_data[name] for name in ("Space", "SPACE") if name in found.field_data]
    lps = any(str(texts[0]).upper() == "LPS" for texts in said if len(texts))
    return MeshFile(mesh.transformed(LPS_TO_RAS) if lps else mesh)


def _gifti(path: Path) -> MeshFile:
    from nibabel.loadsave import load

    image = cast(Any, load(path))
    (points,) = image.get_arrays_from_intent("NIFTI_INTENT_POINTSET")
    (triangles,) = image.get_arrays_from_intent("NIFTI_INTENT_TRIANGLE")
    return MeshFile(_merged(points.data, triangles.data))


def _splines(path: Path) -> MeshFile:
    """Read ``surface.h5``: the mesh beside it, which shared walls change, or else the splines' own."""
    beside = path.with_suffix(".ply")
    if beside.is_file():
        return MeshFile(read_ply(beside))
    bodies = read_bodies(path)
    times = DRAWN - (sum(len(body.quads) for body in bodies) > LARGE)  # as the mesh of all has
    return MeshFile(Mesh.joined([body.tessellate(times) for body in bodies]))


def _solid(path: Path) -> MeshFile:
    with needing(path.name, "cad"):
        vertices, faces = find(table("READERS")[path.suffix.lower()].read)(path)
    return MeshFile(_merged(vertices, faces))


_READERS: dict[str, Callable[[Path], MeshFile]] = {
    **dict.fromkeys((".ply", ".stl", ".obj"), _polygons),
    **dict.fromkeys((".glb", ".gltf"), _gltf),
    ".vtp": _vtp,
    ".gii": _gifti,
    ".h5": _splines,
    **dict.fromkeys(CAD_SUFFIXES, _solid),
}

#: Suffixes of every file that `read_mesh` reads.
MESH_SUFFIXES = tuple(_READERS)


def _merged(vertices: Any, faces: Any) -> Mesh:
    """Make a mesh of triangles whose vertices many formats repeat; faces without area at a corner go."""
    points: FloatArray = np.asarray(vertices, float).reshape(-1, 3)
    corners: IntArray = np.asarray(faces, np.int64).reshape(-1, 3)
    _, first, same = np.unique(points, axis=0, return_index=True, return_inverse=True)
    kept = np.sort(first)  # in the file's order
    corners = np.searchsorted(kept, first[same.ravel()])[corners]
    whole = np.all(corners != np.roll(corners, 1, axis=1), axis=1)
    return Mesh(points[kept], corners[whole])
