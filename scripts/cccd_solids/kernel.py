"""What OpenCASCADE does: shells and solids from shared vertices and edges, their check, the files.

Nothing is sewn or cut: faces are made of the edges that they share, so a shell is closed by construction.
The optional package ``cadquery-ocp-novtk`` brings OpenCASCADE.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from cccd.errors import InputError
from cccd.extras import needing
from cccd.files import COLOUR
from cccd.geometry.arrays import FloatArray, IntArray, connected_parts
from cccd.geometry.mesh import Mesh
from cccd.geometry.polygons import DEGREE
from cccd_solids.step_points import share_points

#: Precision of vertices and edges in mm: faces share their points, so there is no more than rounding.
PRECISION_MM = 1e-6


@dataclass(frozen=True)
class Part:
    """One organ in a file.

    Attributes
    ----------
    name : str
    solids : sequence of TopoDS_Solid
        Its bodies, in mm.
    colour : (r, g, b)
        sRGB, 0 to 1.
    """

    name: str
    solids: Sequence[Any]
    colour: tuple[float, float, float] = COLOUR


@dataclass(frozen=True)
class Checked:
    """What OpenCASCADE finds about a solid: valid, edges not in two faces, faces, volume in mm^3."""

    valid: bool
    free_edges: int
    faces: int
    volume: float


def require_kernel(path: str | Path) -> None:
    """Raise `InputError` for a file that needs OpenCASCADE where it is not installed."""
    with needing(str(path), "cad"):
        message = importlib.import_module("OCP.Message")
    message.Message.DefaultMessenger_s().ChangePrinters().Clear()  # it would print statistics of every file


def facet_shell(mesh: Mesh) -> Any:
    """Make a closed ``TopoDS_Shell`` of a closed manifold: a plane per triangle, a line per edge."""
    from OCP import BRep, Geom, TopAbs, TopoDS, gp

    build = BRep.BRep_Builder()
    points = [_point(vertex) for vertex in mesh.vertices]
    vertices = [_vertex(build, point) for point in points]
    edges: dict[tuple[int, int], Any] = {}
    made: list[Any] = []
    for corners, normal in zip(mesh.faces.tolist(), mesh.unit_normals.tolist(), strict=True):
        wire = TopoDS.TopoDS_Wire()
        build.MakeWire(wire)
        for a, b in zip(corners, (*corners[1:], corners[0]), strict=True):
            if (b, a) in edges:
                build.Add(wire, edges.pop((b, a)).Oriented(TopAbs.TopAbs_REVERSED))
                continue
            edge = TopoDS.TopoDS_Edge()
            along = gp.gp_Vec(points[a], points[b])
            build.MakeEdge(edge, Geom.Geom_Line(points[a], gp.gp_Dir(along)), PRECISION_MM)
            _bound(build, edge, vertices[a], vertices[b], along.Magnitude())
            edges[a, b] = edge
            build.Add(wire, edge)
        face = TopoDS.TopoDS_Face()
        build.MakeFace(face, Geom.Geom_Plane(points[corners[0]], gp.gp_Dir(*normal)), PRECISION_MM)
        wire.Closed(True)
        build.Add(face, wire)
        made.append(face)
    return _shell(build, made)


class Curve(NamedTuple):
    """An edge: the vertices that it runs between, and control points (2 n + 2, 3) of n cubics, C1.

    Its parameter runs from 0 to ``width``.
    """

    start: int
    end: int
    points: FloatArray
    width: int


class Bound(NamedTuple):
    """An edge in a face: its number, whether the face has it on its left, and the ends of its ``way``.

    Those are places in the face's parameters, in the direction of the edge.
    """

    edge: int
    forward: bool
    way: Sequence[Sequence[float]]


class SplineFace(NamedTuple):
    """A bicubic spline within a wire, its parameters from 0 to ``width``.

    The net (2 n + 2, 2 n + 2, 3) has v along its first axis and u along its second.
    """

    wires: Sequence[Sequence[Bound]]
    net: FloatArray
    width: int


class PlanarFace(NamedTuple):
    """A plane within wires, its normal (3,) outwards."""

    wires: Sequence[Sequence[Bound]]
    normal: FloatArray


def spline_shells(
    points: FloatArray,
    curves: Sequence[Curve],
    faces: Sequence[SplineFace | PlanarFace],
    shells: Sequence[Sequence[tuple[int, bool]]],
) -> list[Any]:
    """Make closed shells, ``TopoDS_Shell``, of faces that share their edges; two shells may share a face.

    Parameters
    ----------
    points : (V, 3) float64
        Of the vertices; those that no edge ends at may be among them.
    curves, faces : sequences of Curve, and of SplineFace or PlanarFace
    shells : sequence of sequence of (int, bool)
        The faces of each, and whether their outer side is that of the shell.
    """
    from OCP import BRep, Geom, TopAbs, TopoDS, gp

    build = BRep.BRep_Builder()
    ends = {n for curve in curves for n in (curve.start, curve.end)}
    vertices = {n: _vertex(build, _point(points[n])) for n in sorted(ends)}
    edges = [_spline_edge(build, curve, vertices) for curve in curves]
    made: list[Any] = []
    for bounded in faces:
        face = TopoDS.TopoDS_Face()
        if isinstance(bounded, SplineFace):
            knots, times = _double_knots(len(bounded.net), bounded.width)
            poles = _poles(bounded.net)
            surface = Geom.Geom_BSplineSurface(poles, knots, knots, times, times, DEGREE, DEGREE)
        else:
            on_it = points[curves[bounded.wires[0][0].edge].start]
            surface = Geom.Geom_Plane(_point(on_it), gp.gp_Dir(*bounded.normal.tolist()))
        build.MakeFace(face, surface, PRECISION_MM)
        for bounds in bounded.wires:
            wire = TopoDS.TopoDS_Wire()
            build.MakeWire(wire)
            for number, forward, way in bounds:
                edge = edges[number]
                if isinstance(bounded, SplineFace):
                    build.UpdateEdge(edge, _line(*way), face, PRECISION_MM)
                    build.Range(edge, face, 0.0, float(curves[number].width))
                build.Add(wire, edge.Oriented(TopAbs.TopAbs_FORWARD if forward else TopAbs.TopAbs_REVERSED))
            wire.Closed(True)
            build.Add(face, wire)
        made.append(face)
    return [_shell(build, [made[n] if same else made[n].Reversed() for n, same in shell]) for shell in shells]


def _shell(build: Any, faces: Sequence[Any]) -> Any:
    """Make a closed shell of faces."""
    from OCP import TopoDS

    shell = TopoDS.TopoDS_Shell()
    build.MakeShell(shell)
    for face in faces:
        build.Add(shell, face)
    shell.Closed(True)
    return shell


def _spline_edge(build: Any, curve: Curve, vertices: dict[int, Any]) -> Any:
    from OCP import Geom, TopoDS

    edge = TopoDS.TopoDS_Edge()
    knots, times = _double_knots(len(curve.points), curve.width)
    build.MakeEdge(edge, Geom.Geom_BSplineCurve(_pole_row(curve.points), knots, times, DEGREE), PRECISION_MM)
    _bound(build, edge, vertices[curve.start], vertices[curve.end], curve.width)
    return edge


def _line(start: Sequence[float], end: Sequence[float]) -> Any:
    """Line in a face's parameters from one place to another."""
    from OCP import Geom2d, gp

    return Geom2d.Geom2d_Line(gp.gp_Pnt2d(*start), gp.gp_Dir2d(end[0] - start[0], end[1] - start[1]))


