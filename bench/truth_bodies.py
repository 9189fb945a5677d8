"""Bodies whose surface is known exactly, and stacks of slices sampled from them.

Analytic bodies are zero sets of implicit functions: a voxel is in the mask where the function is negative
at its centre. The other bodies are closed meshes: the mesh itself is the truth.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import trimesh
import vtk
from scipy.spatial.transform import Rotation
from truth_measures import edge_counts, from_polydata, inside, to_polydata

from cccd.geometry.mesh import Mesh
from cccd_datasets.implicit_solids import (
    ImplicitFunction,
    ellipsoid,
    mesh_zero_set,
    sample_lattice,
    subtraction,
    torus,
)
from cccd_datasets.phantoms import ORGANS

#: Every body is turned by these angles about x, y and z, so that no face is parallel to the voxels' grid.
TURN_DEG = (17.0, 23.0, 31.0)

#: Edge of the cubes that triangulate an analytic surface, as a share of a pixel: simple bodies, phantoms.
#: Chords of a ball of 20 pixels then lie within .001 and .002 pixels of it.
_CUBE, _PHANTOM_CUBE = 0.35, 0.5

#: Pixels of a mesh of unknown size along its longest axis, about.
_PIXELS = 100


class Body(NamedTuple):
    """A closed surface and the pixel size at which it is sampled.

    Attributes
    ----------
    name : str
    truth : Mesh
        In mm, outwards.
    pixel : float
        In-plane pixel size, mm.
    solid : ImplicitFunction or None
        Of an analytic body.
    """

    name: str
    truth: Mesh
    pixel: float
    solid: ImplicitFunction | None = None


def rounded_box(half: tuple[float, float, float], radius: float) -> ImplicitFunction:
    """Box with rounded edges around the origin, exact distance.

    Parameters
    ----------
    half : three floats
        Half the box's edges, mm, rounding included.
    radius : float
        Radius of the edges, mm.
    """

    def distance(points: np.ndarray) -> np.ndarray:
        core = np.array(half, points.dtype).reshape(3, *[1] * (points.ndim - 1)) - points.dtype.type(radius)
        beyond = np.abs(points) - core
        outer = np.sqrt((np.maximum(beyond, 0) ** 2).sum(axis=0))
        return outer + np.minimum(beyond.max(axis=0), 0) - points.dtype.type(radius)

    return distance


def curved_sheet(radius: float, opening_deg: float, thickness: float) -> ImplicitFunction:
    """Cap of a sphere, thickened, its rim round; exact distance.

    Parameters
    ----------
    radius : float
        Of the sphere, mm. The middle of the cap is at the origin.
    opening_deg : float
        Angle between the cap's axis and its rim.
    thickness : float
        Of the sheet, mm.
    """
    opening = np.deg2rad(opening_deg)
    rim = radius * np.array([np.sin(opening), np.cos(opening)])

    def distance(points: np.ndarray) -> np.ndarray:
        across, up = np.hypot(points[0], points[1]), points[2] + points.dtype.type(radius)
        to_cap = np.abs(np.hypot(across, up) - points.dtype.type(radius))
        to_rim = np.hypot(across - points.dtype.type(rim[0]), up - points.dtype.type(rim[1]))
        within = np.arctan2(across, up) <= opening
        return np.where(within, to_cap, to_rim) - points.dtype.type(thickness / 2)

    return distance


#: Implicit functions of simple bodies around the origin, each with half the edge of a box around it, mm.
_SIMPLE: dict[str, tuple[ImplicitFunction, float]] = {
    "ball": (ellipsoid((0, 0, 0), (20, 20, 20)), 22.0),
    "ellipsoid": (ellipsoid((0, 0, 0), (28, 18, 12)), 30.0),
    "torus": (torus((0, 0, 0), 20, 7, axis=2), 29.0),
    "rounded box": (rounded_box((20, 15, 11), 3), 22.0),
    "curved sheet": (curved_sheet(40, 35, 3), 27.0),
    "hollow ball": (
        subtraction(ellipsoid((0, 0, 0), (18, 18, 18)), ellipsoid((0, 0, 0), (14, 14, 14))),
        20.0,
    ),
}

#: Phantoms of the project, of one individual each. The airways of the bronchi taper from 8 to 2 mm.
_PHANTOMS = ("kidney", "bronchi")

#: Names of the analytic bodies.
ANALYTIC = (*_SIMPLE, *_PHANTOMS)

#: Cortical surfaces that nilearn carries: fsaverage5, 10,242 vertices each.
CORTICAL = ("pial left", "pial right", "white left", "white right")


def analytic_body(name: str, turn: Rotation, pixel: float = 1.0) -> Body:
    """Make one of `ANALYTIC`, turned about the origin."""
    if name in _PHANTOMS:
        anatomy = ORGANS[name](np.random.default_rng(0))
        solid, low, high, cube = anatomy.organ, anatomy.bbox_min, anatomy.bbox_max, _PHANTOM_CUBE
    else:
        solid, reach = _SIMPLE[name]
        low, high, cube = np.full(3, -reach), np.full(3, reach), _CUBE
    mesh = mesh_zero_set(solid, low, high, cube * pixel)
    back = turn.as_matrix().T

    def turned(points: np.ndarray) -> np.ndarray:
        return solid(np.tensordot(back.astype(points.dtype), points, 1))

    return Body(name, Mesh(turn.apply(mesh.vertices), mesh.faces), pixel, turned)


def cortical_body(name: str, turn: Rotation, pixel: float = 1.0) -> Body:
    """Take one of `CORTICAL` from nilearn's own files, and make it smooth; nothing is downloaded.

    The triangles of fsaverage5 are 3 mm long. Two rounds of Loop's subdivision round off the edges between
    them, which no cortex has; the surface moves by .1 mm on the mean and stays closed.
    """
    from nilearn.datasets import fetch_surf_fsaverage
    from nilearn.surface import load_surf_mesh

    surface = load_surf_mesh(fetch_surf_fsaverage("fsaverage5")[name.replace(" ", "_")])
    mesh = Mesh(np.asarray(surface.coordinates, float), np.asarray(surface.faces, np.int64))
    loop = vtk.vtkLoopSubdivisionFilter()
    loop.SetNumberOfSubdivisions(2)
    loop.SetInputData(to_polydata(mesh))
    loop.Update()
    return _placed(name, from_polydata(loop.GetOutput()), turn, pixel)


def mesh_files(folder: Path) -> list[Path]:
    """List the meshes of a folder: PLY, STL, OBJ, OFF."""
    return sorted(
        path for path in folder.glob("*") if path.suffix.lower() in {".ply", ".stl", ".obj", ".off"}
    )


def mesh_body(path: Path, turn: Rotation, pixel: float | None = None) -> Body:
    """Read a closed mesh.

    Parameters
    ----------
    path : Path
        A file of `mesh_files`.
    turn : Rotation
        Applied after the mesh is moved to its mean and its longest axis laid across the slices.
    pixel : float, optional
        In mm. Default: a hundredth of the longest axis, rounded to one digit.

    Raises
    ------
    ValueError
        The mesh is not closed, or its faces are not oriented alike.
    """
    read = trimesh.load_mesh(path, process=True)
    mesh = Mesh(np.asarray(read.vertices, float), np.asarray(read.faces, np.int64))
    if pixel is None:
        pixel = float(f"{np.ptp(mesh.vertices, axis=0).max() / _PIXELS:.1g}")
    return _placed(path.stem, mesh, turn, pixel)


def _placed(name: str, mesh: Mesh, turn: Rotation, pixel: float) -> Body:
    """Move a closed mesh to its mean, lay its longest axis across the slices, turn it."""
    mesh = _closed(name, mesh)
    axes = np.eye(3)[np.argsort(np.ptp(mesh.vertices, axis=0))]
    axes[0] *= np.linalg.det(axes)
    points = (mesh.vertices - mesh.vertices.mean(axis=0)) @ axes.T
    return Body(name, Mesh(turn.apply(points), mesh.faces), pixel)


def _closed(name: str, mesh: Mesh) -> Mesh:
    """Orient a closed mesh outwards."""
    directed = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    if (edge_counts(mesh) != 2).any():
        raise ValueError(f"{name}: the mesh is not closed")
    if len(np.unique(directed, axis=0)) != len(directed):
        raise ValueError(f"{name}: the faces of the mesh are not oriented alike")
    return mesh if mesh.volume > 0 else Mesh(mesh.vertices, mesh.faces[:, ::-1])


def sample_stack(body: Body, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Sample a body at voxel centres.

    Parameters
    ----------
    body : Body
    ratio : float
        Distance between slices, in pixels.

    Returns
    -------
    mask : (a, b, c) bool
        Slices run along the last axis; at least two voxels are empty on every side.
    affine : (4, 4) float64
        Of its indices, mm. The grid starts at no special place of the body.
    """
    step = body.pixel * np.array([1.0, 1.0, ratio])
    low = body.truth.vertices.min(axis=0) - 2.63 * step
    shape = tuple(np.ceil((body.truth.vertices.max(axis=0) - low) / step + 3).astype(int).tolist())
    affine = np.diag([*step, 1.0])
    affine[:3, 3] = low
    if body.solid is None:
        return inside(body.truth, affine, shape), affine
    return sample_lattice(body.solid, low, step, shape, coarse=3 * body.pixel) < 0, affine
