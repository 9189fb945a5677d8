"""Surfaces as others make them: a structure with its mask, and its curves in; a mesh in world mm out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from cccd.containers import Curves, Structure
from cccd.geometry.mesh import Mesh
from cccd_paper.comparisons import point_meshes, volume_meshes
from cccd_paper.comparisons.baselines import Baseline, always
from cccd_paper.comparisons.lofted_distances import lofted_distances
from cccd_paper.comparisons.paper_k import DISTANCES
from cccd_paper.comparisons.tensor_product_loft import tensor_product_loft

__all__ = ["FAMILIES", "SURFACES", "Family"]


@dataclass(frozen=True)
class Family:
    """An isosurface that is smoothed by windowed sinc, at the settings that suit it best.

    Attributes
    ----------
    title : str
        Name in tables and figures.
    shapes : dict of str to callable
        What makes the isosurface of a structure, by the setting's name.
    unsmoothed : bool
        Whether it is tried without windowed sinc, too.
    available : callable
        Whether the packages that it needs are there.
    package : str
        The optional one.
    """

    title: str
    shapes: dict[str, Callable[[Structure], Mesh]]
    unsmoothed: bool = False
    available: Callable[[], bool] = always
    package: str = ""


def _marching_cubes(structure: Structure, curves: Curves) -> Mesh:
    return volume_meshes.marching_cubes(structure)


def _surface_nets(structure: Structure, curves: Curves) -> Mesh:
    return volume_meshes.surface_nets(structure)


def _distance_isosurface(structure: Structure, curves: Curves) -> Mesh:
    return volume_meshes.distance_isosurface(structure)


def _tensor_product_loft(structure: Structure, curves: Curves) -> Mesh:
    return tensor_product_loft(curves)


def _ball_pivoting(structure: Structure, curves: Curves) -> Mesh:
    return point_meshes.ball_pivoting(curves)


def _poisson(structure: Structure, curves: Curves) -> Mesh:
    return point_meshes.poisson(curves)


def _alpha_shape(structure: Structure, curves: Curves) -> Mesh:
    return point_meshes.alpha_shape(curves)


def _of_points(title: str, run: Callable[[Structure, Curves], Mesh], publication: str) -> Baseline:
    """Name a method that sees the curves' points alone; it is Open3D's."""
    note = f"{publication}: Open3D"
    return Baseline(title, run, note, point_meshes.has_open3d, point_meshes.OPEN3D)


#: By the names that the configuration and the tables use.
SURFACES = {
    method.title: method
    for method in (
        Baseline("marching cubes", _marching_cubes, "scikit-image"),
        Baseline("surface nets", _surface_nets, "VTK"),
        Baseline("signed distance + isosurface", _distance_isosurface, "slices interpolated by shape, VTK"),
        Baseline("paper's loft, eq. (10)", _tensor_product_loft, "one tube through the corners of k = 7"),
        _of_points("ball pivoting", _ball_pivoting, "Bernardini et al. (1999)"),
        _of_points("Poisson", _poisson, "Kazhdan et al. (2006)"),
        _of_points("alpha shape", _alpha_shape, "Edelsbrunner and Mücke (1994)"),
    )
}

#: Those that are tuned, by the same names.
FAMILIES = {
    family.title: family
    for family in (
        Family("flying edges + windowed sinc", {"": volume_meshes.flying_edges}),
        Family("signed distance + isosurface + windowed sinc", {"": volume_meshes.distance_isosurface}),
        Family(
            "signed distance + Gaussian + windowed sinc",
            {"sigma 1 px": partial(volume_meshes.distance_isosurface, sigma_pixels=1.0)},
            unsmoothed=True,
        ),
        Family("anti-aliased binary + windowed sinc", {"": volume_meshes.antialiased_isosurface}),
        Family(
            "morphological interpolation + windowed sinc",
            {"": volume_meshes.morphological_isosurface},
            available=volume_meshes.has_morphological,
            package=volume_meshes.MORPHOLOGICAL,
        ),
        Family(DISTANCES, {"": lofted_distances}),
    )
}
