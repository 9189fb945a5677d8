"""Surfaces to files: the suffix chooses the format, a row of the table ``WRITERS``.

`write_surface` calls writers as ``write(path, surface, options)``. Everything is in mm RAS, and says so, but
where a standard wants it otherwise (glTF: metres with y up; DICOM: LPS). 3D Slicer takes meshes for LPS
unless a comment ``SPACE=RAS`` says otherwise, so that comment is there in the form Slicer reads.
"""

from __future__ import annotations

import ctypes
import locale
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
from nibabel.gifti.gifti import GiftiCoordSystem, GiftiDataArray, GiftiImage, GiftiMetaData
from scipy.spatial import cKDTree

from cccd.containers import Structure
from cccd.errors import InputError
from cccd.extras import check_extra
from cccd.geometry.arrays import IntArray
from cccd.geometry.mesh import Mesh, xml_of
from cccd.geometry.raster import voxelise
from cccd.inputs.annotation import fill_mask
from cccd.inputs.grid import Volume
from cccd.plugins import find, formats, own_rows, row
from cccd.settings.surface import LoftSettings
from cccd.store import NOTE, atomic_path, check_writable
from cccd.store import write_ply as write_mesh
from cccd.surface.surface import LoftedSurface

#: Red, green and blue (sRGB, 0 to 1) of an organ that nothing gives a colour.
COLOUR = (0.80, 0.47, 0.40)


@dataclass(frozen=True)
class ExportOptions:
    """What some formats need besides: those that lie on the scan, solids, and tetrahedra.

    Attributes
    ----------
    organ : str
        Name of the structure.
    series : Path or None
        Folder of the DICOM series that the file shall refer to.
    drawn : Structure or None
        What was drawn, where only some slices were: a label map keeps those as they are.
    settings : LoftSettings
        Section ``surface`` of the configuration.
    scan : Volume or None
        Whose grey values tetrahedra get.
    filled : dict
        Tetrahedra that were made of the surface, with their report, by settings: each further format of the
        same object gets these, as filling takes minutes.
    """

    organ: str = "surface"
    series: Path | None = None
    drawn: Structure | None = None
    settings: LoftSettings = field(default_factory=LoftSettings)
    scan: Volume | None = None
    filled: dict[str, tuple[Any, dict[str, Any]]] = field(
        default_factory=dict[str, tuple[Any, dict[str, Any]]]
    )


def format_of(path: str | Path) -> str:
    """Name the format that a file's suffix chooses.

    Raises
    ------
    InputError
        Another suffix; those known are listed.

    Examples
    --------
    >>> format_of("results/liver.nii.gz")
    'nii.gz'
    """
    name = Path(path).name.lower()
    known = [form for form in own_rows("WRITERS") if name.endswith(f".{form}")]
    known = known or [form for form in formats() if name.endswith(f".{form}")]
    if not known:
        names = ", ".join(f".{form}" for form in formats())
        raise InputError(str(path), f"unknown surface format {Path(path).suffix!r}", f"choose one of {names}")
    return max(known, key=len)


def check_format(path: str | Path) -> None:
    """Raise `InputError` for an unknown suffix, or a format whose extra is not installed."""
    if needed := row("WRITERS", format_of(path)).extra:
        check_extra(needed, str(path))


def write_surface(
    path: str | Path, surface: LoftedSurface, options: ExportOptions | None = None
) -> dict[str, Any]:
    """Write a surface; the suffix chooses the format (`cccd.plugins.formats`).

    Parameters
    ----------
    path : path
        Ends with the name of a format.
    surface : LoftedSurface
        In mm RAS.
    options : ExportOptions, optional
        For formats that lie on the scan, solids, and tetrahedra.

    Returns
    -------
    dict
        What a solid is worth, see `cccd_solids.build.write_solids`; empty for other formats.

    Raises
    ------
    InputError
        For a folder, another suffix, a format whose extra is not installed, or where nothing can be written.
    """
    options = options or ExportOptions()
    check_format(path)
    check_writable(path)
    write = find(row("WRITERS", format_of(path)).writer)
    with atomic_path(path) as temporary:
        try:
            return write(temporary, surface, options) or {}
        except InputError as error:
            if error.location != str(temporary):
                raise
            raise InputError(str(path), error.problem, error.hint) from None


