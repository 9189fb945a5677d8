"""Measures of a triangle mesh against a true surface, and against the voxels that it was made from.

Every function returns what it measures and leaves its arguments alone. Meshes are closed, in mm.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import vtk
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

from cccd.geometry.mesh import Mesh

#: Points on each of two surfaces by which they are compared.
SAMPLES = 15_000

#: A voxel centre counts as wrong when it lies further than this on the other side of the surface, in pixels.
WRONG_PIXELS = 0.75


def to_polydata(mesh: Mesh) -> vtk.vtkPolyData:
    """Copy a mesh into VTK, with coordinates of double precision."""
    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(mesh.vertices, float), deep=1))
    faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    cells = vtk.vtkCellArray()
    offsets = numpy_to_vtkIdTypeArray(np.arange(0, 3 * len(faces) + 1, 3), deep=1)
    cells.SetData(offsets, numpy_to_vtkIdTypeArray(np.ascontiguousarray(faces.ravel()), deep=1))
    data = vtk.vtkPolyData()
    data.SetPoints(points)
    data.SetPolys(cells)
    return data


def to_image(values: np.ndarray) -> vtk.vtkImageData:
    """Copy an array into a VTK image with spacing 1 and origin 0."""
    image = vtk.vtkImageData()
    image.SetDimensions(*values.shape)
    image.GetPointData().SetScalars(numpy_to_vtk(values.ravel(order="F"), deep=1))
    return image


def from_polydata(data: vtk.vtkPolyData) -> Mesh:
    """Take the triangles of a surface that VTK made; larger faces are cut into triangles."""
    cut = vtk.vtkTriangleFilter()
    cut.SetInputData(data)
    cut.PassVertsOff()
    cut.PassLinesOff()
    cut.Update()
    triangles = cut.GetOutput()
    if triangles.GetNumberOfPolys() == 0:
        return Mesh.empty()
    faces = vtk_to_numpy(triangles.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return Mesh(vtk_to_numpy(triangles.GetPoints().GetData()).astype(float), faces.astype(np.int64))


def transformed(mesh: Mesh, matrix: np.ndarray) -> Mesh:
    """Apply an affine matrix (4, 4); faces keep their order."""
    return Mesh(mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3], mesh.faces)


class Target:
    """A surface to which distances are measured, with its search tree.

    Parameters
    ----------
    mesh : Mesh
        With at least one face.
    """

    def __init__(self, mesh: Mesh):
        self.mesh = mesh

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normals (F, 3); zero for a face without area."""
        corners = self.mesh.vertices[self.mesh.faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.linalg.norm(normals, axis=1, keepdims=True)
        return np.divide(normals, size, out=np.zeros_like(normals), where=size > 0)

    @cached_property
    def _locator(self) -> Any:
        locator = vtk.vtkStaticCellLocator()
        locator.SetDataSet(to_polydata(self.mesh))
        locator.BuildLocator()
        return locator

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Find the nearest face of each point (N, 3): distances (N,) in mm and faces (N,)."""
        reference: Any = vtk.reference  # its stub lacks the methods
        foot, cell, part, square = [0.0] * 3, reference(0), reference(0), reference(0.0)
        distances, faces = np.empty(len(points)), np.empty(len(points), np.int64)
        find = self._locator.FindClosestPoint
        for number, point in enumerate(points.tolist()):
            find(point, foot, cell, part, square)
            distances[number], faces[number] = square.get(), cell.get()
        return np.sqrt(distances), faces


def sample_surface(mesh: Mesh, count: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw points that are uniform over the area: points (count, 3) and their faces (count,)."""
    corners = mesh.vertices[mesh.faces]
    sides = corners[:, 1:] - corners[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    face = random.choice(len(area), count, p=area / area.sum())
    share = random.random((count, 2))
    beyond = share.sum(axis=1) > 1
    share[beyond] = 1 - share[beyond]
    return corners[face, 0] + np.einsum("nk,nkc->nc", share, sides[face]), face


def mean_distance(mesh: Mesh, truth: Target, samples: int = SAMPLES) -> float:
    """Average symmetric surface distance (ASSD) in mm, from ``samples`` points on each surface."""
    random = np.random.default_rng(0)
    there = truth.nearest(sample_surface(mesh, samples, random)[0])[0]
    back = Target(mesh).nearest(sample_surface(truth.mesh, samples, random)[0])[0]
    return float((there.mean() + back.mean()) / 2)


def compare(mesh: Mesh, truth: Target, samples: int = SAMPLES) -> dict[str, float]:
    """Compare a mesh with a true surface, both ways.

    Parameters
    ----------
    mesh : Mesh
        With at least one face.
    truth : Target
        The true surface.
    samples : int
        Points on each of the two surfaces, uniform over the area.

    Returns
    -------
    dict of str to float
        Mean (``assd_mm``), 95th percentile (``hd95_mm``) and maximum (``farthest_mm``) of the distances of
        all points to the other surface; median and 90th percentile of the angles between the normals
        there (``normals_median_deg``, ``normals_90_deg``), which do not depend on the orientation.
    """
    random = np.random.default_rng(0)
    made = Target(mesh)
    distances, angles = [], []
    for one, other in ((made, truth), (truth, made)):
        points, face = sample_surface(one.mesh, samples, random)
        distance, foot = other.nearest(points)
        cosine = np.abs(np.einsum("nc,nc->n", one.normals[face], other.normals[foot]))
        distances.append(distance)
        angles.append(np.degrees(np.arccos(np.minimum(cosine, 1))))
    distance, angle = np.concatenate(distances), np.concatenate(angles)
    return {
        "assd_mm": float(distance.mean()),
        "hd95_mm": float(np.percentile(distance, 95)),
        "farthest_mm": float(distance.max()),
        "normals_median_deg": float(np.median(angle)),
        "normals_90_deg": float(np.percentile(angle, 90)),
    }


def _edge_keys(mesh: Mesh) -> np.ndarray:
    """Number the edges of all faces (3F,), the same for both directions."""
    ends = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    return ends[:, 0] * len(mesh.vertices) + ends[:, 1]


def edge_counts(mesh: Mesh) -> np.ndarray:
    """Count the faces at each edge (E,)."""
    return np.unique(_edge_keys(mesh), return_counts=True)[1]


def open_edges(mesh: Mesh) -> int:
    """Count the edges that do not belong to exactly two faces."""
    return int(np.count_nonzero(edge_counts(mesh) != 2))


def euler_number(mesh: Mesh) -> int:
    """Vertices that have faces, less edges, plus faces: 2 for a ball, 0 for a torus, 4 for a hollow ball."""
    return len(np.unique(mesh.faces)) - len(edge_counts(mesh)) + len(mesh.faces)


def bending(mesh: Mesh) -> float:
    """Sum of the edges' lengths times the angles by which the faces bend there, per area, in 1/mm.

    On a smooth surface it tends to the mean of twice the absolute mean curvature where both principal
    curvatures have one sign: 2 / radius for a ball. Steps and noise add to it.
    """
    key = _edge_keys(mesh)
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(key[order][1:] == key[order][:-1])
    one, other = order[first], order[first + 1]
    unit = Target(mesh).normals
    a, b = unit[one // 3], unit[other // 3]
    angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ec,ec->e", a, b))
    start, end = key[one] // len(mesh.vertices), key[one] % len(mesh.vertices)
    length = np.linalg.norm(mesh.vertices[end] - mesh.vertices[start], axis=1)
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return float(angle @ length / (area.sum() / 2))


def inside(mesh: Mesh, affine: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Find the voxel centres inside a closed mesh.

    Parameters
    ----------
    mesh : Mesh
        In mm.
    affine : (4, 4) float
        ``world_mm = affine @ (i, j, k, 1)``.
    shape : three ints
        Of the grid.

    Returns
    -------
    (shape) bool
    """
    if len(mesh.faces) == 0:
        return np.zeros(shape, bool)
    ones = vtk.vtkImageData()
    ones.SetDimensions(*map(int, shape))
    ones.AllocateScalars(vtk.VTK_UNSIGNED_CHAR, 1)
    ones.GetPointData().GetScalars().Fill(1)
    stencil = vtk.vtkPolyDataToImageStencil()
    stencil.SetInputData(to_polydata(transformed(mesh, np.linalg.inv(affine))))
    stencil.SetOutputWholeExtent(ones.GetExtent())
    stencil.SetTolerance(0)
    image = vtk.vtkImageStencil()
    image.SetInputData(ones)
    image.SetStencilConnection(stencil.GetOutputPort())
    image.SetBackgroundValue(0)
    image.Update()
    values = vtk_to_numpy(image.GetOutput().GetPointData().GetScalars())
    return values.reshape(tuple(shape)[::-1]).transpose(2, 1, 0) > 0


def wrong_voxels(mesh: Mesh, mask: np.ndarray, affine: np.ndarray) -> tuple[int, float]:
    """Count the voxel centres of a mask that lie on the wrong side of a surface, and find the farthest.

    Parameters
    ----------
    mesh : Mesh
        In mm; closed.
    mask : (a, b, c) bool
        Slices run along the last axis. Centres outside the array are not looked at.
    affine : (4, 4) float
        Of the mask's indices.

    Returns
    -------
    count : int
        Centres that lie further than `WRONG_PIXELS` pixels on the wrong side.
    farthest : float
        The greatest distance of a centre on the wrong side, in pixels; 0 when none is, infinite when
        the surface is empty.
    """
    wrong = np.argwhere(inside(mesh, affine, mask.shape) != mask)
    if len(wrong) == 0:
        return 0, 0.0
    if len(mesh.faces) == 0:
        return len(wrong), float("inf")
    pixel = float(np.sqrt(np.prod(np.linalg.norm(affine[:3, :2], axis=0))))
    distance = Target(mesh).nearest(wrong @ affine[:3, :3].T + affine[:3, 3])[0] / pixel
    return int(np.count_nonzero(distance > WRONG_PIXELS)), float(distance.max())
