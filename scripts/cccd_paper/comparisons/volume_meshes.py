"""Surfaces as people make them from masks today: isosurfaces of voxels or of signed distances.

Every function returns a closed mesh in world mm (RAS) that is oriented outwards.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
import pyvista as pv
import vtk
from scipy import ndimage
from skimage import measure

from cccd.containers import Structure
from cccd.geometry.mesh import Mesh
from cccd_paper.comparisons import interpolate_contours

#: The optional package that interpolates contours by morphology.
MORPHOLOGICAL = "itk-morphologicalcontourinterpolation"
#: Of SimpleITK's filter: its largest change of a level, and its most rounds.
_ANTI_ALIAS_ERROR, _ANTI_ALIAS_ROUNDS = 0.07, 50
#: Windowed-sinc smoothing as VTK's users set it (Taubin et al. 1996): rounds and pass band.
SINC_ITERATIONS, SINC_PASS_BAND = 20, 0.1


def _padded_stack(structure: Structure) -> np.ndarray:
    return np.pad(structure.required_stack("mask"), 1)


def _in_world(structure: Structure, mesh: Mesh) -> Mesh:
    """Take a mesh from indices (slice, i, j) of the stack padded by one to world mm, faces outwards."""
    source = mesh.vertices - 1 + structure.stack_origin
    affine = structure.frame.stack_affine
    return Mesh(source[:, [1, 2, 0]] @ affine[:3, :3].T + affine[:3, 3], mesh.faces).outwards()


def _to_grid(field: np.ndarray) -> pv.ImageData:
    """VTK image with x along the array's first axis."""
    grid = pv.ImageData(dimensions=field.shape)
    grid.point_data["field"] = field.ravel(order="F")
    return grid


def from_polydata(surface: pv.DataObject) -> Mesh:
    """Vertices and faces of the ``PolyData`` VTK computed, cut into triangles where it has larger faces.

    PyVista annotates its filters with what they give for any data set; of a surface they give a surface.
    """
    triangles = cast(pv.PolyData, cast(pv.PolyData, surface).triangulate())
    return Mesh(np.asarray(triangles.points, float), np.asarray(triangles.regular_faces, np.int64))


def marching_cubes(structure: Structure) -> Mesh:
    """Marching cubes (Lewiner et al. 2003) on the mask at one half."""
    index, faces, _, _ = measure.marching_cubes(_padded_stack(structure).astype(np.float32), 0.5)
    return _in_world(structure, Mesh(index, faces.astype(np.int64)))


def flying_edges(structure: Structure) -> Mesh:
    """Flying edges (Schroeder et al. 2015) on the mask at one half."""
    grid = _to_grid(_padded_stack(structure).astype(np.float32))
    return _in_world(structure, from_polydata(grid.contour([0.5], scalars="field", method="flying_edges")))


def surface_nets(structure: Structure) -> Mesh:
    """Surface nets (Frisken 2022) as in VTK, with its own smoothing."""
    grid = _to_grid(_padded_stack(structure).astype(np.uint8))
    nets = vtk.vtkSurfaceNets3D()
    nets.SetInputData(grid)
    nets.SetValue(0, 1)
    nets.SetOutputMeshTypeToTriangles()
    nets.Update()
    return _in_world(structure, from_polydata(pv.wrap(nets.GetOutput())))


