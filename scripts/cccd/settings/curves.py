"""Settings of the curves: ordering, corners, splines."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from cccd.settings import Section, setting

_Support = Annotated[int, Field(ge=1, le=1000)]


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
        why="Half of it takes twice the control points, and follows what is left of the steps. Surfaces "
        "do not depend on it.",
        unit="px",
        gt=0,
        le=100,
    )
    max_control_points: float | None = setting(
        None,
        "auto: most control points of a curve, instead of the tolerance; below 1, as a share of its pixels",
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
