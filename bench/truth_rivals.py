"""Surfaces that other tools make of a mask: VTK's filters, 3D Slicer's converter, niimath.

Every function gives meshes in world mm, with the processor seconds that they took.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import nibabel
import numpy as np
import vtk
from scipy.ndimage import distance_transform_edt
from truth_measures import from_polydata, to_image, transformed

from cccd.geometry.mesh import Mesh

EDGES = "flying edges + windowed sinc"
DISTANCES = "linear distances + windowed sinc"
SLICER_EDGES = "3D Slicer, flying edges"
SLICER_NETS = "3D Slicer, surface nets"
NIIMATH = "niimath"

#: Grid of settings of windowed sinc.
BANDS, ROUNDS = (0.1, 0.07, 0.05, 0.03, 0.01), (20, 60)

#: Pass band and rounds that stand for a fixed choice, which needs no truth.
FIXED = {EDGES: (0.07, 60), DISTANCES: (0.05, 60)}

#: 3D Slicer's default smoothing factor; the pass band is 10 to the power of -4 times it. Its rounds.
SLICER_SMOOTHING, SLICER_ROUNDS = 0.5, 20

#: Empty voxels around a mask, so that no surface meets the edge of the grid.
_MARGIN = 2


class Made(NamedTuple):
    """A surface, and how it was made.

    Attributes
    ----------
    method, setting : str
    mesh : Mesh
        In world mm.
    seconds : float
        Of the processor, from the mask on.
    fixed : bool
        Whether the setting is the fixed one, or the program's default, rather than one of a grid.
    """

    method: str
    setting: str
    mesh: Mesh
    seconds: float
    fixed: bool


def with_margin(mask: np.ndarray, affine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Add empty voxels around a mask, and move the affine along."""
    start = affine.copy()
    start[:3, 3] -= affine[:3, :3] @ np.full(3, _MARGIN)
    return np.pad(mask, _MARGIN), start


def isosurface(values: np.ndarray, level: float) -> vtk.vtkPolyData:
    """Isosurface in voxel indices, by flying edges."""
    edges = vtk.vtkFlyingEdges3D()
    edges.SetInputData(to_image(values.astype(np.float32)))
    edges.SetValue(0, level)
    edges.ComputeNormalsOff()
    edges.ComputeScalarsOff()
    edges.Update()
    return edges.GetOutput()


def _windowed_sinc(surface: vtk.vtkPolyData, band: float, rounds: int) -> vtk.vtkPolyData:
    """Smooth a surface with the options that 3D Slicer sets; on closed surfaces they are PyVista's too."""
    sinc = vtk.vtkWindowedSincPolyDataFilter()
    sinc.SetInputData(surface)
    sinc.SetPassBand(band)
    sinc.SetNumberOfIterations(rounds)
    sinc.BoundarySmoothingOff()
    sinc.FeatureEdgeSmoothingOff()
    sinc.NonManifoldSmoothingOn()
    sinc.NormalizeCoordinatesOn()
    sinc.Update()
    return sinc.GetOutput()


def _slice_distances(mask: np.ndarray, fill: int) -> np.ndarray:
    """Signed distances on slices in pixels, positive inside, ``fill`` linear steps from slice to slice.

    On an empty slice the distance is that to the next slice.
    """
    on = np.stack(
        [
            distance_transform_edt(plane) - distance_transform_edt(~plane)
            if plane.any()
            else np.full(plane.shape, -float(fill))
            for plane in mask.transpose(2, 0, 1)
        ],
        axis=2,
    )
    at = np.arange((mask.shape[2] - 1) * fill + 1) / fill
    below = np.minimum(at.astype(int), mask.shape[2] - 2)
    share = at - below
    return on[:, :, below] * (1 - share) + on[:, :, below + 1] * share


def by_windowed_sinc(mask: np.ndarray, affine: np.ndarray) -> Iterator[Made]:
    """Smooth two isosurfaces by every setting of the grid: of the mask, and of distances on its slices.

    Parameters
    ----------
    mask : (a, b, c) bool
        Slices run along the last axis.
    affine : (4, 4) float
        Of the mask's indices.
    """
    padded, start = with_margin(mask, affine)
    steps = np.linalg.norm(affine[:3, :3], axis=0)
    fill = max(1, round(steps[2] / steps[0]))
    finer = start.copy()
    finer[:3, 2] /= fill
    for method in (EDGES, DISTANCES):
        began = time.process_time()
        if method == EDGES:
            surface, matrix = isosurface(padded, 0.5), start
        else:
            surface, matrix = isosurface(_slice_distances(padded, fill), 0.0), finer
        base = time.process_time() - began
        for band in BANDS:
            for rounds in ROUNDS:
                began = time.process_time()
                smooth = _windowed_sinc(surface, band, rounds)
                seconds = base + time.process_time() - began
                mesh = transformed(from_polydata(smooth), matrix)
                fixed = (band, rounds) == FIXED[method]
                yield Made(method, f"pass band {band:g}, {rounds} rounds", mesh, seconds, fixed)


def by_slicer(mask: np.ndarray, affine: np.ndarray) -> Iterator[Made]:
    """Mesh a mask as 3D Slicer's closed-surface converter does, at its defaults.

    The steps and options are those of Slicer's ``vtkBinaryLabelmapToClosedSurfaceConversionRule``: flying
    edges of labels (or surface nets without their own smoothing), no decimation, windowed sinc, all in voxel
    indices.
    """
    padded, start = with_margin(mask, affine)
    labels = padded.astype(np.uint8)
    for method in (SLICER_EDGES, SLICER_NETS):
        began = time.process_time()
        if method == SLICER_EDGES:
            mesher = vtk.vtkDiscreteFlyingEdges3D()
            mesher.ComputeGradientsOff()
            mesher.ComputeNormalsOff()
        else:
            mesher = vtk.vtkSurfaceNets3D()
            mesher.SmoothingOff()
            mesher.SetOutputMeshTypeToTriangles()
        mesher.SetInputData(to_image(labels))
        mesher.SetValue(0, 1)
        mesher.Update()
        smooth = _windowed_sinc(mesher.GetOutput(), 10 ** (-4 * SLICER_SMOOTHING), SLICER_ROUNDS)
        seconds = time.process_time() - began
        yield Made(
            method, "smoothing .5, its default", transformed(from_polydata(smooth), start), seconds, True
        )


def has_niimath() -> bool:
    """Whether niimath is on the PATH."""
    return shutil.which("niimath") is not None


def by_niimath(mask: np.ndarray, affine: np.ndarray) -> Iterator[Made]:
    """Mesh a mask by ``niimath -mesh`` at its defaults, all parts kept; nothing where it is not installed."""
    if not has_niimath():
        return
    padded, start = with_margin(mask, affine)
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder) / "mask.nii", Path(folder) / "mesh.ply"
        nibabel.save(nibabel.Nifti1Image(padded.astype(np.uint8), start), given)
        command = ["niimath", str(given), "-mesh", "-i", "0.5", "-l", "0", "-v", "0", str(made)]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            command, check=True, capture_output=True, env=os.environ | {"OMP_NUM_THREADS": "1"}, timeout=600
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        reader = vtk.vtkPLYReader()
        reader.SetFileName(str(made))
        reader.Update()
        mesh = from_polydata(reader.GetOutput())
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    yield Made(NIIMATH, "its defaults", mesh, seconds, True)