def distance_isosurface(structure: Structure, sigma_pixels: float = 0.0) -> Mesh:
    """Shape-based interpolation (Raya and Udupa 1990), then flying edges.

    Every slice becomes a signed distance map; slices are interpolated linearly until they lie about one
    pixel apart; the surface is the zero level, of a Gaussian of all that where ``sigma_pixels`` is given.
    """
    frame = structure.frame
    spacing = frame.pixel_spacing
    stack = _padded_stack(structure)
    stack = np.pad(stack, ((0, 0), (2, 2), (2, 2)))
    reach = float(np.hypot(*(np.array(stack.shape[1:]) * spacing)))
    signed = np.empty(stack.shape, np.float32)
    for plane, out in zip(stack, signed, strict=True):
        if plane.any():
            outside = ndimage.distance_transform_edt(~plane, sampling=spacing)
            out[:] = outside - ndimage.distance_transform_edt(plane, sampling=spacing)
    for s in np.flatnonzero(~stack.any(axis=(1, 2))):
        # A slice without the organ mirrors its neighbour: the organ ends half a slice beyond its last.
        near = [n for n in (s - 1, s + 1) if 0 <= n < len(stack) and stack[n].any()]
        signed[s] = np.max([np.abs(signed[n]) for n in near], axis=0) if near else reach
    parts = _parts(structure)
    fine = np.arange((len(stack) - 1) * parts + 1) / parts
    low = np.minimum(fine.astype(np.int64), len(stack) - 2)
    share = (fine - low).astype(np.float32)[:, None, None]
    field = (1 - share) * signed[low] + share * signed[low + 1]
    if sigma_pixels > 0:
        field = ndimage.gaussian_filter(field, sigma_pixels)
    mesh = from_polydata(_to_grid(field).contour([0.0], scalars="field", method="flying_edges"))
    return _in_world(structure, Mesh((mesh.vertices / (parts, 1, 1)) - (0, 2, 2), mesh.faces))


def _parts(structure: Structure) -> int:
    """Into how many parts a slice step is cut so that levels lie about one pixel apart."""
    return max(1, round(structure.frame.slice_spacing / float(np.sqrt(structure.frame.pixel_spacing.prod()))))


def antialiased_isosurface(structure: Structure) -> Mesh:
    """Whitaker's anti-aliasing of binary volumes (2000), by SimpleITK, then flying edges."""
    import SimpleITK

    binary = SimpleITK.GetImageFromArray(np.pad(_padded_stack(structure), 2).astype(np.uint8))
    levels = SimpleITK.AntiAliasBinary(binary, _ANTI_ALIAS_ERROR, _ANTI_ALIAS_ROUNDS)
    field = SimpleITK.GetArrayFromImage(levels).astype(np.float32)
    mesh = from_polydata(_to_grid(field).contour([0.0], scalars="field", method="flying_edges"))
    return _in_world(structure, Mesh(mesh.vertices - 2, mesh.faces))


def has_morphological() -> bool:
    """Whether the optional package of `morphological_isosurface` is installed."""
    try:
        return bool(version(MORPHOLOGICAL))
    except PackageNotFoundError:
        return False


def morphological_isosurface(structure: Structure) -> Mesh:
    """Morphological contour interpolation (Zukić et al. 2016) by ITK, then flying edges."""
    stack, parts = _padded_stack(structure), _parts(structure)
    labels = np.zeros(((len(stack) - 1) * parts + 1, *stack.shape[1:]), np.uint8)
    labels[::parts] = stack
    with tempfile.TemporaryDirectory() as folder:
        given, filled = Path(folder) / "given.npy", Path(folder) / "filled.npy"
        np.save(given, labels)
        script = interpolate_contours.__file__
        subprocess.run([sys.executable, script, given, filled], capture_output=True, check=False)
        field = np.load(filled).astype(np.float32)
    mesh = from_polydata(_to_grid(field).contour([0.5], scalars="field", method="flying_edges"))
    return _in_world(structure, Mesh(mesh.vertices / (parts, 1, 1), mesh.faces))


class Smoothing(NamedTuple):
    """A setting of VTK's windowed-sinc filter."""

    pass_band: float
    rounds: int

    def __str__(self) -> str:
        """Write it as the tables do."""
        slicers = ", 3D Slicer's default" if self == _SLICER else ""
        return f"pass band {self.pass_band:g}, {self.rounds} rounds{slicers}"


#: 3D Slicer's smoothing factor of 0.5: its pass band is 10 to the power of -4 times the factor.
_SLICER = Smoothing(0.01, 20)
#: What is tried.
GRID = tuple(Smoothing(band, rounds) for band in (0.1, 0.05, 0.01) for rounds in (20, 60))


def windowed_sinc(mesh: Mesh, iterations: int = SINC_ITERATIONS, pass_band: float = SINC_PASS_BAND) -> Mesh:
    """Smooth a mesh by the windowed-sinc filter (Taubin et al. 1996) with VTK's usual settings."""
    smooth = mesh.to_polydata().smooth_taubin(
        n_iter=iterations, pass_band=pass_band, boundary_smoothing=True, normalize_coordinates=True
    )
    return Mesh(np.asarray(smooth.points, float), mesh.faces).outwards()
