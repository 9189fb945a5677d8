"""Settings of the surface: lofting, meshing, the files that are written."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator

from cccd.settings.section import Section, setting
from cccd.settings.validators import without_repeats

__all__ = ["LoftSettings"]

_Format = Literal["ply", "stl", "vtp", "glb", "step", "nii.gz", "dcm"]


class LoftSettings(Section):
    """How curves become a surface (section ``surface``)."""

    tolerance_voxels: float = setting(
        0.15,
        "mean distance between curves and surface that is good enough, in voxel edges",
        why="Below that the surface follows the pixels' steps. The edge is the pixel size, the cube root of "
        "the voxel's volume, or 1.5 mm, whichever is least.",
        unit="voxel edges",
        gt=0,
        le=10,
    )
    compactness: float = setting(
        150.0,
        "marching cubes' bytes per byte of control points, at least",
        why="Control points are added only while marching cubes' mesh (binary PLY) has this many times "
        "their bytes (float32).",
        unit="ratio",
        gt=0,
    )
    compactness_thin: float = setting(
        40.0,
        "the same for thin organs and coarse scans",
        why="An organ that is few voxels thick has too small a mesh to compare with.",
        unit="ratio",
        gt=0,
    )
    bridge_slices: int = setting(
        3,
        "slices that may be missing in a row before an organ counts as two",
        why="At wider gaps the surface ends and starts anew.",
        unit="slices",
        ge=1,
    )
    edge_voxels: float = setting(
        1.5,
        "edge length of the mesh's triangles, in pixels",
        why="Finer triangles show no more of what the scan tells.",
        unit="px",
        ge=0.25,
        le=20,
    )
    formats: Annotated[tuple[_Format, ...], AfterValidator(without_repeats)] = setting(
        ("ply",),
        "besides, of stl, vtp, glb, step (CAD), nii.gz (label map), dcm (RTSTRUCT)",
        why="The PLY mesh is always written. step needs the extra cadquery-ocp-novtk; nii.gz is a label map "
        "on the scan's grid.",
    )
    contour_spacing_mm: float | None = setting(
        None,
        "distance of the RTSTRUCT's planes; null: the scan's slices",
        why="Planning systems expect contours on the scan's slices.",
        unit="mm",
        gt=0,
    )
