"""Tetrahedra by Gmsh, where the user has it: called as a program, because its licence is the GPL.

Surfaces are cut into pieces that are flat enough to have coordinates, meshed anew in those (Remacle et al.
2010), and the bodies between them filled (Delaunay). STEP solids are meshed on their own splines.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.collisions import passing_pairs
from cccd.geometry.distance import nearest_faces, to_mesh
from cccd.geometry.mesh import Mesh
from cccd.settings.formats import COLOUR
from cccd.solids.bodies import split_bodies
from cccd.solids.build import build_solids, write_organs

__all__ = ["fill_solids", "fill_surfaces", "require_gmsh", "rows_as_text", "search_path"]

#: Vertices of one organ that are tried for lying in another.
TRIED = 100

#: Points nearer to a surface, in mm, lie on it.
ON_SURFACE_MM = 1e-6

# Faces of the surface that meet at more than this angle keep the edge between them: lids where the scan cuts
# an organ meet its wall at more, triangles of smooth walls at less.
_SHARP_DEG = 40.0

# Edges are no shorter than this many times the tolerance: on a radius of the tolerance a chord is as long,
# and shorter ones follow nothing that is asked for.
_SHORTEST = 2.0

# On splines, edges are as short as the tolerance asks on a radius of this times that of a ball of the organ's
# volume by surface. By curvature Gmsh takes minutes on a thousand splines, so all edges have one size; folds
# bend more than the ball. Of this size a brain has 41,000 tetrahedra, and its volume to 0.01 %.
_BENDS = 0.25

#: Gmsh's numbers of a triangle and a tetrahedron, and how many vertices they have.
_CORNERS = {2: 3, 4: 4}


def require_gmsh() -> str:
    """Find the program.

    Raises
    ------
    InputError
        Where it is not installed.
    """
    program = shutil.which("gmsh", path=search_path())
    if program is None:
        raise InputError(
            "config key surface.tetrahedra.mesher",
            "gmsh is not installed",
            "apt install gmsh, or pip install gmsh, or set it to ftetwild",
        )
    return program


def search_path() -> str:
    """Say where programs are looked for: beside Python first, where pip installs them."""
    return os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", os.defpath)])


class _Walls(NamedTuple):
    """All surfaces once, and the bodies on either side."""

    vertices: FloatArray  # (V, 3)
    faces: IntArray  # (F, 3)
    sides: IntArray  # (F, 2), numbers of the bodies, ascending; -1 where there is one only
    owners: list[str]  # the organ of each body


def fill_surfaces(organs: Mapping[str, Mesh], edge: float, tolerance: float) -> tuple[FloatArray, IntArray]:
    """Fill closed surfaces, whose walls may be shared, and which may lie in one another.

    Parameters
    ----------
    organs : mapping of str to Mesh
        Closed, in mm.
    edge, tolerance : float
        Largest edge, and distance of faces to the surface where it curves, in mm.

    Returns
    -------
    (V, 3) float64
    (N, 4) int64
        Tetrahedra of all bodies, whichever way round.

    Raises
    ------
    InputError
        Gmsh is missing or fails, or surfaces pass through each other.
    """
    walls = _walls_between(organs)
    _refuse_crossings(walls)
    pairs, tags = np.unique(walls.sides, axis=0, return_inverse=True)
    tags = tags.reshape(-1)
    sizes = _sizes(organs, edge, tolerance)
    with tempfile.TemporaryDirectory() as folder:
        _write_triangles(Path(folder, "walls.msh"), walls.vertices, walls.faces, tags)
        script = [
            'Merge "walls.msh";',
            f"ClassifySurfaces{{{float(np.radians(_SHARP_DEG))!r}, 1, 1, Pi}};",
        ]
        script += ["CreateGeometry;", *sizes]
        anew = _run(Path(folder), "walls", script, 2, organs)
        tags = _tags_of(anew, walls, tags)
        _write_triangles(Path(folder, "anew.msh"), anew.vertices, anew.triangles, tags)
        script = ['Merge "anew.msh";']
        for body in range(1, len(walls.owners) + 1):
            around = ", ".join(str(n + 1) for n in np.flatnonzero((pairs == body - 1).any(axis=1)))
            script += [f"Surface Loop({body}) = {{{around}}};", f"Volume({body}) = {{{body}}};"]
        filled = _run(Path(folder), "filled", [*script, *sizes], 3, organs)
    return filled.vertices, filled.tetrahedra


def fill_solids(
    organs: Mapping[str, Mesh],
    edge: float,
    tolerance: float,
    step_tolerance: float,
) -> tuple[FloatArray, IntArray]:
    """Fill organs that lie apart by way of a STEP file of their solids, on whose splines vertices lie.

    Parameters
    ----------
    organs, edge, tolerance
        As for `fill_surfaces`.
    step_tolerance : float
        The solids' distance to the surfaces, in mm.

    Returns
    -------
    (V, 3) float64
    (N, 4) int64

    Raises
    ------
    InputError
        Gmsh or OpenCASCADE is missing or fails, or organs touch.
    """
    require_gmsh()
    walls = _walls_between(organs)
    _refuse_crossings(walls)
    shared = walls.sides[walls.sides[:, 0] >= 0]
    if len(shared):
        first, second = (walls.owners[body] for body in shared[0].tolist())
        raise InputError(
            f"{first} and {second}",
            "they touch, and their solids share no faces",
            "set surface.tetrahedra.mesher to gmsh or ftetwild",
        )
    solids = {name: build_solids(mesh, step_tolerance) for name, mesh in organs.items()}
    bends = min(_BENDS * 3 * mesh.volume / mesh.area for mesh in organs.values())
    edge = min(edge, (8 * bends * tolerance) ** 0.5)
    with tempfile.TemporaryDirectory() as folder:
        write_organs(Path(folder, "organs.step"), solids, dict.fromkeys(solids, COLOUR), "step")
        script = ['SetFactory("OpenCASCADE");', 'Merge "organs.step";']
        # not by curvature, for which Gmsh needs minutes on a thousand splines
        script += [f"Mesh.MeshSizeMax = {float(edge)!r};", "Mesh.SaveAll = 1;"]
        filled = _run(Path(folder), "filled", script, 3, organs)
    return filled.vertices, filled.tetrahedra


# Bodies -----------------------------------------------------------------------------------------------


def _walls_between(organs: Mapping[str, Mesh]) -> _Walls:
    """Gather the surfaces of all bodies; what lies in another organ's body is a cavity of that."""
    bodies = [(name, body) for name, mesh in organs.items() for body in split_bodies(mesh)]
    shells: list[tuple[Mesh, int]] = []
    for number, (name, body) in enumerate(bodies):
        shells += [(shell, number) for shell in (body.outer, *body.cavities)]
        around = [
            other
            for other, (owner, candidate) in enumerate(bodies)
            if owner != name
            and candidate.outer.volume > body.outer.volume
            and _lies_in(body.outer, organs[owner], candidate.outer)
        ]
        if around:
            smallest = min(around, key=lambda other: bodies[other][1].outer.volume)
            shells.append((body.outer, smallest))
    counts = np.cumsum([0, *(len(shell.vertices) for shell, _ in shells)])
    points = np.concatenate([shell.vertices for shell, _ in shells])
    corners = np.concatenate([shell.faces + n for (shell, _), n in zip(shells, counts, strict=False)])
    owner = np.concatenate([np.full(len(shell.faces), body) for shell, body in shells])
    vertices, inverse = np.unique(points, axis=0, return_inverse=True)
    faces = inverse.reshape(-1)[corners]
    _, first, triangle = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_inverse=True)
    triangle = triangle.reshape(-1)
    low, high = np.full(len(first), len(bodies)), np.full(len(first), -1)
    np.minimum.at(low, triangle, owner)
    np.maximum.at(high, triangle, owner)
    sides = np.column_stack([np.where(low < high, low, -1), high])
    return _Walls(vertices, faces[first], sides, [name for name, _ in bodies])


