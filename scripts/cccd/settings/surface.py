"""Settings of the surface: lofting, meshing, the files that are written."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator

from cccd.plugins import band_formats, formats
from cccd.settings import OneOf, Section, setting, without_repeats

_Format = Annotated[str, OneOf(lambda: (*formats(), *band_formats()))]
_CaseFormat = Annotated[str, OneOf(lambda: (*formats("solids"), *formats("tetrahedra")))]

#: Keys of `LoftSettings` that say how files of some formats are written,
EXPORT_KEYS = ("contour_spacing_mm", "keep_patient", "step_tolerance_mm", "tetrahedra")
#: and all that decide on files, not on an organ's surface, so that a change lofts and compares nothing again.
FILE_KEYS = ("formats", "case_formats", "shared_walls", *EXPORT_KEYS)


class TetrahedraSettings(Section):
    """How closed surfaces are filled with tetrahedra."""

    elements: Literal["tet4", "tet10"] = setting(
        "tet4",
        "tet4: linear tetrahedra; tet10: quadratic ones, with nodes in the middle of edges",
        why="Quadratic ones are curved along the surface. On the same mesh, a pressed sphere's "
        "displacement is off by 1 % instead of 16 %. They have seven times the nodes.",
    )
    edge_mm: float | None = setting(
        None,
        "edges are about this long where the surface allows; null: a twentieth of the box's diagonal",
        why="What a solver resolves inside; at the surface its curvature asks for shorter ones. Half of it "
        "takes up to eight times the tetrahedra.",
        unit="mm",
        gt=0,
        le=1000,
    )
    tolerance_mm: float | None = setting(
        None,
        "faces lie this near to the surface, so edges shorten where it curves; null: a 500th of that",
        why="On a radius r edges are at most about the root of 8 r times this. Time grows as it shrinks.",
        unit="mm",
        gt=0,
        le=100,
    )
    most: int = setting(
        1_500_000,
        "more tetrahedra than this, by a rough estimate, are refused before any is made",
        why="fTetWild takes two milliseconds for each (a brain's 22,000 in 49 s): this is an hour.",
        unit="count",
        ge=1000,
        le=1_000_000_000,
    )
    materials: str | None = setting(
        None,
        "CSV that makes elastic materials of grey values; null: none. docs/simulation.md has its columns",
        why="Bone is as stiff as its density lets it be, and CT shows that. It depends on the scanner.",
    )


class LoftSettings(Section):
    """How curves become a surface (section ``surface``)."""

    smoothing: float | None = setting(
        None,
        "shorter waves are smoothed away; null: 8 pixels, or 2.5 slice distances if longer",
        why="Shorter ones leave the steps of pixels, longer ones take detail.",
        unit="mm",
        gt=0,
        le=1000,
    )
    smallest_part_voxels: float = setting(
        6.0,
        "smaller parts are left out",
        why="Specks of a few voxels are noise of the mask.",
        unit="voxels",
        ge=0,
        le=1000,
    )
    bridge_slices: int = setting(
        3,
        "slices that may be missing in a row before an organ counts as two",
        why="At wider gaps the surface ends and begins again.",
        unit="slices",
        ge=1,
    )
    band: float = setting(
        0.9,
        "share of the true surface that lies within the error band (inner_mm, outer_mm)",
        why="What planning margins are made for. Below, bands are narrower; docs/bands.md says what holds.",
        unit="share",
        ge=0.5,
        le=0.95,
    )
    calibration: str | None = setting(
        None,
        "file that cccd calibrate wrote, for the error bands; null: the shipped one",
        why="A band is as wide as errors on the calibration's organs were; your own masks are nearer to you.",
    )
    reader_mm: float | str | None = setting(
        None,
        "mean distance of two readers' borders, or a file of cccd calibrate --readers; null: one reader",
        why="A mask is one person's. With it, bands and intervals hold for the border that another draws.",
        unit="mm",
    )
    formats: Annotated[tuple[_Format, ...], AfterValidator(without_repeats)] = setting(
        ("ply",),
        "the surface's files, see docs/configuration.md; ply always; band.stl: the error band's sides",
        why="Every later step reads the PLY mesh. The table below says what the others hold and need.",
    )
    case_formats: Annotated[tuple[_CaseFormat, ...], AfterValidator(without_repeats)] = setting(
        (),
        "files of all organs of a case: brep, iges, step, feb, inp, msh, vtu",
        why="step, iges and brep are one scene of solids, results/CASE/scene.step; msh, vtu, inp and feb one "
        "mesh of tetrahedra in which organs share their walls, results/CASE/volume.msh.",
    )
    contour_spacing_mm: float | None = setting(
        None,
        "distance of the RTSTRUCT's planes; null: the scan's slices",
        why="Planning systems expect contours on the scan's slices.",
        unit="mm",
        gt=0,
    )
    keep_patient: bool = setting(
        False,
        "copy the patient's name and other data from the scan's DICOM files to those that are written",
        why="Archives need them to file a result. But results are shared, and nothing else names anybody.",
    )
    step_tolerance_mm: float = setting(
        0.2,
        "solids (step, iges, brep): 99 % of their surface lies within this distance of the mesh",
        why="Below the voxels of most scans. Half of it takes about twice the faces; metrics.json says what "
        "was reached.",
        unit="mm",
        gt=0,
        le=100,
    )
    tetrahedra: TetrahedraSettings = setting(
        TetrahedraSettings(), "from surfaces to tetrahedra (msh, vtu, inp, feb)", why="For simulation."
    )
    shared_walls: bool | Literal["auto"] = setting(
        "auto",
        "organs of a case are smoothed together, with one wall between two; auto: those of organ *",
        why="Neighbours that are smoothed alone overlap or gape. What shares its walls is meshed by case, in "
        "one job that holds all of its organs.",
    )
