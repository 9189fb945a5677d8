"""Settings of the comparisons: on which slices, with which parameters, the other methods run."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import AfterValidator, Field

from cccd.settings import Section, setting, without_repeats

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
    "niimath",
    "3D Slicer, flying edges",
    "3D Slicer, surface nets",
    "paper's loft, eq. (10)",
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


class CornerSurfaceSettings(Section):
    """Surfaces from the corner splines of each k."""

    most_slices: int = setting(
        12,
        "organs with more slices are cut to a slab of this many adjacent ones",
        why="A surface for each k takes seconds each; paper_offline.yaml takes them all.",
        unit="count",
        ge=3,
        le=100000,
    )


class IsosurfaceSettings(Section):
    """Surfaces by other methods, measured alike."""

    methods: Annotated[tuple[_Method, ...], AfterValidator(without_repeats)] = setting(
        get_args(_Method),
        "methods to run next to ours",
        why="All that there are, where what they need is installed. Those with windowed sinc, and programs, "
        "are shown at their best settings of a grid.",
    )


class ThickSliceSettings(Section):
    """Every n-th slice kept, reconstructed, compared with the full resolution."""

    spacings_mm: tuple[Annotated[float, Field(gt=0, le=50)], ...] = setting(
        (5.0, 8.0),
        "slice distances to thin to; the nearest multiple of the scan's own is taken",
        why="What clinical scans have; every n-th slice is kept, and n is at least 2.",
        unit="mm",
    )


class ComparisonSettings(Section):
    """The comparisons (section ``comparisons``)."""

    corners: SliceChoice = setting(
        SliceChoice(), "corner detectors, and curves from their points", why="Tables 1, 2, 4 and 5."
    )
    corner_surfaces: CornerSurfaceSettings = setting(
        CornerSurfaceSettings(), "surfaces from the corners of each k", why="The paper's chain to its end."
    )
    isosurfaces: IsosurfaceSettings = setting(
        IsosurfaceSettings(), "surfaces by other methods", why="What surfaces are made with today."
    )
    thick_slices: ThickSliceSettings = setting(
        ThickSliceSettings(), "slices left out and interpolated", why="What thick slices cost."
    )


#: The section ``comparisons``: its model and its default.
SECTION = (
    ComparisonSettings,
    setting(ComparisonSettings(), "the other methods, on the same structures", why="The paper's tables."),
)
