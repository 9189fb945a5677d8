"""Surfaces as others make them: a structure with its mask, and its curves in; a mesh in world mm out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from cccd.containers import Curves, Structure
from cccd.geometry.mesh import Mesh
from cccd_paper.comparisons import point_meshes, programs, volume_meshes
from cccd_paper.comparisons.baselines import Baseline, always
from cccd_paper.comparisons.lofted_distances import lofted_distances
from cccd_paper.comparisons.paper_k import DISTANCES
from cccd_paper.comparisons.tensor_product_loft import TUNED, tensor_product_loft
from cccd_paper.comparisons.timing import timed
from cccd_paper.comparisons.volume_meshes import GRID, Smoothing


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

    @property
    def smoothings(self) -> list[Smoothing | None]:
        """What is tried on each isosurface; None: nothing."""
        return [*([None] if self.unsmoothed else []), *GRID]

    def meshes(self, structure: Structure) -> Iterator[tuple[str, Mesh, float]]:
        """Every isosurface, by its setting's name, with the seconds that it took."""
        for name, make in self.shapes.items():
            mesh, seconds = timed(make, structure)
            yield name, mesh, seconds


@dataclass(frozen=True)
class Program:
    """A program that people use, at the settings that suit it best and at its own; it smooths by itself.

    Attributes
    ----------
    title : str
        Name in tables and figures.
    run : callable
        Accepts a structure and settings, and yields a mesh and its processor seconds for each.
    settings : sequence
        What is tried; each is written as the tables do by `str`.
    default : object
        That of ``settings`` which the program takes by itself.
    available : callable
        Whether the program is there.
    package : str
        What brings it.
    """

    title: str
    run: Callable[[Structure, Sequence[Any]], Iterator[tuple[Mesh, float]]]
    settings: Sequence[Any]
    default: Any
    available: Callable[[], bool]
    package: str

    @property
    def smoothings(self) -> list[Smoothing | None]:
        """None: what it made is left as it is."""
        return [None]

    def meshes(self, structure: Structure) -> Iterator[tuple[str, Mesh, float]]:
        """Its mesh at every setting, by the setting's name, with its processor seconds."""
        for setting, (mesh, seconds) in zip(self.settings, self.run(structure, self.settings), strict=True):
            yield str(setting), mesh, seconds


def _of_mask(run: Callable[[Structure], Mesh]) -> Callable[[Structure, Curves], Mesh]:
    return lambda structure, _: run(structure)


def _of_points(title: str, run: Callable[[Curves], Mesh], publication: str) -> Baseline:
    """Name a method that sees the curves' points alone; it is Open3D's."""
    note = f"{publication}: Open3D"
    return Baseline(title, lambda _, curves: run(curves), note, point_meshes.has_open3d, point_meshes.OPEN3D)


#: By the names that the configuration and the tables use.
SURFACES = {
    method.title: method
    for method in (
        Baseline("marching cubes", _of_mask(volume_meshes.marching_cubes), "scikit-image"),
        Baseline("surface nets", _of_mask(volume_meshes.surface_nets), "VTK"),
        Baseline(
            "signed distance + isosurface",
            _of_mask(volume_meshes.distance_isosurface),
            "slices interpolated by shape, VTK",
        ),
        Baseline(
            "paper's loft, eq. (10)", lambda _, curves: tensor_product_loft(curves), f"one tube: {TUNED}"
        ),
        _of_points("ball pivoting", point_meshes.ball_pivoting, "Bernardini et al. (1999)"),
        _of_points("Poisson", point_meshes.poisson, "Kazhdan et al. (2006)"),
        _of_points("alpha shape", point_meshes.alpha_shape, "Edelsbrunner and Mücke (1994)"),
    )
}

#: Those that are tuned, by the same names.
FAMILIES: dict[str, Family | Program] = {
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
        Program(
            "niimath",
            programs.by_niimath,
            programs.NIIMATH_GRID,
            programs.Niimath(),
            programs.has_niimath,
            programs.NIIMATH,
        ),
        Program(
            "3D Slicer, flying edges",
            programs.by_slicer,
            programs.SLICER_EDGES,
            programs.Slicer(),
            programs.has_slicer,
            programs.SLICER,
        ),
        Program(
            "3D Slicer, surface nets",
            programs.by_slicer,
            programs.SLICER_NETS,
            programs.Slicer(nets=True),
            programs.has_slicer,
            programs.SLICER,
        ),
    )
}
