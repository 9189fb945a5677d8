"""Settings of the comparisons: on which slices, with which parameters, the other methods run."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from cccd.settings.section import Section, setting
from cccd.settings.validators import without_repeats

__all__ = [
    "ActiveContourSettings",
    "ComparisonSettings",
    "CornerComparisonSettings",
    "CornerSurfaceSettings",
    "IsosurfaceSettings",
    "ReconstructionSettings",
    "SliceChoice",
    "StageTimeSettings",
    "ThickSliceSettings",
]

_Letter = Annotated[str, Field(pattern="^[a-z]$")]
_Radii = Annotated[float, Field(ge=0, le=10)]
_Method = Literal[
    "marching cubes",
    "flying edges + windowed sinc",
    "surface nets",
    "signed distance + isosurface",
    "signed distance + isosurface + windowed sinc",
    "signed distance + Gaussian + windowed sinc",
    "anti-aliased binary + windowed sinc",
    "morphological interpolation + windowed sinc",
    "CCCD, distances alone + windowed sinc",
    "ball pivoting",
    "Poisson",
    "alpha shape",
]


class SliceChoice(Section):
    """On which slices of a structure a comparison runs."""

    n_slices: int = setting(
        5,
        "slices of each structure, spread evenly over those long enough",
        why="Keeps the comparisons to minutes.",
        unit="count",
        ge=1,
        le=1000,
    )
    min_contour_px: float = setting(
        60.0,
        "slices with shorter contours are not taken",
        why="A curve needs room for the longest k of the sweep.",
        unit="px",
        ge=0,
        le=100000,
    )


class CornerComparisonSettings(SliceChoice):
    """Harris and the other corner detectors (Tables 1 and 2)."""

    on_boundary_px: float = setting(
        1.5,
        "a corner this near to a boundary pixel lies on the boundary",
        why="Covers the eight neighbours.",
        unit="px",
        ge=0,
        le=10,
    )


class ReconstructionSettings(SliceChoice):
    """Curve reconstruction from points (Tables 4 and 5)."""

    every: int = setting(
        4,
        "the sparse point set: every so many-th boundary pixel, moved by this noise",
        why="A quarter of the pixels.",
        unit="px",
        ge=2,
        le=100,
    )
    jitter_px: float = setting(
        0.3,
        "standard deviation of the noise that moves the sparse points",
        why="Takes the points off the pixel grid.",
        unit="px",
        ge=0,
        le=10,
    )
    repeats: int = setting(
        3, "times are medians of so many runs", why="One run may be disturbed.", unit="count", ge=1, le=1000
    )


class ActiveContourSettings(SliceChoice):
    """A B-spline snake from a circular seed (Figure 15)."""

    n_slices: int = setting(
        2,
        "slices of each structure, spread evenly over those long enough",
        why="Each takes a run per seed.",
        unit="count",
        ge=1,
        le=1000,
    )
    figure_15: Annotated[dict[_Letter, tuple[_Radii, _Radii]], Field(min_length=1)] = setting(
        {"a": (1.6, 0.0), "b": (1.2, 0.0), "c": (1.6, 0.3), "d": (1.2, 0.3), "e": (0.5, 0.0)},
        "seeds: radius and offset from the centroid, in radii of a disc of the organ's area",
        why="The five of Figure 15, by letter.",
        unit="disc radii",
    )
    radii: Annotated[tuple[Annotated[float, Field(gt=0, le=10)], ...], Field(min_length=1, max_length=50)] = (
        setting(
            (0.4, 0.7, 1.0, 1.3, 1.6),
            "seed radii of the sweep, in the same unit",
            why="From well inside to well outside.",
            unit="disc radii",
        )
    )
    offsets: Annotated[tuple[_Radii, ...], Field(min_length=1, max_length=50)] = setting(
        (0.0, 0.25, 0.5),
        "distances of the sweep's seeds from the centroid",
        why="From a good guess to a poor one.",
        unit="disc radii",
    )


class CornerSurfaceSettings(Section):
    """Surfaces from the corner splines of each k."""

    most_slices: int = setting(
        12,
        "of an organ with more slices, a slab of so many adjacent ones is taken",
        why="A surface for each k takes seconds each; paper_offline.yaml takes them all.",
        unit="count",
        ge=3,
        le=100000,
    )


class StageTimeSettings(Section):
    """From the image to the surface by every method of Table 5."""

    most_slices: int = setting(
        6,
        "of an organ with more slices, a slab of so many adjacent ones is taken",
        why="Bad curves make bad surfaces, which take longest.",
        unit="count",
        ge=3,
        le=100000,
    )


class IsosurfaceSettings(Section):
    """Surfaces by other methods, measured alike."""

    methods: Annotated[tuple[_Method, ...], AfterValidator(without_repeats)] = setting(
        (
            "marching cubes",
            "flying edges + windowed sinc",
            "surface nets",
            "signed distance + isosurface",
            "signed distance + isosurface + windowed sinc",
            "signed distance + Gaussian + windowed sinc",
            "anti-aliased binary + windowed sinc",
            "morphological interpolation + windowed sinc",
            "CCCD, distances alone + windowed sinc",
            "ball pivoting",
            "Poisson",
            "alpha shape",
        ),
        "methods to run beside ours",
        why="All that there are. Those with windowed sinc are shown at their best settings of a grid.",
    )


class ThickSliceSettings(Section):
    """Every n-th slice kept, reconstructed, compared with the full resolution."""

    spacings_mm: tuple[Annotated[float, Field(gt=0, le=50)], ...] = setting(
        (5.0, 8.0),
        "slice distances to thin to; the nearest multiple of the scan's own is taken",
        why="What clinical scans have; every n-th slice is kept, and n is at least 2.",
        unit="mm",
    )
    tolerance_voxels: float = setting(
        0.08,
        "instead of the surface's own: the other methods' meshes have no limit either",
        why="Here accuracy counts more than size.",
        unit="voxel edges",
        gt=0,
        le=10,
    )
    compactness: float = setting(
        12.0,
        "instead of surface.compactness and compactness_thin",
        why="Here accuracy counts more than size.",
        unit="ratio",
        gt=0,
    )


class ComparisonSettings(Section):
    """The comparisons (section ``comparisons``)."""

    corners: CornerComparisonSettings = setting(
        CornerComparisonSettings(), "corner detectors on pixels", why="Tables 1 and 2."
    )
    reconstruction: ReconstructionSettings = setting(
        ReconstructionSettings(), "curves from unordered points", why="Tables 4 and 5."
    )
    active_contour: ActiveContourSettings = setting(
        ActiveContourSettings(), "a B-spline snake", why="Figure 15."
    )
    corner_surfaces: CornerSurfaceSettings = setting(
        CornerSurfaceSettings(), "surfaces from the corners of each k", why="The paper's chain to its end."
    )
    stage_times: StageTimeSettings = setting(
        StageTimeSettings(), "every method from the image to the surface", why="Table 5, whole."
    )
    isosurfaces: IsosurfaceSettings = setting(
        IsosurfaceSettings(), "surfaces by other methods", why="What surfaces are made with today."
    )
    thick_slices: ThickSliceSettings = setting(
        ThickSliceSettings(), "slices left out and interpolated", why="What thick slices cost."
    )