#: NIfTI's code of the scanner's space.
_SCANNER = 1


def write_ply(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write binary PLY in mm RAS, with float64 vertices: nothing of the mesh's soundness is rounded away."""
    write_mesh(path, surface.mesh, NOTE)


def write_stl(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write binary STL in mm RAS."""
    path.write_bytes(binary_stl(surface.mesh, NOTE))


def write_obj(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write Wavefront OBJ in mm RAS."""
    mesh = cast(Any, surface.mesh.to_trimesh())
    path.write_text(mesh.export(file_type="obj", header=NOTE, include_normals=False), encoding="utf-8")


def write_vtp(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write VTK's polygonal data in mm RAS; unit and frame are field data.

    At its vertices are curvature (1/mm), the error band (mm) and, where no wall is shared, the body's number.
    """
    mesh = surface.mesh.to_polydata()
    mesh.point_data["curvature"] = surface.mesh.mean_curvature(surface.vertices)
    if surface.bodies:
        mesh.point_data["body"] = _body_numbers(surface)
    if surface.band is not None:
        mesh.point_data["inner_mm"] = surface.band.inner
        mesh.point_data["outer_mm"] = surface.band.outer
        mesh.field_data["band"] = [surface.band.share]
    mesh.field_data["SpaceUnit"] = ["mm"]
    mesh.field_data["Space"] = ["RAS"]
    path.write_text(xml_of(mesh), encoding="ascii")


def _body_numbers(surface: LoftedSurface) -> IntArray:
    """Which body (V,) is the nearest, by its samples, to each vertex."""
    samples = [body.tessellate().vertices for body in surface.bodies]
    owner = np.repeat(np.arange(len(samples)), [len(part) for part in samples])
    _, nearest = cKDTree(np.concatenate(samples)).query(surface.vertices)
    return owner[nearest]


def write_gii(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write GIfTI in mm RAS (scanner's space), as FreeSurfer and fMRIPrep keep surfaces.

    Vertices are float32, as the format has them. Such files are usually called ``.surf.gii``.
    """
    points = GiftiDataArray(
        np.asarray(surface.vertices, np.float32),
        intent="NIFTI_INTENT_POINTSET",
        datatype="NIFTI_TYPE_FLOAT32",
        coordsys=GiftiCoordSystem(_SCANNER, _SCANNER, np.eye(4)),
        # programs for cortices want to know which one it is
        meta=GiftiMetaData({"AnatomicalStructurePrimary": "Other", "GeometricType": "Anatomical"}),
    )
    triangles = GiftiDataArray(
        np.asarray(surface.faces, np.int32), intent="NIFTI_INTENT_TRIANGLE", datatype="NIFTI_TYPE_INT32"
    )
    about = GiftiMetaData({"Name": options.organ, "Description": NOTE})
    image = cast(Any, GiftiImage(meta=about, darrays=[points, triangles]))
    path.write_bytes(image.to_xml())


def binary_stl(mesh: Mesh, note: str) -> bytes:
    """Write a mesh as binary STL, in its own unit and frame, of which a note of at most 80 letters tells.

    A binary STL must not begin with "solid": readers would take it for text.
    """
    stl: bytes = cast(Any, mesh.to_trimesh()).export(file_type="stl")
    return note.encode("ascii", "replace").removeprefix(b"solid")[:80].ljust(80) + stl[80:]


def write_label_map(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write the voxels inside as 1; slices that were drawn, where only some were, as they were drawn."""
    from cccd.inputs.nifti_export import write_nifti

    frame = surface.frame.of_file
    if options.drawn is None:
        mask = voxelise(surface.mesh, frame.affine, frame.shape)
    else:
        mask = fill_mask(options.drawn, surface.mesh, whole=True)
    write_nifti(path, mask.astype(np.uint8), frame.affine)


#: mm RAS to glTF's metres, y up, z towards the viewer: x right, y superior, z anterior-to-viewer.
TO_GLTF = np.array([[1e-3, 0, 0, 0], [0, 0, 1e-3, 0], [0, -1e-3, 0, 0], [0, 0, 0, 1.0]])


def write_glb(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write the mesh in a scene of its own."""
    import trimesh

    mesh = cast(Any, surface.mesh.to_trimesh())
    mesh.visual = gltf_material(options.organ, COLOUR)
    scene = cast(Any, trimesh.Scene())
    scene.add_geometry(mesh, node_name="surface", geom_name="surface", transform=TO_GLTF)
    scene.metadata["note"] = f"{NOTE}; the node's matrix turns mm RAS into metres, y up"
    path.write_bytes(scene.export(file_type="glb"))


def gltf_material(name: str, colour: tuple[float, float, float]) -> Any:
    """Make trimesh's visuals of a colour (sRGB, 0 to 1); glTF's own factors are linear."""
    import trimesh

    visual = cast(Any, trimesh).visual  # not among its stubs' attributes
    linear = [part**2.2 for part in colour]
    material = visual.material.PBRMaterial(
        name=name, baseColorFactor=[*linear, 1.0], metallicFactor=0.0, roughnessFactor=0.6
    )
    return visual.TextureVisuals(material=material)


#: Where the file keeps what is not the format's own.
NAMESPACE = "https://cccd.example/3mf"


def write_3mf(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write the mesh in mm RAS; metadata ``thinnest_wall_mm`` says how thick 99 % of it is at least."""
    import lib3mf as untyped  # pyright: ignore[reportMissingTypeStubs]  # of the extra print

    from cccd.geometry.thickness import wall_thickness

    lib3mf = cast(Any, untyped)
    model = lib3mf.get_wrapper().CreateModel()
    model.SetUnit(lib3mf.ModelUnit.MilliMeter)
    body = model.AddMeshObject()
    body.SetName(options.organ)
    body.SetGeometry(
        _array(lib3mf.Position, np.asarray(surface.vertices, np.float32)),
        _array(lib3mf.Triangle, np.asarray(surface.faces, np.uint32)),
    )
    materials = model.AddBaseMaterialGroup()
    red, green, blue = (round(255 * share) for share in COLOUR)
    material = materials.AddMaterial(options.organ, lib3mf.Color(red, green, blue, 255))
    body.SetObjectLevelProperty(materials.GetResourceID(), material)
    identity = lib3mf.Transform(((1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)))
    model.AddBuildItem(body, identity)
    facts = model.GetMetaDataGroup()
    facts.AddMetaData("", "Title", options.organ, "xs:string", True)
    facts.AddMetaData("", "Description", NOTE, "xs:string", True)
    thinnest = f"{wall_thickness(surface.mesh, 0.01):.2f}"
    facts.AddMetaData(NAMESPACE, "thinnest_wall_mm", thinnest, "xs:string", True)
    with _own_locale():
        model.QueryWriter("3mf").WriteToFile(str(path))


@contextmanager
def _own_locale() -> Generator[None]:
    """Bring back the process's locale, which the library's writer leaves at ``C``: texts would be ASCII."""
    before = locale.setlocale(locale.LC_ALL)
    try:
        yield
    finally:
        locale.setlocale(locale.LC_ALL, before)


def _array(kind: type[ctypes.Structure], rows: np.ndarray) -> Any:
    """Rows of an array as the library's structures."""
    return (kind * len(rows)).from_buffer_copy(np.ascontiguousarray(rows).tobytes())
