"""Settings of the curves: ordering, corners, splines."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cccd.settings.section import Section, setting

__all__ = [
    "CurveSettings",
    "KnotSettings",
    "ReferenceSettings",
    "SharpCornerSettings",
    "SplineFittingSettings",
    "ToleranceSettings",
]

_Support = Annotated[int, Field(ge=1, le=1000)]
_Share = Annotated[float, Field(gt=0, le=1)]
_Attempt = tuple[_Share, _Share, Annotated[float, Field(ge=1, le=100)]]
_Weight = Annotated[float, Field(gt=0, le=1e6)]


class SharpCornerSettings(Section):
    """Where two straight arms meet at an angle: corners that a spline keeps by a triple knot."""

    arm_px: int = setting(
        6,
        "length of the straight arms that meet in a sharp corner",
        why="Shorter arms are straight on any digitised curve.",
        unit="px",
        expert=True,
        ge=2,
        le=100,
    )
    straight_px: float = setting(
        0.5,
        "the arms' pixels lie this near to a straight line",
        why="The digitisation of a straight line leaves it by no more.",
        unit="px",
        expert=True,
        gt=0,
        le=10,
    )
    turn_deg: float = setting(
        60.0,
        "the arms turn by at least this angle",
        why="Blunter corners need no triple knot to stay within the tolerance.",
        unit="degrees",
        expert=True,
        gt=0,
        le=180,
    )


class ToleranceSettings(Section):
    """Where less than ``tolerance_px`` is allowed, and less filtered: one rule for fine and coarse scans."""

    coarsest_mm: float = setting(
        1.5,
        "the tolerance does not grow with pixels larger than this",
        why="Organs are as curved on coarse pixels; the same as for the surface's own tolerance.",
        unit="mm",
        expert=True,
        gt=0,
        le=100,
    )
    full_length_px: float = setting(
        120.0,
        "shorter curves have a tolerance in proportion to their length",
        why="A bronchus of six pixels would lose a tenth of its width.",
        unit="px",
        expert=True,
        gt=0,
        le=10000,
    )


class ReferenceSettings(Section):
    """The curve that a spline is fitted to: the pixel polygon, sampled, its staircase filtered away."""

    staircase_px: float = setting(
        1.5,
        "width of the filter that takes the pixels' steps away",
        why="Steps are a pixel high; a wider filter would take the organ's own shape.",
        unit="px",
        expert=True,
        gt=0,
        le=100,
    )
    pixels_tolerance_px: float = setting(
        0.15,
        "below this tolerance the filter narrows with its square",
        why="A small tolerance brings the pixels back.",
        unit="px",
        expert=True,
        gt=0,
        le=100,
    )
    spacing_px: float = setting(
        1.0,
        "distance of the samples for a budget of control points",
        why="Every pixel counts alike.",
        unit="px",
        expert=True,
        ge=0.1,
        le=10,
    )
    smooth_spacing_px: float = setting(
        2.0,
        "distance of the samples where the filter has its full width",
        why="Without the pixels' steps they may lie further apart.",
        unit="px",
        expert=True,
        ge=0.1,
        le=10,
    )
    samples_per_width: float = setting(
        1.5,
        "samples per width of a narrower filter",
        why="What the filter leaves is no finer.",
        unit="1/width",
        expert=True,
        gt=0,
        le=100,
    )
    fewest_samples: int = setting(
        24,
        "samples of a curve at least",
        why="Six for each control point of the smallest spline.",
        unit="count",
        expert=True,
        ge=8,
        le=10000,
    )


class KnotSettings(Section):
    """How knots are removed until as few as possible are left."""

    first_share: float = setting(
        0.16,
        "even knots to begin with, as a share of the samples",
        why="Enough that few spans must be halved, few enough to be quick.",
        unit="share",
        expert=True,
        gt=0,
        le=1,
    )
    first_share_budget: float = setting(
        0.3,
        "the same for a budget of control points",
        why="All the choice there is: the cheapest knots go until the budget is met.",
        unit="share",
        expert=True,
        gt=0,
        le=1,
    )
    removal_share: float = setting(
        0.25,
        "share of the knots that may go at once within a tolerance ...",
        why="The prices of knots hold while their neighbours stay.",
        unit="share",
        expert=True,
        gt=0,
        le=1,
    )
    close_removal_share: float = setting(
        0.1,
        "... and while every trial is fitted closely",
        why="The last knots are worth more care.",
        unit="share",
        expert=True,
        gt=0,
        le=1,
    )
    close_rounds: int = setting(
        2,
        "rounds of distance minimisation in a close fit",
        why="The first bring nearly all.",
        unit="count",
        expert=True,
        ge=1,
        le=100,
    )
    budget_removal_share: float = setting(
        0.35,
        "share of the excess knots that go at once for a budget",
        why="No tolerance can be missed on the way.",
        unit="share",
        expert=True,
        gt=0,
        le=1,
    )
    close_multiple: float = setting(
        1.3,
        "for a budget, fits are close from so many times the wanted knots on",
        why="Earlier ones are thrown away.",
        unit="ratio",
        expert=True,
        ge=1,
        le=100,
    )
    last_rounds: int = setting(
        6,
        "rounds of distance minimisation of the last fit for a budget",
        why="It ends earlier when a round brings nothing.",
        unit="count",
        expert=True,
        ge=1,
        le=100,
    )
    few: int = setting(
        16,
        "up to so many knots, it is tried to do with one less from richer fits",
        why="Of few knots, one more or less is a large share.",
        unit="count",
        expert=True,
        ge=4,
        le=1000,
    )
    levelling_rounds: int = setting(
        3,
        "rounds of reweighting by the distance (Lawson), to bring the largest down",
        why="The first bring nearly all.",
        unit="count",
        expert=True,
        ge=1,
        le=100,
    )
    levelling_reach: float = setting(
        1.4,
        "tried where the largest distance is at most so many tolerances",
        why="It brings no fit further down.",
        unit="tolerances",
        expert=True,
        ge=1,
        le=100,
    )
    levelling_weights: tuple[_Weight, _Weight] = setting(
        (0.05, 20.0),
        "least and largest weight in it",
        why="No point may rule alone.",
        unit="ratio",
        expert=True,
    )
    flattening_rounds: int = setting(
        5,
        "rounds of reweighting by the inverse distance for a budget, to bring the sum down",
        why="The sum of distances is the area between, which Dice counts.",
        unit="count",
        expert=True,
        ge=1,
        le=100,
    )
    flat_px: float = setting(
        0.08,
        "least distance taken in it",
        why="Points on the curve would rule otherwise.",
        unit="px",
        expert=True,
        gt=0,
        le=10,
    )
    sample_share: float = setting(
        0.97,
        "share of the tolerance that is kept at the samples",
        why="Between them a little more may be needed.",
        unit="share",
        expert=True,
        gt=0,
        le=1,
    )


class SplineFittingSettings(Section):
    """How closed splines are fitted (group ``curves.fitting``)."""

    attempts: Annotated[tuple[_Attempt, ...], Field(min_length=1)] = setting(
        (
            (0.03, 1.0, 1.0),
            (0.3, 1.0, 1.0),
            (1.0, 1.0, 1.0),
            (1.0, 0.7, 1.25),
            (1.0, 0.5, 1.5),
            (1.0, 0.25, 2.0),
            (1.0, 0.1, 4.0),
        ),
        "tangential weight, share of the tolerance, multiple of the budget of each fit while splines cross",
        why="Nearest first; stiffer fits fold less easily, and more knots follow more closely.",
        unit="share, share, ratio",
        expert=True,
    )
    sharp: SharpCornerSettings = setting(
        SharpCornerSettings(), "sharp corners", why="A smooth spline would cut them off."
    )
    tolerance: ToleranceSettings = setting(
        ToleranceSettings(), "where less is allowed", why="What is small for its pixels keeps its shape."
    )
    reference: ReferenceSettings = setting(
        ReferenceSettings(), "what splines are fitted to", why="The pixels' steps are noise."
    )
    knots: KnotSettings = setting(KnotSettings(), "removal of knots", why="The fewest that will do.")


class CurveSettings(Section):
    """How curves are ordered, and what describes them (section ``curves``)."""

    ordering: Literal["auto", "gnn"] = setting(
        "auto",
        "gnn: let the GNN order the pixels even where a mask could be traced exactly",
        why="Tracing a mask is exact.",
    )
    method: Literal["auto", "corners"] = setting(
        "auto",
        "auto: few control points; corners: the paper's splines, with the corners as control points",
        why="Fitted to a tolerance, splines lie nearer with fewer control points than through corners "
        "(Definition 4).",
    )
    tolerance_px: float = setting(
        0.15,
        "auto: largest distance between the spline and the boundary without its steps",
        why="Surfaces are lofted from the splines: half a pixel, as far as the steps themselves reach, costs "
        "them up to a fifth of their accuracy (docs/splines.md).",
        unit="px",
        gt=0,
        le=100,
    )
    max_control_points: float | None = setting(
        None,
        "auto: at most so many per curve instead; below 1, as a share of its pixels",
        why="null leaves the number to the tolerance.",
        unit="count or share",
        gt=0,
    )
    k: int = setting(
        7,
        "longest support of the k-cosine, Definition 3",
        why="The middle of the paper's sweep.",
        unit="px",
        ge=1,
        le=1000,
    )
    criterion: Literal["max", "min"] = setting(
        "max",
        "corners are maxima (sharpest) or minima (straightest) of the k-cosine",
        why="Maxima are corners; the paper tries both.",
    )
    sweep: tuple[_Support, ...] = setting(
        (3, 5, 7, 12, 20),
        "the k of the comparison tables",
        why="Those of Tables 2-3 and Figures 10-13.",
        unit="px",
        min_length=1,
    )
    fitting: SplineFittingSettings = setting(
        SplineFittingSettings(), "how closed splines are fitted", why="Tuned on traced and drawn outlines."
    )