def _double_knots(count: int, width: int) -> tuple[Any, Any]:
    """Knots of so many control points on [0, width], two at each place within, and how often each counts."""
    from OCP import collections

    spans = count // 2 - 1
    knots, times = collections.Array1_double(1, spans + 1), collections.Array1_int(1, spans + 1)
    for n in range(spans + 1):
        knots.SetValue(n + 1, width * n / spans)
        times.SetValue(n + 1, DEGREE + 1 if n in {0, spans} else 2)
    return knots, times


def _poles(net: FloatArray) -> Any:
    """Control points of a surface: u along the net's second axis, v along its first."""
    from OCP import collections, gp

    count = len(net)
    poles = collections.Array2_gp_Pnt(1, count, 1, count)
    for row, points in enumerate(net.tolist(), 1):
        for column, point in enumerate(points, 1):
            poles.SetValue(column, row, gp.gp_Pnt(*point))
    return poles


def _pole_row(points: FloatArray) -> Any:
    from OCP import collections, gp

    poles = collections.Array1_gp_Pnt(1, len(points))
    for n, point in enumerate(points.tolist(), 1):
        poles.SetValue(n, gp.gp_Pnt(*point))
    return poles


def _point(coordinates: FloatArray) -> Any:
    from OCP import gp

    return gp.gp_Pnt(*(float(x) for x in coordinates))


