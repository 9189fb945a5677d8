"""Meshes of others as organs: mended where they are open or pass through themselves, cut into contours.

A smooth surface is made of a mesh as of drawn contours: planes cut it, and the contours are lofted.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from scipy.spatial import cKDTree

from cccd.containers import Frame, Structure
from cccd.errors import InputError
from cccd.file_headers import dicom_modality
from cccd.geometry.arrays import IntArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.sections import cross_sections
from cccd.inputs.grid import Volume
from cccd.plugins import find, table
from cccd_dicom.drawn_contours import assemble_contours, contour_frame
from cccd_dicom.slices import SLICE_DIRECTION
from cccd_meshes.booleans import united
from cccd_meshes.crossing_planes import DrawnPlane, planes_of, surface_through
from cccd_meshes.csl import read_csl
from cccd_meshes.distance_grid import grid_to_mesh
from cccd_meshes.read_meshes import NotedMesh, read_mesh

#: Vertices this near to each other, as a share of the mesh's diagonal, are one: float32 rounds coarser.
SAME_SHARE = 1e-6
#: Holes are closed that are at most this wide, as a share of the mesh's diagonal; wider ones are openings.
HOLE_SHARE = 0.1
#: A mesh that passes through itself is made again on a grid of so many steps along its diagonal.
REMESHED = 250
#: Planes lie as far apart as the mesh's edges are long, in so many steps along its longest side at least and
#: most: fewer lose parts of a common organ, more take minutes.
STEPS = (96, 256)
#: Empty planes and pixels around a mesh.
MARGIN = 4


def read_closed_mesh(path: str | Path) -> NotedMesh:
    """Read a surface, and mend what can be mended: it is closed then, and oriented outwards.

    Raises
    ------
    InputError
        Not readable, or open with holes that are too wide.
    """
    found = read_mesh(path)
    mesh, notes = mend(found.mesh, Path(path).name)
    return NotedMesh(mesh, (*found.notes, *notes))


def drawn_planes(path: Path, label: str = "") -> list[DrawnPlane] | None:
    """Read contours in planes of several directions: CSL, or RTSTRUCT; None of any other file.

    Parameters
    ----------
    path : Path
    label : str
        Number or name of the RTSTRUCT's ROI.

    Raises
    ------
    InputError
        Not readable, or a CSL file whose planes are all parallel and too few.
    """
    if path.name.lower().endswith(".csl"):
        return [DrawnPlane(normal, rings) for normal, rings in read_csl(path)]
    if not path.is_file() or dicom_modality(path) != "RTSTRUCT":
        return None
    rois = find(table("READERS")["RTSTRUCT"].read)(path).contours(label, "")
    planes = planes_of([contour for roi in rois for contour in roi], path.name)
    return planes if _directions(planes) > 1 else None


def _directions(planes: Sequence[DrawnPlane]) -> int:
    """Count the directions of planes."""
    normals = np.array([plane.normal for plane in planes])
    return 1 if np.all(np.abs(normals @ normals[0]) > 1 - SLICE_DIRECTION) else 2


def structure_of_planes(planes: Sequence[DrawnPlane], name: str) -> Structure:
    """Make a structure of contours in planes: as they are where these are parallel, else through all of them.

    Parameters
    ----------
    planes : sequence of DrawnPlane
    name : str
        Of the organ, and what messages name.
    """
    if _directions(planes) > 1:
        return structure_of_mesh(NotedMesh(surface_through(planes, name).outwards()), name)
    if len(planes) < 2:
        raise InputError(name, "its contours lie in one plane", "give two planes or more")
    contours = [ring for plane in planes for ring in plane.rings]
    pixel = float(np.ptp(np.concatenate(contours), axis=0).max()) / STEPS[1]
    frame, _, _ = contour_frame(contours, None, name, pixel)
    curves, notes = assemble_contours([contours], frame, name)
    origin = np.zeros(3, np.int64)
    return Structure(
        name, name, frame, origin, contours=curves, provenance={"source": "planes"}, warnings=notes
    )


def mend(mesh: Mesh, location: str) -> NotedMesh:
    """Make a closed mesh that does not pass through itself of one that nearly is.

    Cracks are joined, doubled triangles left out, triangles turned alike, small holes closed, overlapping
    pieces united. A piece that passes through itself is made again on a grid.

    Parameters
    ----------
    mesh : Mesh
    location : str
        What messages name.

    Raises
    ------
    InputError
        It is open.
    """
    notes: list[str] = []
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    if not mesh.is_closed_manifold:
        mesh = _joined(mesh, size, notes)
        mesh = _alike(mesh, notes)
        mesh = _without_holes(mesh, size, notes, location)
    if mesh.volume < 0:
        mesh = mesh.reversed()
        notes.append("its triangles faced inwards: turned round")
    pairs = mesh.self_intersections()
    if len(pairs):
        joined = united(mesh)
        if joined is not None and not len(joined.self_intersections()):
            pieces = len(mesh.pieces())
            mesh = joined
            notes.append(f"its {pieces} pieces pass through each other: united")
        else:
            mesh = _remeshed(mesh, size)
            step = size / REMESHED
            notes.append(f"it passes through itself at {len(pairs)} places: made again, {step:.2g} mm fine")
    return NotedMesh(mesh, tuple(f"{location}: {note}" for note in notes))


def _joined(mesh: Mesh, size: float, notes: list[str]) -> Mesh:
    """Join vertices that rounding parted, and leave out doubled triangles."""
    near = cKDTree(mesh.vertices).query_pairs(SAME_SHARE * size, output_type="ndarray")
    root = np.arange(len(mesh.vertices))
    for first, second in near[np.argsort(near[:, 0], kind="stable")].tolist():
        root[second] = root[first]
    faces = root[mesh.faces]
    faces = faces[np.all(faces != np.roll(faces, 1, axis=1), axis=1)]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    doubled = len(faces) - len(first)
    if len(near):
        notes.append(f"{len(near)} pairs of vertices nearer than {SAME_SHARE * size:.1g} mm: joined")
    if doubled:
        notes.append(f"{doubled} triangles were there twice: one of each is used")
    return Mesh(mesh.vertices, faces[np.sort(first)]).compact()


def _alike(mesh: Mesh, notes: list[str]) -> Mesh:
    """Turn triangles so that neighbours run along their common edge in opposite directions."""
    start, end = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    key = start * (int(mesh.faces.max()) + 1) + end
    if len(np.unique(key)) == len(key):
        return mesh
    import trimesh

    turned = cast(Any, mesh.to_trimesh())
    cast(Any, trimesh).repair.fix_winding(turned)
    faces = np.asarray(turned.faces, np.int64)
    count = int(np.count_nonzero(np.any(faces != mesh.faces, axis=1)))
    if count:
        notes.append(f"{min(count, len(faces) - count)} triangles faced the other way: turned round")
    return Mesh(mesh.vertices, faces)


def _without_holes(mesh: Mesh, size: float, notes: list[str], location: str) -> Mesh:
    """Close small holes, each by a fan around its middle."""
    rims = _rims(mesh.faces, location)
    vertices, faces = [mesh.vertices], [mesh.faces]
    widest = 0.0
    for number, rim in enumerate(rims):
        points = mesh.vertices[rim]
        widest = max(widest, float(np.linalg.norm(np.ptp(points, axis=0))))
        middle = np.full(len(rim), len(mesh.vertices) + number)
        vertices.append(points.mean(axis=0, keepdims=True))
        faces.append(np.column_stack([np.roll(rim, -1), rim, middle]))
    if widest > HOLE_SHARE * size:
        holes = f"{len(rims)} hole" + "s"[: len(rims) > 1]
        raise InputError(
            location,
            f"the mesh is open: {holes}, the widest {widest:.3g} mm across",
            "close it in the program that it comes from; only small holes are closed here",
        )
    if rims:
        notes.append(f"{len(rims)} small holes, at most {widest:.2g} mm across: closed")
    return Mesh(np.concatenate(vertices), np.concatenate(faces))


def _rims(faces: IntArray, location: str) -> list[IntArray]:
    """Loops of vertices along the open edges, each in the direction of its triangles' edges."""
    count = int(faces.max()) + 1
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    open_ = ~np.isin(start * count + end, end * count + start)
    following: dict[int, int] = dict(zip(start[open_].tolist(), end[open_].tolist(), strict=True))
    if len(following) < np.count_nonzero(open_):
        raise InputError(
            location,
            "more than two of its triangles meet along an edge, or holes touch",
            "repair it in the program that it comes from",
        )
    rims: list[IntArray] = []
    while following:
        vertex = next(iter(following))
        rim: list[int] = []
        while vertex in following:
            rim.append(vertex)
            vertex = following.pop(vertex)
        rims.append(np.array(rim, np.int64))
    return rims


