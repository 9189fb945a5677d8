"""Block diagrams: boxes in reading order, joined by arrows."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from cccd_workflow.report.svg import INK, RULE, axes, style, to_svg

#: Inches from box to box.
_WIDE, _TALL = 1.62, 0.95


def draw_steps(key: str, steps: Sequence[str], label: str, columns: int = 5) -> str:
    """Draw steps as boxes, every second row from right to left, so that each arrow is short.

    Parameters
    ----------
    key : str
        Keeps the ids of several figures of one page apart.
    steps : sequence of str
        Text of each box; lines are kept.
    label : str
        What the diagram shows, for those who cannot see it.
    columns : int
        Boxes in a row.

    Returns
    -------
    str
        SVG.
    """
    rows = -(-len(steps) // columns)
    places = [_place(number, columns) for number in range(len(steps))]
    with style():
        figure, axis = axes(_WIDE * min(columns, len(steps)), _TALL * rows)
        box = {"boxstyle": "round,pad=0.45", "facecolor": "none", "edgecolor": RULE}
        centred = {"ha": "center", "va": "center", "fontsize": 7, "color": INK}
        boxes = [
            axis.text(*place, step, bbox=box, **centred).get_bbox_patch()
            for place, step in zip(places, steps, strict=True)
        ]
        for (here, there), (left, reached) in zip(
            itertools.pairwise(places), itertools.pairwise(boxes), strict=True
        ):
            ends = {"patchA": left, "patchB": reached, "shrinkA": 2, "shrinkB": 2}
            axis.annotate("", there, here, arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 0.8, **ends})
        axis.set(xlim=(-0.5, min(columns, len(steps)) - 0.5), ylim=(0.5 - rows, 0.5))
        axis.set_axis_off()
        return to_svg(figure, key, label)


def _place(number: int, columns: int) -> tuple[int, int]:
    """Column and negative row of a box; odd rows run backwards."""
    row, column = divmod(number, columns)
    return (columns - 1 - column if row % 2 else column), -row