def _vertex(build: Any, point: Any) -> Any:
    from OCP import TopoDS

    vertex = TopoDS.TopoDS_Vertex()
    build.MakeVertex(vertex, point, PRECISION_MM)
    return vertex


def _bound(build: Any, edge: Any, first: Any, last: Any, end: float) -> None:
    """Let an edge run from a vertex at parameter 0 to another at ``end``."""
    from OCP import TopAbs

    build.Add(edge, first.Oriented(TopAbs.TopAbs_FORWARD))
    build.Add(edge, last.Oriented(TopAbs.TopAbs_REVERSED))
    build.Range(edge, 0.0, float(end))


def make_solid(shells: Sequence[Any]) -> Any:
    """Make one ``TopoDS_Solid`` of an outer shell and those of its cavities."""
    from OCP import BRep, TopoDS

    return _filled(BRep.BRep_Builder.MakeSolid, TopoDS.TopoDS_Solid(), shells)


def _filled(make: Callable[..., None], shape: Any, parts: Sequence[Any]) -> Any:
    from OCP import BRep

    build = BRep.BRep_Builder()
    make(build, shape)
    for part in parts:
        build.Add(shape, part)
    return shape


def check_solid(solid: Any) -> Checked:
    """Check a solid's validity, edges, faces and volume."""
    from OCP import BRepCheck, BRepGProp, GProp, TopAbs, TopExp, collections

    faces_of_edges = collections.IndexedDataMap_TopoDS_Shape_List_TopoDS_Shape_TopTools_ShapeMapHasher()
    TopExp.TopExp.MapShapesAndAncestors_s(solid, TopAbs.TopAbs_EDGE, TopAbs.TopAbs_FACE, faces_of_edges)
    edges = range(1, faces_of_edges.Extent() + 1)
    inside = GProp.GProp_GProps()
    BRepGProp.BRepGProp.VolumeProperties_s(solid, inside)
    return Checked(
        BRepCheck.BRepCheck_Analyzer(solid).IsValid(),
        sum(faces_of_edges.FindFromIndex(n).Size() != 2 for n in edges),
        count_shapes(solid, TopAbs.TopAbs_FACE),
        inside.Mass(),
    )


def count_shapes(shape: Any, kind: Any) -> int:
    """Count the faces, shells or solids of a shape; one that is used twice counts twice."""
    from OCP import TopExp

    explorer = TopExp.TopExp_Explorer(shape, kind)
    count = 0
    while explorer.More():
        count += 1
        explorer.Next()
    return count


def write_parts(path: Path, parts: Sequence[Part], form: str) -> None:
    """Write organs to a file: a name and a colour each, an assembly where there are several bodies.

    Parameters
    ----------
    path : Path
    parts : sequence of Part
        At least one.
    form : {"step", "iges", "brep"}
        STEP AP242, IGES 5.3 with manifold solids, or OpenCASCADE's own, which keeps neither name nor colour.

    Raises
    ------
    InputError
        When OpenCASCADE cannot write the file.
    """
    writers = {"step": _write_step, "iges": _write_iges, "brep": _write_brep}
    if not writers[form](str(path), parts):
        raise InputError(
            str(path), "OpenCASCADE could not write the file", "check the folder's space and rights"
        )


