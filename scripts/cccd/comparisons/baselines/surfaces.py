"""Surfaces as others make them: a structure with its mask, and its curves in; a mesh in world mm out."""

from __future__ import annotations

from cccd.comparisons import point_meshes, volume_meshes
from cccd.comparisons.baselines import Baseline
from cccd.containers import Curves, Structure
from cccd.geometry.mesh import Mesh

__all__ = ["SURFACES"]


def _marching_cubes(structure: Structure, curves: Curves) -> Mesh:
    return volume_meshes.marching_cubes(structure)


def _flying_edges_smoothed(structure: Structure, curves: Curves) -> Mesh:
    return volume_meshes.windowed_sinc(volume_meshes.flying_edges(structure))


def _surface_nets(structure: Structure, curves: Curves) -> Mesh:
    return volume_meshes.surface_nets(structure)


def _distance_isosurface(structure: Structure, curves: Curves) -> Mesh:
    return volume_meshes.distance_isosurface(structure)


def _distance_isosurface_smoothed(structure: Structure, curves: Curves) -> Mesh:
    return volume_meshes.windowed_sinc(volume_meshes.distance_isosurface(structure))


def _distance_isosurface_smoothed_more(structure: Structure, curves: Curves) -> Mesh:
    rough = volume_meshes.distance_isosurface(structure)
    return volume_meshes.windowed_sinc(rough, pass_band=volume_meshes.SLICER_PASS_BAND)


def _ball_pivoting(structure: Structure, curves: Curves) -> Mesh:
    return point_meshes.ball_pivoting(curves)


def _poisson(structure: Structure, curves: Curves) -> Mesh:
    return point_meshes.poisson(curves)


def _alpha_shape(structure: Structure, curves: Curves) -> Mesh:
    return point_meshes.alpha_shape(curves)


#: By the names that the configuration and the tables use.
SURFACES = {
    method.title: method
    for method in (
        Baseline("marching cubes", _marching_cubes, "scikit-image"),
        Baseline("flying edges + windowed sinc", _flying_edges_smoothed, "VTK"),
        Baseline("surface nets", _surface_nets, "VTK"),
        Baseline("signed distance + isosurface", _distance_isosurface, "slices interpolated by shape, VTK"),
        Baseline(
            "signed distance + isosurface + windowed sinc",
            _distance_isosurface_smoothed,
            "slices interpolated by shape, VTK",
        ),
        Baseline(
            "signed distance + isosurface + windowed sinc 0.01",
            _distance_isosurface_smoothed_more,
            "slices interpolated by shape, VTK, pass band of 3D Slicer's default",
        ),
        Baseline("ball pivoting", _ball_pivoting, "by Delaunay triangles, after Bernardini et al. (1999)"),
        Baseline("Poisson", _poisson, "on a regular grid, after Kazhdan et al. (2006)"),
        Baseline("alpha shape", _alpha_shape, "on Delaunay tetrahedra, after Edelsbrunner and Mücke (1994)"),
    )
}