def _remeshed(mesh: Mesh, size: float) -> Mesh:
    """Mesh of what a closed mesh that passes through itself encloses, from distances on a grid."""
    step = size / REMESHED
    low = mesh.vertices.min(axis=0) - MARGIN * step
    a, b, c = (int(n) + 2 * MARGIN for n in np.ceil(np.ptp(mesh.vertices, axis=0) / step))
    return grid_to_mesh(mesh, low, step, (a, b, c), 3.0).isosurface(0.0).outwards()


def check_overlap(mesh: Mesh, scan: Volume, location: str) -> None:
    """Refuse a mesh that lies beside a scan, and say so where it would not with x and y reversed.

    Raises
    ------
    InputError
        Its box and the scan's do not overlap.
    """
    for turned in (mesh.vertices, mesh.vertices * (-1, -1, 1)):
        index = np.linalg.solve(scan.affine[:3, :3], (turned - scan.affine[:3, 3]).T).T
        inside = np.all(index.max(axis=0) >= -0.5) and np.all(index.min(axis=0) <= np.array(scan.shape) - 0.5)
        if inside and turned is mesh.vertices:
            return
        if inside:
            raise InputError(
                location, f"it lies outside {scan.location}, but not in LPS", "convert it to RAS"
            )
    raise InputError(location, f"it lies outside {scan.location}", "check that both are in mm RAS")