#: Meshes of solids that are read lie this near to them, as a share of the solid's diagonal: chords take less
#: than a thousandth of a ball's volume. The second is the angle between facets that is allowed, in radians.
CHORD_SHARE, CHORD_RAD = 1e-4, 0.3


def read_solid_mesh(path: Path) -> tuple[FloatArray, IntArray]:
    """Read a STEP, IGES or BREP file as triangles.

    Parameters
    ----------
    path : Path
        Its suffix chooses the format; lengths become mm.

    Returns
    -------
    vertices : (V, 3) float64
        Each as often as faces meet there, to the last bit alike.
    faces : (F, 3) int64

    Raises
    ------
    InputError
        OpenCASCADE cannot read it.
    """
    from OCP import Bnd, BRep, BRepBndLib, BRepMesh, TopAbs, TopExp, TopLoc, TopoDS

    require_kernel(path)
    shape = _read_shape(path)
    box = Bnd.Bnd_Box()
    BRepBndLib.BRepBndLib.Add_s(shape, box)
    chord = CHORD_SHARE * np.sqrt(box.SquareExtent())
    BRepMesh.BRepMesh_IncrementalMesh(shape, max(chord, PRECISION_MM), False, CHORD_RAD, False)
    points: list[FloatArray] = [np.zeros((0, 3))]
    corners: list[IntArray] = [np.zeros((0, 3), np.int64)]
    count = 0
    explorer = TopExp.TopExp_Explorer(shape, TopAbs.TopAbs_FACE)
    while explorer.More():
        face, place = TopoDS.TopoDS.Face(explorer.Current()), TopLoc.TopLoc_Location()
        explorer.Next()
        drawn = BRep.BRep_Tool.Triangulation_s(face, place)
        if drawn is None:
            continue
        move = place.Transformation()
        nodes = [drawn.Node(n).Transformed(move).Coord() for n in range(1, drawn.NbNodes() + 1)]
        triangles = [drawn.Triangle(n).Get() for n in range(1, drawn.NbTriangles() + 1)]
        found = np.array(triangles, np.int64).reshape(-1, 3) - 1 + count
        points.append(np.array(nodes, float).reshape(-1, 3))
        corners.append(found[:, ::-1] if face.Orientation() == TopAbs.TopAbs_REVERSED else found)
        count += len(nodes)
    return _snapped(np.concatenate(points)), np.concatenate(corners)


def _snapped(points: FloatArray) -> FloatArray:
    """Move points (P, 3) that edges and faces compute apart, by rounding, to the first of them."""
    near = cKDTree(points).query_pairs(10 * PRECISION_MM, output_type="ndarray")
    group = connected_parts(near[:, 0], near[:, 1], len(points))
    first = np.full(len(points), len(points))
    np.minimum.at(first, group, np.arange(len(points)))
    return points[first[group]]


def _read_shape(path: Path) -> Any:
    """Read a file's shape, in mm."""
    from OCP import BRep, BRepTools, IFSelect, IGESControl, STEPControl, TopoDS

    suffix = path.suffix.lower()
    if suffix == ".brep":
        shape = TopoDS.TopoDS_Shape()
        if BRepTools.BRepTools.Read_s(shape, str(path), BRep.BRep_Builder()):
            return shape
    else:
        steps = suffix in {".step", ".stp"}
        reader = STEPControl.STEPControl_Reader() if steps else IGESControl.IGESControl_Reader()
        if reader.ReadFile(str(path)) == IFSelect.IFSelect_RetDone and reader.TransferRoots():
            return reader.OneShape()
    raise InputError(path.name, "OpenCASCADE cannot read it", "export it again, as STEP AP214 or AP242")


