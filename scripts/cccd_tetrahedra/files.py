"""Tetrahedra for solvers: Gmsh 2.2 in text, VTK's unstructured grid, input of Abaqus, CalculiX and FEBio."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from cccd.files import ExportOptions
from cccd.geometry.arrays import IntArray
from cccd.geometry.mesh import xml_of
from cccd.surface.surface import LoftedSurface
from cccd_tetrahedra.build import fill_and_measure
from cccd_tetrahedra.filling import TetrahedralMesh

#: Written wherever a format has room for text.
_HEAD = "CCCD tetrahedra; unit mm; space RAS"

#: Gmsh's numbers of triangles and tetrahedra, by how many nodes they have.
_GMSH = {3: 2, 6: 9, 4: 4, 10: 11}

#: Gmsh numbers the last two middle nodes of a tetrahedron the other way round.
_GMSH_NODES = {4: [0, 1, 2, 3], 10: [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]}

#: Of one g/cm^3: solvers that take mm and MPa take densities in these.
T_PER_MM3 = 1e-9

#: Modulus, Poisson's ratio and density in FEBio's files without a table, which cannot do without materials.
NO_MATERIAL = (1.0, 0.3, T_PER_MM3)


def write(path: Path, surface: LoftedSurface, options: ExportOptions) -> dict[str, Any]:
    """Fill the surface unless that was done, and write the tetrahedra; the suffix chooses the format."""
    key = f"{options.organ} {options.settings.tetrahedra.model_dump_json()}"
    if key not in options.filled:
        organs, frames = {options.organ: surface.mesh}, {options.organ: surface.frame}
        scans = {} if options.scan is None else {options.organ: options.scan}
        options.filled[key] = fill_and_measure(organs, options.settings.tetrahedra, frames, scans)
    filled, report = options.filled[key]
    form = path.suffix[1:].lower()
    WRITERS[form](path, filled)
    return {"format": form, **report}


def _write_msh(path: Path, filled: TetrahedralMesh) -> None:
    """Write Gmsh's format 2.2, which every reader knows: a physical group per organ and per boundary."""
    groups = [(2, n, name) for n, name in enumerate(filled.group_names, 1)]
    groups += [(3, n, name) for n, name in enumerate(filled.names, len(groups) + 1)]
    numbers = np.arange(1, len(filled.vertices) + 1)
    nodes = filled.nodes[:, _GMSH_NODES[filled.nodes.shape[1]]]
    faces = _elements(1, filled.groups + 1, filled.face_nodes + 1)
    solids = _elements(len(faces) + 1, filled.regions + 1 + len(filled.group_names), nodes + 1)
    parts = [
        f"$Comments\n{_HEAD}\n$EndComments",
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat",
        f"$PhysicalNames\n{len(groups)}",
        *(f'{dimension} {number} "{name}"' for dimension, number, name in groups),
        f"$EndPhysicalNames\n$Nodes\n{len(numbers)}",
        *(f"{n} {x:.9g} {y:.9g} {z:.9g}" for n, (x, y, z) in zip(numbers, filled.vertices, strict=True)),
        f"$EndNodes\n$Elements\n{len(faces) + len(solids)}",
        _rows_as_text(faces, "%d"),
        _rows_as_text(solids, "%d"),
        "$EndElements\n",
    ]
    path.write_text("\n".join(parts), encoding="ascii")


def _elements(first: int, tags: IntArray, nodes: IntArray) -> IntArray:
    """Rows of Gmsh's elements: number, kind, two tags (physical group, entity), nodes."""
    count, each = nodes.shape
    fixed = [np.arange(first, first + count), np.full(count, _GMSH[each]), np.full(count, 2), tags, tags]
    return np.column_stack([*fixed, nodes])


