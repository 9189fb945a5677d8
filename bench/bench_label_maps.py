"""Whole label maps: shared walls beside vtkSurfaceNets3D at its best of a grid of settings.

    PYTHONPATH=scripts python bench/bench_label_maps.py

A ball of three sectors around a smaller ball, 48 x 48 x 48 voxels. The truth is the same map at a quarter of
the voxel: distances are between surfaces (ASSD, mean over the organs), bending is that within walls, lines
where three meet left out, because alone neither method has those.
"""

from __future__ import annotations

import itertools
import time

import numpy as np
from vtkmodules.util import numpy_support
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkFiltersCore import vtkSurfaceNets3D

from cccd import reconstruct
from cccd.containers import Frame, Structure
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import LoftSettings
from cccd_labels.conforming import ConformingSurface
from cccd_labels.shared_walls import share_walls
from cccd_workflow.surface_measures import mask_surface, surface_distances

#: Iterations, relaxation factors and constraint distances (in voxels) of VTK's smoothing.
GRID = list(itertools.product((8, 16, 40), (0.25, 0.5), (0.5, 1.0, 2.0)))


def label_map(fine: int) -> np.ndarray:
    """Labels (n, n, n) with ``fine`` voxels to the millimetre."""
    x, y, z = (np.indices((48 * fine,) * 3) + 0.5) / fine - 24.1
    radius = np.sqrt(x * x + y * y + z * z)
    sector = 1 + np.floor((np.arctan2(y, x) + np.pi) / (2 * np.pi / 3)).astype(int).clip(0, 2)
    return np.where(radius < 7, 4, np.where(radius < 18, sector, 0))


def structures(labels: np.ndarray, voxel: float) -> dict[int, Structure]:
    """Structures of all labels; the corner of the first voxel is the origin."""
    affine = np.diag([voxel, voxel, voxel, 1.0])
    affine[:3, 3] = voxel / 2
    frame = Frame(affine, 2, labels.shape)
    origin = np.zeros(3, np.int64)
    return {
        label: Structure("bench", f"label_{label}", frame, origin, mask=labels == label)
        for label in range(1, int(labels.max()) + 1)
    }


def surface_nets(
    labels: np.ndarray, iterations: int, relaxation: float, constraint: float
) -> ConformingSurface:
    """Smooth all labels by VTK's surface nets, voxels of a millimetre."""
    image = vtkImageData()
    image.SetDimensions(labels.shape[::-1])
    image.GetPointData().SetScalars(numpy_support.numpy_to_vtk(labels.astype(np.int32).ravel()))
    filter_ = vtkSurfaceNets3D()
    filter_.SetInputData(image)
    for label in range(1, int(labels.max()) + 1):
        filter_.SetValue(label - 1, label)
    filter_.SetOutputMeshTypeToTriangles()
    filter_.SmoothingOn()
    filter_.GetSmoother().SetNumberOfIterations(iterations)
    filter_.GetSmoother().SetRelaxationFactor(relaxation)
    filter_.AutomaticSmoothingConstraintsOff()
    filter_.SetConstraintDistance(constraint)
    filter_.Update()
    mesh = filter_.GetOutput()
    points = numpy_support.vtk_to_numpy(mesh.GetPoints().GetData())[:, ::-1] + 0.5
    faces = numpy_support.vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    sides = numpy_support.vtk_to_numpy(mesh.GetCellData().GetArray("BoundaryLabels"))
    return ConformingSurface(points.astype(float), faces.astype(np.int64), sides.astype(np.int64))


def wall_bending(surface: ConformingSurface) -> float:
    """Discrete-shell energy of edges within walls by area, in 1/mm^2; see `Mesh.bending_per_area`."""
    total, area = 0.0, 0.0
    for low, high in surface.pairs:
        chosen = (np.sort(surface.regions, axis=1) == (low, high)).all(axis=1)
        turned = surface.regions[chosen][:, 0] == low
        faces = surface.triangles[chosen]
        faces = np.where(turned[:, None], faces[:, ::-1], faces)
        wall = Mesh(surface.vertices, faces)
        bends = wall.dihedrals
        wide = np.maximum(bends.areas, 0.1 * bends.lengths**2)
        total += float((3 * bends.angles**2 * bends.lengths**2 / wide).sum())
        area += wall.area
    return total / area


def distance(surface: ConformingSurface, truth: dict[int, Mesh]) -> float:
    """Mean ASSD of all organs in mm."""
    found = [
        surface_distances(surface.mesh_of(label), mesh, np.random.default_rng(0), 20_000)["assd"]
        for label, mesh in truth.items()
    ]
    return float(np.mean(found))


def main() -> None:
    """Print a line for each method and setting."""
    truth = {label: mask_surface(part) for label, part in structures(label_map(4), 0.25).items()}
    labels = label_map(1)
    parts = structures(labels, 1.0)
    for run in ("first", "second"):  # the first compiles
        start = time.process_time()
        ours = share_walls(parts, LoftSettings()).surface
        print(f"{run}: {time.process_time() - start:.2f} CPU s")
    apart: list[float] = []
    for label, mesh in truth.items():
        alone = reconstruct(parts[label]).lofted.mesh
        apart.append(surface_distances(alone, mesh, np.random.default_rng(0), 20_000)["assd"])
    print(f"each alone: ASSD {np.mean(apart):.4f} mm")
    print(f"shared walls: ASSD {distance(ours, truth):.4f} mm, bending {wall_bending(ours):.4f}")
    for setting in GRID:
        start = time.perf_counter()
        theirs = surface_nets(labels, *setting)
        seconds = time.perf_counter() - start
        print(
            f"vtkSurfaceNets3D {setting}: ASSD {distance(theirs, truth):.4f} mm, bending "
            f"{wall_bending(theirs):.4f}, {seconds:.2f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