def _write_step(path: str, parts: Sequence[Part]) -> bool:
    from OCP import IFSelect, Interface, STEPCAFControl, STEPControl

    # before the settings, which it resets when it is first made
    writer = STEPCAFControl.STEPCAFControl_Writer()
    Interface.Interface_Static.SetCVal_s("write.step.schema", "AP242DIS")
    Interface.Interface_Static.SetCVal_s("write.step.unit", "MM")
    Interface.Interface_Static.SetIVal_s("write.surfacecurve.mode", 0)  # curves in the surfaces' parameters
    writer.SetNameMode(True)
    writer.SetColorMode(True)
    document = _document(parts)
    if not writer.Transfer(document, STEPControl.STEPControl_AsIs):
        return False
    if writer.Write(path) != IFSelect.IFSelect_RetDone:
        return False
    share_points(Path(path))
    return True


def _write_iges(path: str, parts: Sequence[Part]) -> bool:
    from OCP import IGESCAFControl, IGESControl, Interface

    IGESControl.IGESControl_Controller.Init_s()
    Interface.Interface_Static.SetIVal_s("write.iges.brep.mode", 1)
    Interface.Interface_Static.SetCVal_s("write.iges.unit", "MM")
    writer = IGESCAFControl.IGESCAFControl_Writer()
    writer.SetNameMode(True)
    writer.SetColorMode(True)
    return writer.Transfer(_document(parts)) and writer.Write(path)


def _write_brep(path: str, parts: Sequence[Part]) -> bool:
    from OCP import BRepTools

    solids = [solid for part in parts for solid in part.solids]
    return BRepTools.BRepTools.Write_s(solids[0] if len(solids) == 1 else _compound(solids), path)


def _compound(shapes: Sequence[Any]) -> Any:
    from OCP import BRep, TopoDS

    return _filled(BRep.BRep_Builder.MakeCompound, TopoDS.TopoDS_Compound(), shapes)


def _document(parts: Sequence[Part]) -> Any:
    """Make OpenCASCADE's document of the parts in mm: an organ of several bodies has them as its parts."""
    from OCP import Quantity, TCollection, TDataStd, TDocStd, UnitsMethods, XCAFApp, XCAFDoc

    document = TDocStd.TDocStd_Document(TCollection.TCollection_ExtendedString("XmlXCAF"))
    XCAFApp.XCAFApp_Application.GetApplication_s().InitDocument(document)
    XCAFDoc.XCAFDoc_DocumentTool.SetLengthUnit_s(
        document, 1.0, UnitsMethods.UnitsMethods_LengthUnit.UnitsMethods_LengthUnit_Millimeter
    )
    shapes = XCAFDoc.XCAFDoc_DocumentTool.ShapeTool_s(document.Main())
    colours = XCAFDoc.XCAFDoc_DocumentTool.ColorTool_s(document.Main())
    for part in parts:
        if len(part.solids) == 1:
            labels = [shapes.AddShape(part.solids[0], False)]
        else:
            organ = shapes.NewShape()
            components = [shapes.AddComponent(organ, solid, False) for solid in part.solids]
            labels = [organ, *(_product(shapes, component) for component in components)]
        colour = Quantity.Quantity_Color(*part.colour, Quantity.Quantity_TOC_sRGB)
        names = [part.name, *(f"{part.name} {n}" for n in range(1, len(labels)))]
        for label, name in zip(labels, names, strict=True):
            TDataStd.TDataStd_Name.Set_s(label, TCollection.TCollection_ExtendedString(name))
            colours.SetColor(label, colour, XCAFDoc.XCAFDoc_ColorSurf)
    shapes.UpdateAssemblies()
    return document


def _product(shapes: Any, component: Any) -> Any:
    """Label of the shape that an assembly's component stands for."""
    from OCP import TDF

    label = TDF.TDF_Label()
    shapes.GetReferredShape_s(component, label)
    return label