def _write_vtu(path: Path, filled: TetrahedralMesh) -> None:
    """Write VTK's unstructured grid: cell data ``region`` (organ, from 1), ``group`` (of faces, from 1)."""
    # Each is 0 on the cells of the other kind; field data name them. With a scan grey is its mean in each
    # tetrahedron, and with a table of materials material (from 1), density, young and poisson.
    import pyvista  # VTK takes a second to load

    kinds = pyvista.CellType
    solid, face = (
        (kinds.TETRA, kinds.TRIANGLE)
        if filled.middles is None
        else (kinds.QUADRATIC_TETRA, kinds.QUADRATIC_TRIANGLE)
    )
    cells = {solid: filled.nodes, face: filled.face_nodes}
    grid = cast(Any, pyvista.UnstructuredGrid(cells, filled.vertices))
    faces = np.zeros(len(filled.triangles), np.int32)
    solids = np.zeros(len(filled.tetrahedra), np.int32)
    grid.cell_data["region"] = np.concatenate([filled.regions.astype(np.int32) + 1, faces])
    grid.cell_data["group"] = np.concatenate([solids, filled.groups.astype(np.int32) + 1])
    for name, values in _values(filled).items():
        kind = values.dtype.type
        grid.cell_data[name] = np.concatenate([values, np.zeros(len(faces), kind)])
    grid.field_data["region_names"] = list(filled.names)
    grid.field_data["group_names"] = list(filled.group_names)
    grid.field_data["SpaceUnit"] = ["mm"]
    grid.field_data["Space"] = ["RAS"]
    path.write_text(xml_of(grid), encoding="ascii")


def _values(filled: TetrahedralMesh) -> dict[str, npt.NDArray[Any]]:
    """Return what a scan and a table say of each tetrahedron."""
    found: dict[str, npt.NDArray[Any]] = {}
    if filled.grey is not None:
        found["grey"] = filled.grey
    if filled.materials is not None:
        number = filled.materials.number
        found["material"] = number.astype(np.int32) + 1
        for name in ("density", "young", "poisson"):
            found[name] = getattr(filled.materials, name)[number]
    return found


def _write_inp(path: Path, filled: TetrahedralMesh) -> None:
    """Write Abaqus' and CalculiX' format: the mesh and its sets, to be included in a model."""
    # Of each organ an ELSET of tetrahedra; of each boundary an element surface, for pressures, and a node
    # set N_..., for supports. CalculiX reads names in capitals, without hyphens.
    path.write_text("\n".join(_inp_lines(filled)) + "\n", encoding="ascii")


def _inp_lines(filled: TetrahedralMesh) -> Iterator[str]:
    numbers = np.arange(1, len(filled.tetrahedra) + 1)
    yield f"** {_HEAD}"
    yield "*NODE, NSET=NALL"
    yield from (f"{n}, {x:.9g}, {y:.9g}, {z:.9g}" for n, (x, y, z) in enumerate(filled.vertices, 1))
    names = [_plain(name) for name in filled.names]
    kind = f"C3D{filled.nodes.shape[1]}"
    for n, name in enumerate(names):
        own = filled.regions == n
        yield f"*ELEMENT, TYPE={kind}, ELSET={name}"
        yield _rows_as_text(np.column_stack([numbers[own], filled.nodes[own] + 1]), "%d", ", ")
    yield "*ELSET, ELSET=EALL"
    yield from (f"{name}," for name in names)
    yield from _inp_materials(filled)
    for n, name in enumerate(map(_plain, filled.group_names)):
        own = filled.groups == n
        yield f"*SURFACE, NAME={name}, TYPE=ELEMENT"
        yield from (f"{element + 1}, S{side + 1}" for element, side in filled.sides[own].tolist())
        yield f"*NSET, NSET=N_{name}"
        yield from (f"{node + 1}," for node in np.unique(filled.face_nodes[own]).tolist())


def _inp_materials(filled: TetrahedralMesh) -> Iterator[str]:
    for n, name, young, poisson, density in _materials(filled):
        assert filled.materials is not None
        yield f"*ELSET, ELSET={name}"
        yield from (f"{element + 1}," for element in np.flatnonzero(filled.materials.number == n).tolist())
        yield f"*MATERIAL, NAME={name}\n*ELASTIC\n{young:.6g}, {poisson:.6g}\n*DENSITY\n{density:.6g}"
        yield f"*SOLID SECTION, ELSET={name}, MATERIAL={name}"