def _lies_in(inner: Mesh, organ: Mesh, body: Mesh) -> bool:
    """Whether a surface lies in an organ, in the body of it that has another outer surface."""
    if np.any(inner.vertices.min(axis=0) < body.vertices.min(axis=0)):
        return False
    if np.any(inner.vertices.max(axis=0) > body.vertices.max(axis=0)):
        return False
    tried = inner.vertices[:: max(1, len(inner.vertices) // TRIED)]
    return all(bool(np.all(to_mesh(tried, mesh) < ON_SURFACE_MM)) for mesh in (organ, body))


def _refuse_crossings(walls: _Walls) -> None:
    """Raise `InputError` where surfaces pass through each other, which Gmsh cannot fill."""
    pairs = passing_pairs(walls.vertices, walls.faces)
    if len(pairs) == 0:
        return
    first, second = (walls.owners[body] for body in walls.sides[pairs[0], 1].tolist())
    who = f"{first} and {second}" if first != second else first
    raise InputError(
        who,
        f"triangles of their surfaces intersect in {len(pairs)} places"
        if first != second
        else f"its surface intersects itself in {len(pairs)} places",
        "set surface.shared_walls: true, or surface.tetrahedra.mesher: ftetwild",
    )


# The program ------------------------------------------------------------------------------------------


class _Found(NamedTuple):
    """What Gmsh wrote."""

    vertices: FloatArray  # (V, 3)
    triangles: IntArray  # (F, 3)
    tags: IntArray  # (F,), the surfaces' numbers
    tetrahedra: IntArray  # (N, 4)


def _sizes(organs: Mapping[str, Mesh], edge: float, tolerance: float) -> list[str]:
    """Lines of a script that set the sizes of elements."""
    # Gmsh takes the number n of chords to a circle, whatever its radius r; one lies r (pi / n)^2 / 2 off.
    # That is the tolerance where the largest edge is such a chord, and less where the radius is smaller; and
    # no edge is longer than the tolerance allows on a ball as large as all organs.
    points = np.concatenate([mesh.vertices for mesh in organs.values()])
    radius = float(np.ptp(points, axis=0).max()) / 2
    edge = min(edge, (8 * radius * tolerance) ** 0.5)
    return [
        f"Mesh.MeshSizeMax = {float(edge)!r};",
        f"Mesh.MeshSizeMin = {float(_SHORTEST * tolerance)!r};",
        f"Mesh.MeshSizeFromCurvature = {float(np.pi * edge / (4 * tolerance))!r};",
        "Mesh.MeshSizeExtendFromBoundary = 0;",  # else the short edges between pieces spread over them
        "Mesh.OptimizeNetgen = 1;",
        "Mesh.SaveAll = 1;",
    ]


def _run(
    folder: Path, name: str, script: Sequence[str], dimension: int, organs: Mapping[str, Mesh]
) -> _Found:
    """Let Gmsh follow a script, and read what it made."""
    made = folder / f"{name}_made.msh"
    (folder / f"{name}.geo").write_text("\n".join(script) + "\n", encoding="ascii")
    command = [require_gmsh(), f"{name}.geo", f"-{dimension}", "-nt", "1", "-v", "2", "-format", "msh22"]
    done = subprocess.run(
        [*command, "-o", made.name],
        cwd=folder,
        env=os.environ | {"PATH": search_path()},
        capture_output=True,
        text=True,
        check=False,
    )
    found = _read(made) if made.is_file() else None
    if found is None or len(found.triangles if dimension == 2 else found.tetrahedra) == 0:
        said = [line.strip() for line in (done.stdout + done.stderr).splitlines() if line.strip()]
        last = [line for line in said if line.startswith("Error")] or said[-1:] or ["it said nothing"]
        what = "surface" if dimension == 2 else "tetrahedra"
        raise InputError(
            ", ".join(organs), f"gmsh made no {what} ({last[0]})", "set surface.tetrahedra.mesher: ftetwild"
        )
    return found


def _tags_of(anew: _Found, walls: _Walls, tags: IntArray) -> IntArray:
    """Tell which wall each piece of a surface that was meshed anew is of: that which most of it lies on."""
    middles = anew.vertices[anew.triangles].mean(axis=1)
    nearest = tags[nearest_faces(middles, Mesh(walls.vertices, walls.faces))]
    pieces, piece = np.unique(anew.tags, return_inverse=True)
    votes = np.zeros((len(pieces), int(tags.max()) + 1), np.int64)
    np.add.at(votes, (piece.reshape(-1), nearest), 1)
    return votes.argmax(axis=1)[piece.reshape(-1)]


def _write_triangles(path: Path, vertices: FloatArray, faces: IntArray, tags: IntArray) -> None:
    """Write triangles of discrete surfaces, which are numbered from 0, in Gmsh's format 2.2."""
    numbers = np.arange(1, len(faces) + 1)
    fixed = [numbers, np.full(len(faces), 2), np.full(len(faces), 2), np.zeros_like(tags), tags + 1]
    points = (f"{n} {x!r} {y!r} {z!r}" for n, (x, y, z) in enumerate(vertices.tolist(), 1))
    parts = [
        f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(vertices)}",
        *points,
        f"$EndNodes\n$Elements\n{len(faces)}",
        rows_as_text(np.column_stack([*fixed, faces + 1]), "%d"),
        "$EndElements\n",
    ]
    path.write_text("\n".join(parts), encoding="ascii")


def _read(path: Path) -> _Found:
    """Read what Gmsh wrote in its format 2.2: every element has two tags, the second the entity's number."""
    lines = path.read_text(encoding="ascii").splitlines()
    first, second = lines.index("$Nodes") + 2, lines.index("$Elements") + 2
    nodes = np.array([line.split() for line in lines[first : lines.index("$EndNodes")]], float)
    nodes = nodes.reshape(-1, 4)
    place = np.zeros(int(nodes[:, 0].max(initial=0)) + 1, np.int64)
    place[nodes[:, 0].astype(np.int64)] = np.arange(len(nodes))
    kept: dict[int, list[list[str]]] = {kind: [] for kind in _CORNERS}
    for row in (line.split() for line in lines[second : lines.index("$EndElements")]):
        if int(row[1]) in kept:
            kept[int(row[1])].append(row)
    tables = {kind: np.array(kept[kind], np.int64).reshape(-1, 5 + count) for kind, count in _CORNERS.items()}
    triangles, tetrahedra = tables.values()
    return _Found(nodes[:, 1:], place[triangles[:, 5:]], triangles[:, 4], place[tetrahedra[:, 5:]])


def rows_as_text(numbers: npt.ArrayLike, form: str, separator: str = " ") -> str:
    """Write a row of numbers per line."""
    table = np.asarray(numbers)
    line = separator.join([form] * table.shape[1])
    return "\n".join(line % tuple(row) for row in table.tolist())