def structure_of_mesh(mended: NotedMesh, name: str) -> Structure:
    """Cut a closed mesh into contours, from which its smooth surface is lofted.

    Parameters
    ----------
    mended : NotedMesh
    name : str
        Of the organ, and what messages name.

    Returns
    -------
    Structure
        Planes lie across the mesh's longest side; the mesh itself is its ``truth``.

    Examples
    --------
    >>> corner = 9 * np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    >>> tetrahedron = Mesh(corner, np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]))
    >>> structure = structure_of_mesh(mend(tetrahedron, "solid"), "solid")
    >>> structure.frame.spacing.round(3).tolist()
    [0.094, 0.094, 0.094]
    """
    mesh = mended.mesh
    sides = np.ptp(mesh.vertices, axis=0)
    longest, axis = float(sides.max()), 2 if sides[2] >= sides.max() * (1 - 1e-6) else int(sides.argmax())
    edges = np.linalg.norm(np.diff(mesh.vertices[mesh.faces], axis=1), axis=2)
    pixel = float(np.clip(np.median(edges), longest / STEPS[1], longest / STEPS[0]))
    affine = np.diag([pixel, pixel, pixel, 1.0])
    # planes pass between the ends, half a step within: flat ends are as far off as round ones
    affine[:3, 3] = mesh.vertices.min(axis=0) - (MARGIN - 0.5) * pixel
    a, b, c = (int(n) + 2 * MARGIN for n in np.ceil(sides / pixel))
    frame = Frame(affine, axis, (a, b, c))
    heights = affine[axis, 3] + pixel * np.arange(frame.shape[axis])
    loops = [loop for plane in cross_sections(mesh, np.eye(3)[axis], heights) for loop in plane]
    contours, notes = assemble_contours([loops], frame, name)
    return Structure(
        case=name,
        organ=name,
        frame=frame,
        origin=np.zeros(3, np.int64),
        contours=contours,
        truth=mesh,
        provenance={"source": "mesh"},
        warnings=[*mended.notes, *notes],
    )