def _materials(filled: TetrahedralMesh) -> Iterator[tuple[int, str, float, float, float]]:
    """List number, name, modulus in MPa, Poisson's ratio and density in t/mm^3 of each material."""
    if filled.materials is None:
        return
    columns = (filled.materials.young, filled.materials.poisson, filled.materials.density * T_PER_MM3)
    for n, row in enumerate(zip(*(column.tolist() for column in columns), strict=True)):
        yield (n, f"MATERIAL_{n + 1}", *row)


def _write_feb(path: Path, filled: TetrahedralMesh) -> None:
    """Write FEBio's format 4.0: mesh, sets, materials and domains, to which loads and steps are added."""
    # Of each organ and material a part; of each boundary a surface and a node set of its name, in mm, MPa
    # and t/mm^3.
    path.write_text("\n".join(_feb_lines(filled)) + "\n", encoding="utf-8")


def _feb_lines(filled: TetrahedralMesh) -> Iterator[str]:
    solids, faces = ("tet4", "tri3") if filled.middles is None else ("tet10", "tri6")
    given = list(_materials(filled))
    if given:
        number = cast(Any, filled.materials).number
        parts = [
            (f"{name}_{material[1].lower()}", material, (filled.regions == n) & (number == material[0]))
            for n, name in enumerate(filled.names)
            for material in given
        ]
        parts = [part for part in parts if part[2].any()]
    else:
        given = [(n, name, *NO_MATERIAL) for n, name in enumerate(filled.names)]
        parts = [(material[1], material, filled.regions == n) for n, material in enumerate(given)]
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield f"<!-- {_HEAD}; modulus MPa; density t/mm3 -->"
    yield '<febio_spec version="4.0">\n<Module type="solid"/>\n<Globals>\n<Constants>'
    yield "<T>0</T><P>0</P><R>0</R><Fc>0</Fc>\n</Constants>\n</Globals>\n<Material>"
    for n, name, young, poisson, density in given:
        yield f'<material id="{n + 1}" name="{name}" type="isotropic elastic">'
        yield f"<density>{density:.6g}</density><E>{young:.6g}</E><v>{poisson:.6g}</v>\n</material>"
    yield '</Material>\n<Mesh>\n<Nodes name="all">'
    points = enumerate(filled.vertices.tolist(), 1)
    yield from (f'<node id="{n}">{x:.9g},{y:.9g},{z:.9g}</node>' for n, (x, y, z) in points)
    yield "</Nodes>"
    for name, _, own in parts:
        yield f'<Elements type="{solids}" name="{name}">'
        yield from _feb_rows("elem", np.flatnonzero(own), filled.nodes[own])
        yield "</Elements>"
    for n, name in enumerate(filled.group_names):
        own = filled.groups == n
        yield f'<Surface name="{name}">'
        yield from _feb_rows(faces, np.arange(own.sum()), filled.face_nodes[own])
        yield "</Surface>"
    for n, name in enumerate(filled.group_names):
        nodes = np.unique(filled.face_nodes[filled.groups == n]) + 1
        yield f'<NodeSet name="{name}">{",".join(map(str, nodes.tolist()))}</NodeSet>'
    yield "</Mesh>\n<MeshDomains>"
    yield from (f'<SolidDomain name="{name}" mat="{material[1]}"/>' for name, material, _ in parts)
    yield "</MeshDomains>\n</febio_spec>"


def _feb_rows(tag: str, numbers: IntArray, nodes: IntArray) -> Iterator[str]:
    for number, row in zip(numbers.tolist(), (nodes + 1).tolist(), strict=True):
        yield f'<{tag} id="{number + 1}">{",".join(map(str, row))}</{tag}>'


def _plain(name: str) -> str:
    return name.upper().replace("-", "_")


#: What writes tetrahedra, by format.
WRITERS: dict[str, Callable[[Path, TetrahedralMesh], None]] = {
    "feb": _write_feb,
    "inp": _write_inp,
    "msh": _write_msh,
    "vtu": _write_vtu,
}


def _rows_as_text(numbers: npt.ArrayLike, form: str, separator: str = " ") -> str:
    """Write a row of numbers per line."""
    table = np.asarray(numbers)
    line = separator.join([form] * table.shape[1])
    return "\n".join(line % tuple(row) for row in table.tolist())
