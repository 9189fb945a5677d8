"""Settings of the surface: lofting, meshing, the files that are written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import AfterValidator, Field

from cccd.settings.section import Section, setting
from cccd.settings.validators import ascending, without_repeats

__all__ = [
    "SOLID_FORMATS",
    "SURFACE_FORMATS",
    "TETRAHEDRA_FORMATS",
    "BlendingSettings",
    "DetailSettings",
    "FittingSettings",
    "InterpolationSettings",
    "LoftSettings",
    "MatchingSettings",
    "SolidSettings",
    "TetrahedraSettings",
    "WallSettings",
]


def _writers(package: str) -> dict[str, str]:
    """Names of the formats that a package has writers for, and their modules, without loading them."""
    folder = Path(__file__).parents[1] / package / "formats"
    found = sorted(path.stem for path in folder.glob("[a-z]*.py"))
    names = {stem: "3mf" if stem == "threemf" else stem.replace("_", ".") for stem in found}
    return {name: f"cccd.{package}.formats.{stem}" for stem, name in names.items()}


#: Formats of solids, by OpenCASCADE, of tetrahedra, and all; each with the module that writes it.
SOLID_FORMATS = _writers("solids")
TETRAHEDRA_FORMATS = _writers("tetrahedra")
SURFACE_FORMATS = dict(sorted((_writers("surface") | SOLID_FORMATS | TETRAHEDRA_FORMATS).items()))

_Length = Annotated[float, Field(gt=0, le=20)]
_Width = Annotated[float, Field(gt=0, le=5)]

if TYPE_CHECKING:
    _Format = _CaseFormat = str
else:
    _Format = Literal[tuple(SURFACE_FORMATS)]
    _CaseFormat = Literal[tuple(SOLID_FORMATS | TETRAHEDRA_FORMATS)]


class SheetSettings(Section):
    """Slits and plates that move aside from slice to slice."""

    steepest: float = setting(
        2.2,
        "they are followed so far aside, in distances between slices; 0: not at all",
        why="Fissures of lungs lie at 45 to 65 degrees to the axis; 3 finds no more.",
        unit="ratio",
        expert=True,
        ge=0,
        le=10,
    )
    kept: Annotated[tuple[float, float], AfterValidator(ascending)] = setting(
        (0.2, 0.5),
        "they move all the way where distances that are interpolated as they lie keep less than the first "
        "share of their width, not at all where they keep the second",
        why="What overlaps itself is interpolated better as it lies, along a smooth curve. Phantom lungs are "
        "alike from 0.2, 0.4 to 0.35, 0.7; with these two real lungs of 5 mm lose 1 %.",
        unit="share",
        expert=True,
    )
    least_length: float = setting(
        0.5,
        "they are found over so much of two distances between slices along them",
        why="Without it vessels at the lungs' roots are taken for sheets.",
        unit="share",
        expert=True,
        ge=0,
        le=1,
    )


class BranchSettings(Section):
    """Branches that move aside from slice to slice by more than they are wide."""

    steepest: float = setting(
        3.0,
        "they are followed so far aside, in distances between slices; 0: not at all",
        why="At 72 degrees to the axis; what lies nearer to the slices' plane shows on one slice as a whole.",
        unit="ratio",
        expert=True,
        ge=0,
        le=10,
    )
    kept: Annotated[tuple[float, float], AfterValidator(ascending)] = setting(
        (0.6, 0.85),
        "they move all the way where distances that are interpolated as they lie keep less than the first "
        "share of their area half way, not at all where they keep the second",
        why="A disc that moves by 1.6 and by 1.0 of its radii keeps these.",
        unit="share",
        expert=True,
    )


class InterpolationSettings(Section):
    """Levels between slices."""

    level_pixels: float = setting(
        1.5,
        "levels between slices lie at most so far apart",
        why="Rings of neighbouring levels then overlap, and walls between slices are as finely sampled as in "
        "the plane.",
        unit="px",
        expert=True,
        ge=0.5,
        le=10,
    )

    knot_pixels: float = setting(
        1.2,
        "knots of the spline that smooths the slices' distances where tubes meet",
        why="Narrower and blends show the slices, wider and thin branches shrink.",
        unit="px",
        expert=True,
        ge=1,
        le=10,
    )

    learned_ratios: Annotated[tuple[float, float, float, float], AfterValidator(ascending)] = setting(
        (1.2, 1.5, 2.5, 3.5),
        "slice distances, in pixels, between which the learned filling has a share in the fields: none, all, "
        "all, none",
        why="Below them the pixels tell as much as the slices do; above them contours are known finely "
        "enough to be interpolated, which on smooth organs is nearer to the truth.",
        unit="px",
        expert=True,
    )
    sheets: SheetSettings = setting(
        SheetSettings(),
        "slits and plates that move aside from slice to slice",
        why="A fissure of the lungs would be a chain of pearls.",
        expert=True,
    )
    branches: BranchSettings = setting(
        BranchSettings(),
        "branches that move aside from slice to slice by more than they are wide",
        why="A vessel that runs aslant would be a chain of pearls.",
        expert=True,
    )


class DetailSettings(Section):
    """How many control points a surface may have: one continuous rule between the two compactnesses."""

    coarsest_mm: float = setting(
        1.5,
        "tolerance_voxels and edge_voxels count voxels no larger than this",
        why="On coarse voxels organs show few features; a tolerance that grew with them would lose those.",
        unit="mm",
        expert=True,
        gt=0,
        le=100,
    )
    coarse_mm: Annotated[tuple[float, float], AfterValidator(ascending)] = setting(
        (2.0, 3.0),
        "from the first on a voxel counts as coarse, fully at the second, by its longest effective edge ...",
        why="Features of organs have a size in mm; on coarse voxels few voxels make one up.",
        unit="mm",
        expert=True,
    )
    slice_share: float = setting(
        0.6,
        "... which is the pixel's, or this share of the slice distance",
        why="Levels between slices are interpolated; pixels are not.",
        unit="share",
        expert=True,
        gt=0,
        le=1,
    )
    thin_voxels: Annotated[tuple[float, float], AfterValidator(ascending)] = setting(
        (15.0, 30.0),
        "thin below the first of these, not at all from the second on: six times volume by surface",
        why="A thin organ has few voxels for its curvature.",
        unit="voxels",
        expert=True,
    )


class MatchingSettings(Section):
    """Which rings become a tube, how tubes branch, how they end."""

    smallest_part_voxels: float = setting(
        6.0,
        "parts of less volume are left out",
        why="Specks of a few voxels are noise of the mask.",
        unit="voxels",
        expert=True,
        ge=0,
        le=1000,
    )
    junction_slope: float = setting(
        2.0,
        "in a junction the trunk takes over so many mm of the branch's width per mm of depth",
        why="Steeper and the trunk's wall folds; shallower and junctions reach into the next one.",
        unit="mm per mm",
        expert=True,
        gt=0,
        le=20,
    )
    junction_depth: float = setting(
        1.15,
        "a branch reaches this many times as deep as it takes the trunk to hold its whole width",
        why="Its end is then inside the trunk.",
        unit="ratio",
        expert=True,
        ge=1,
        le=5,
    )
    overlap_pixels: float = setting(
        1.5,
        "branch and trunk overlap by so much beyond the line that splits them",
        why="Solids that only touch are not joined.",
        unit="px",
        expert=True,
        gt=0,
        le=20,
    )
    cover_pixels: float = setting(
        3.0,
        "a branch's covered end lies at most so deep below the trunk's surface",
        why="Deep enough that the fitted branch stays covered.",
        unit="px",
        expert=True,
        gt=0,
        le=20,
    )
    cover_slope: float = setting(
        0.3,
        "a branch sinks below the trunk's surface by so many mm per mm of the trunk's transition offset",
        why="A gentle slope leaves the branch's net smooth.",
        unit="mm per mm",
        expert=True,
        gt=0,
        le=5,
    )
    fade_pixels: float = setting(
        4.0,
        "width over which the trunk sinks below the branch's surface where it leaves the outline to it",
        why="Otherwise the trunk's outline would have corners there.",
        unit="px",
        expert=True,
        gt=0,
        le=50,
    )
    lowest_cap_steps: float = setting(
        0.1,
        "rounded caps are at least so high",
        why="A cap without height would have a sharp rim.",
        unit="slice steps",
        expert=True,
        gt=0,
        lt=0.5,
    )
    highest_cap_steps: float = setting(
        0.95,
        "rounded caps are at most so high",
        why="Their pole stays short of the next slice, where nothing is.",
        unit="slice steps",
        expert=True,
        ge=0.5,
        lt=1,
    )
    rim_depth: float = setting(
        0.7,
        "the rounded rim of a planar cap cuts at most so deep into it",
        why="Leaves a bent or branched end its shape.",
        unit="share of the inradius",
        expert=True,
        gt=0,
        lt=1,
    )
    opening_share: float = setting(
        0.25,
        "a hole opens where at least this share of it meets the outside on the next level",
        why="Less is noise along the hole's wall.",
        unit="share",
        expert=True,
        gt=0,
        le=1,
    )


class FittingSettings(Section):
    """How a tube is sampled, and fitted by a control net."""

    facing_weight: float = setting(
        1.0,
        "points of neighbouring sections that face apart by this much of the square of the section's radius "
        "count as that far apart",
        why="Matched by distance alone, both walls of a narrow lobe would go to one.",
        unit="squared radii",
        expert=True,
        ge=0,
        le=100,
    )
    relaxation: float = setting(
        0.3,
        "share by which the spacing of matched points goes towards that of their neighbours, per section",
        why="Where a lobe grows the points spread into it.",
        unit="share",
        expert=True,
        ge=0,
        le=0.5,
    )
    evening: float = setting(
        0.3,
        "share by which it goes towards even spacing, per section",
        why="Points that were drawn together spread again.",
        unit="share",
        expert=True,
        ge=0,
        le=0.5,
    )
    hidden_pixels: float = setting(
        1.5,
        "samples further from the organ's boundary than this lie inside another tube",
        why="More than a pixel's steps, less than a tube's wall in its trunk.",
        unit="px",
        expert=True,
        gt=0,
        le=20,
    )
    hidden_weight: float = setting(
        0.05,
        "weight of samples that another tube or a blend hides in the end",
        why="Control points are spent where the surface is seen.",
        unit="share",
        expert=True,
        gt=0,
        lt=1,
    )
    jump_pixels: float = setting(
        8.0,
        "where matched points of neighbouring sections lie this far apart the tube jumps",
        why="No spline follows without ringing; the blend takes over.",
        unit="px",
        expert=True,
        gt=1,
        le=100,
    )
    smoothing_pixels: float = setting(
        0.45,
        "waves of 2 pi times this length are halved, longer ones pass",
        why="What is shorter than three pixels is noise of the pixels.",
        unit="px",
        expert=True,
        ge=0,
        le=10,
    )
    corrections: int = setting(
        3,
        "rounds of parameter and area correction",
        why="Least squares shrinks curved outlines; every round gives back part of that.",
        unit="count",
        expert=True,
        ge=0,
        le=50,
    )
    growth: float = setting(
        1.25,
        "control nets grow by this factor, in one direction at a time",
        why="Smaller steps cost fits, larger ones control points.",
        unit="ratio",
        expert=True,
        gt=1,
        le=4,
    )
    first_share: float = setting(
        0.25,
        "share of the control points that are laid out evenly before errors say where more are needed",
        why="Enough that the first errors mean something.",
        unit="share",
        expert=True,
        gt=0,
        le=1,
    )


class BlendingSettings(Section):
    """How tubes are joined into one mesh."""

    reach_pixels: float = setting(
        8.0,
        "blends reach so far to either side of the line along which tubes meet ...",
        why="Wide enough to hide the seam of two fits.",
        unit="px",
        expert=True,
        gt=0,
        le=100,
    )
    reach_steps: float = setting(
        3.0,
        "... or this far, where that is more",
        why="On thick slices a junction spans some of them.",
        unit="slice steps",
        expert=True,
        gt=0,
        le=100,
    )
    fade_cells: float = setting(
        2.0,
        "a blend fades out within so many cells of where the slices end",
        why="Planar caps stay where they are.",
        unit="cells",
        expert=True,
        gt=0,
        le=20,
    )
    wall_share: float = setting(
        0.25,
        "share of the slices' interpolated distances in walls away from seams; the splines have the rest",
        why="Both err between slices and not alike, so that a mean is nearer than either. At 0.4 brains gain "
        "a little more, and smooth walls show the grain of the pixels.",
        unit="share",
        expert=True,
        ge=0,
        le=1,
    )
    wall_tilts: Annotated[tuple[float, float], AfterValidator(ascending)] = setting(
        (0.4, 0.8),
        "what rises as steeply as the first is a wall, what lies as flat as the second none: the part of the "
        "normal along the slice axis",
        why="Where the organ ends between two slices distances in the plane tell little.",
        unit="share",
        expert=True,
    )
    thickness_cells: float = setting(
        25.0,
        "thin organs have so many cells through six times volume by surface",
        why="A plate, a third of that, still has eight cells through it.",
        unit="cells",
        expert=True,
        gt=0,
        le=500,
    )
    most_offset_pixels: float = setting(
        0.25,
        "the whole surface moves by at most this to regain the volume of the slices",
        why="More would be an error of the fit to be seen, not to be hidden.",
        unit="px",
        expert=True,
        ge=0,
        le=5,
    )
    fairing_band: float = setting(
        0.02,
        "the mesh's windowed sinc filter passes so much of its spectrum per pixel of its edges",
        why="The grid on which tubes are joined leaves ripples of a few edges; narrower, and the organ's own "
        "details go.",
        unit="share per px",
        expert=True,
        gt=0,
        le=2,
    )
    fairing_rounds: int = setting(
        60,
        "degree of that filter",
        why="More cut more sharply, and cost as much more; fewer than five make no filter.",
        unit="count",
        expert=True,
        ge=5,
        le=200,
    )
    regain_pixels: Annotated[tuple[_Length, _Length, _Length], AfterValidator(ascending)] = setting(
        (0.8, 1.6, 4.5),
        "what that filter takes along the normals is given back: its average over the last of these lengths "
        "(standard deviation), and details between each two of them where they are more than ripples",
        why="Branches and tips are not drawn in, and walls stay smooth.",
        unit="px",
        expert=True,
    )
    regain_ripples: tuple[float, float] = setting(
        (0.03, 0.025),
        "so high are ripples between the first two of these lengths, and between the last two (root mean "
        "square)",
        why="That much of the pixels' steps is left on phantoms; gyri and branches are two and three times "
        "as high.",
        unit="px",
        expert=True,
    )
    regain_pixels_probability: float = setting(
        1.1,
        "from the level of probabilities all of what that filter takes is given back, as its average over so "
        "far",
        why="They tell to a tenth of a pixel where it is: less of what the filter takes is a ripple.",
        unit="px",
        expert=True,
        gt=0,
        le=20,
    )
    regain_rounds: int = setting(
        2,
        "times that this is done, each with what the last one left",
        why="The first leaves some of what is as short as a branch is thick; a third returns more ripples.",
        unit="count",
        expert=True,
        ge=0,
        le=10,
    )


class WallSettings(Section):
    """How organs of one scan are smoothed together."""

    cell_pixels: float = setting(
        0.6,
        "cells of the grid on which organs meet, in pixels (of coarsest_mm at most)",
        why="A shell of one pixel has a node in it. At 0.75 ribs and vessels lose a tenth of their accuracy.",
        unit="px",
        expert=True,
        ge=0.25,
        le=5,
    )
    coarsest_mm: float = setting(
        1.9,
        "cell_pixels counts pixels no larger than this",
        why="Cells are then about half as long as the edges of the meshes that organs have alone.",
        unit="mm",
        expert=True,
        gt=0,
        le=100,
    )
    border_voxels: tuple[_Width, _Width] = setting(
        (0.5, 0.6),
        "width of the kernel that smooths the border of all labels where organs touch, on voxels of "
        "border_mm",
        why="At 0.6 half of the organs of a fine CT lie farther from their voxels than alone, at 0.5 voxels "
        "of 3 mm show their steps; at 0.7 gaps of one voxel close.",
        unit="voxels",
        expert=True,
    )
    border_mm: Annotated[tuple[float, float], AfterValidator(ascending)] = setting(
        (1.0, 2.0),
        "the first width holds for voxels up to this edge, the second from this edge on",
        why="Features of organs have a size in mm; on coarse voxels few voxels make one up.",
        unit="mm",
        expert=True,
    )
    reach_voxels: float = setting(
        3.0,
        "that border takes over so far from walls, in the longest edge of the voxel",
        why="As wide as the rounded edges that organs have alone.",
        unit="voxels",
        expert=True,
        gt=0,
        le=50,
    )
    stiffness: float = setting(
        5.0,
        "weight of a thin plate's energy against distance, in the smoothing of the walls",
        why="The grid leaves ripples of a few edges; stiffer, and the organs' own details go.",
        unit="ratio",
        expert=True,
        ge=0,
        le=1000,
    )
    line_stiffness: float = setting(
        150.0,
        "the same along the lines where three walls meet",
        why="To which organ a node beside a line goes is nearly a draw; as stiff as walls, lines have teeth.",
        unit="ratio",
        expert=True,
        ge=0,
        le=1e4,
    )
    regain_pixels: float = setting(
        1.6,
        "what that smoothing takes along the normals is given back as its average over so far (standard "
        "deviation), but not along lines where walls meet",
        why="Ribs and vessels are not drawn in.",
        unit="px",
        expert=True,
        gt=0,
        le=20,
    )
    regain_rounds: int = setting(
        2,
        "times that this is done, each with what the last one left",
        why="As in surfaces that are smoothed alone.",
        unit="count",
        expert=True,
        ge=0,
        le=10,
    )
    most_offset_pixels: float = setting(
        0.25,
        "walls move by at most this to give every organ the volume of its voxels",
        why="As surfaces that are smoothed alone.",
        unit="px",
        expert=True,
        ge=0,
        le=5,
    )


class SolidSettings(Section):
    """How the mesh becomes solids for CAD."""

    first_patches: int = setting(
        300,
        "spline patches that a solid begins with, shared out by area; more come where they do not follow it",
        why="Where fewer would do the file is small already.",
        unit="patches",
        expert=True,
        ge=12,
        le=100_000,
    )
    most_patches: int = setting(
        10_000,
        "spline patches that a solid has at most; what needs more is made of planar facets",
        why="Four kilobytes each in STEP: more than facets would take.",
        unit="patches",
        expert=True,
        ge=12,
        le=1_000_000,
    )
    most_facets: int = setting(
        40_000,
        "planar faces that a faceted solid has at most",
        why="About a kilobyte each in STEP, and CAD programs slow down beyond.",
        unit="faces",
        expert=True,
        ge=4,
        le=1_000_000,
    )


class TetrahedraSettings(Section):
    """How closed surfaces are filled with tetrahedra."""

    mesher: Literal["ftetwild", "gmsh", "gmsh-step"] = setting(
        "ftetwild",
        "ftetwild, or gmsh where that program is installed: of the surfaces, or of organs' STEP solids",
        why="fTetWild (extra fe) also fills surfaces that cross. gmsh, a program of its own, wants walls "
        "that are shared or apart. gmsh-step (extra cad) puts vertices on splines; its organs lie apart.",
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
        expert=True,
        ge=1000,
        le=1_000_000_000,
    )
    energy: float = setting(
        10.0,
        "ftetwild: tetrahedra are improved until the worst has this conformal energy; 3 is a regular one",
        why="At 20 angles of four degrees stay, at 10 of twenty on smooth organs, for the same time; below, "
        "the last rounds are spent on few tetrahedra.",
        unit="1",
        expert=True,
        gt=3,
        le=1000,
    )
    sharp_deg: float = setting(
        40.0,
        "gmsh: faces of the surface that meet at more than this angle keep the edge between them",
        why="Lids where the scan cuts an organ meet its wall at more, triangles of smooth walls at less.",
        unit="degrees",
        expert=True,
        gt=0,
        le=180,
    )
    shortest: float = setting(
        2.0,
        "gmsh: edges are no shorter than this many times the tolerance",
        why="On a radius of the tolerance a chord is as long: shorter ones follow nothing that is asked for.",
        unit="tolerances",
        expert=True,
        gt=0,
        le=100,
    )
    bends: float = setting(
        0.25,
        "gmsh-step: edges are as short as the tolerance asks on a radius of this times that of a ball of the "
        "organ's volume by surface",
        why="By curvature Gmsh takes minutes on a thousand splines, so all edges have one size. Folds bend "
        "more than the ball; of this size a brain has 41,000 tetrahedra, and its volume to 0.01 %.",
        unit="ratio",
        expert=True,
        gt=0,
        le=1,
    )
    rounds: int = setting(
        40,
        "ftetwild: rounds of improvement at most",
        why="What is not good by then is held by the surface.",
        unit="count",
        expert=True,
        ge=1,
        le=1000,
    )


class LoftSettings(Section):
    """How curves become a surface (section ``surface``)."""

    source: Literal["splines", "polygons", "corners"] = setting(
        "splines",
        "lofted from the curves' closed splines, the curves themselves, or splines through their corners",
        why="Splines carry no pixel steps into the surface; corners are the paper's way (Definition 4).",
    )
    method: Literal["spline", "tubes"] = setting(
        "tubes",
        "tubes that are blended into a mesh, or one Catmull-Clark spline that is itself the surface",
        why="The spline is compact and is what is exported; it replaces tubes once it is better everywhere.",
    )
    corner_k: int = setting(
        7,
        "corners: longest support of the k-cosine whose sharpest points the splines go through",
        why="The middle of the paper's sweep.",
        unit="px",
        ge=1,
        le=1000,
    )
    tolerance_voxels: float = setting(
        0.06,
        "mean distance between outlines and surface that is good enough, in voxel edges",
        why="Much below that the surface follows what splines leave of the pixels' steps. The edge is the "
        "pixel size, the cube root of the voxel's volume, or 1.5 mm, whichever is least.",
        unit="voxel edges",
        gt=0,
        le=10,
    )
    tolerance_filled: float = setting(
        0.03,
        "the same where the learned filling interpolates the slices",
        why="It takes the pixels' steps off the outlines: there is nothing that the fit should leave out.",
        unit="voxel edges",
        gt=0,
        le=10,
    )
    compactness: float = setting(
        105.0,
        "marching cubes' bytes per byte of control points, at least",
        why="Control points are added only while marching cubes' mesh of the slices, interpolated to cubic "
        "voxels, has this many times their bytes (binary PLY; float32).",
        unit="ratio",
        gt=0,
    )
    compactness_thin: float = setting(
        32.0,
        "the same for thin organs and coarse scans; in between, in between",
        why="An organ that is few voxels thick has too small a mesh to compare with.",
        unit="ratio",
        gt=0,
    )
    compactness_filled: float = setting(
        8.0,
        "the same for thin organs and coarse scans whose slices the learned filling interpolates",
        why="What it adds between the slices, marching cubes' mesh of the voxels does not show.",
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
        "edge length of the mesh's triangles, in pixels (of 1.5 mm at most: see detail.coarsest_mm)",
        why="Finer triangles show no more of what the scan tells; larger ones cut corners of the organ.",
        unit="px",
        ge=0.25,
        le=20,
    )
    formats: Annotated[tuple[_Format, ...], AfterValidator(without_repeats)] = setting(
        ("ply",),
        "the surface's files; docs/configuration.md lists the formats; ply always",
        why="Every later step reads the PLY mesh. step, iges and brep hold closed solids and need the "
        "extra cad; msh, vtu and inp hold tetrahedra and need the extra fe; 3mf is for printing and needs "
        "the extra print; usd, usda and usdc hold the spline itself and need the extra usd; nii.gz is a "
        "label map on the scan's grid, dcm an RTSTRUCT, seg.dcm a SEG on the row's DICOM series, stl.dcm an "
        "encapsulated STL.",
    )
    case_formats: Annotated[tuple[_CaseFormat, ...], AfterValidator(without_repeats)] = setting(
        (),
        f"files of all organs of a case, of {', '.join(SOLID_FORMATS | TETRAHEDRA_FORMATS)}",
        why="step, iges and brep are one scene of solids, results/CASE/scene.step; msh, vtu and inp one mesh "
        "of tetrahedra in which organs share their walls, results/CASE/volume.msh.",
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
        "the RTSTRUCT says who the patient is, as the scan's DICOM files do",
        why="Archives file it by that; but results are passed on, and nothing else in them names anybody.",
    )
    step_tolerance_mm: float = setting(
        0.2,
        "solids (step, iges, brep): 99 % of their surface lies so near to the mesh",
        why="Below the voxels of most scans. Half of it takes about twice the faces; metrics.json says what "
        "was reached.",
        unit="mm",
        gt=0,
        le=100,
    )
    tetrahedra: TetrahedraSettings = setting(
        TetrahedraSettings(), "from surfaces to tetrahedra (msh, vtu, inp)", why="For simulation."
    )
    solid: SolidSettings = setting(SolidSettings(), "from the mesh to solids", why="Tuned on phantoms.")
    shared_walls: bool | Literal["auto"] = setting(
        "auto",
        "organs of a case are smoothed together, with one wall between two; auto: those of organ *",
        why="Neighbours that are smoothed alone overlap or gape. What shares its walls is meshed by case, in "
        "one job that holds all of its organs.",
    )
    walls: WallSettings = setting(
        WallSettings(), "organs of one scan smoothed together", why="Tuned on phantoms and shared scans."
    )
    interpolation: InterpolationSettings = setting(
        InterpolationSettings(), "levels between slices", why="Tuned on phantoms and shared scans."
    )
    detail: DetailSettings = setting(
        DetailSettings(), "how many control points", why="Tuned on phantoms and shared scans."
    )
    matching: MatchingSettings = setting(
        MatchingSettings(), "from rings to tubes", why="Tuned on phantoms and shared scans."
    )
    fitting: FittingSettings = setting(
        FittingSettings(), "from tubes to control nets", why="Tuned on phantoms and shared scans."
    )
    blending: BlendingSettings = setting(
        BlendingSettings(), "from control nets to one mesh", why="Tuned on phantoms and shared scans."
    )

    def mesh_edge(self, pixel: float) -> float:
        """Edge length in mm of the mesh's triangles, for pixels of a size in mm."""
        return self.edge_voxels * min(pixel, self.detail.coarsest_mm)
