"""Figures of a slice as the comparisons leave them, and the reader that finds them."""

import re

import numpy as np

from cccd_paper.figures.diagrams import draw_steps
from cccd_paper.figures.panels import OUTLINE_LOOKS, draw_slice_figure
from cccd_paper.registry import ITEMS
from cccd_viewers.page_files import Panel, SliceFigure, write_figures
from cccd_workflow.report.results import Results

SQUARE = np.array([[2.0, 3.0], [2.0, 9.0], [8.0, 9.0], [8.0, 3.0]])
ITEM = {item.key: item for item in ITEMS}


def figure(title="a square", **options) -> SliceFigure:
    layers = {
        "boundary": SQUARE,
        "corners": SQUARE[:2],
        "links": SQUARE[[[0, 1], [1, 2]]],
        "spline": np.zeros((0, 2)),
    }
    return SliceFigure([Panel(title, layers, f"detail {n}", "a row") for n in range(3)], **options)


def test_every_panel_is_drawn_with_its_title_and_detail():
    text = draw_slice_figure(figure(columns=2), "key", "what it shows")
    assert text.count("a square") == 3
    assert all(f"detail {n}" in text for n in range(3))
    assert "<title>what it shows</title>" in text
    assert "data:image" not in text


def test_a_picture_lies_behind_the_panels():
    image = np.full((10, 12), 90, np.uint8)
    window = np.array([[0, 0], [9, 11]])
    text = draw_slice_figure(figure(image=image, window=window), "key", "label", OUTLINE_LOOKS)
    assert text.count("data:image/webp") == 3


def test_a_liver_is_shown_where_there_is_one(tmp_path):
    structures = [("a", "brain"), ("a", "liver"), ("b", "liver")]
    for case, organ in structures[:2]:
        write_figures(tmp_path / case / organ / "comparisons" / "corners.h5", {"figure9": figure(organ)})
    results = Results(tmp_path, structures)
    case, organ, shown = results.shown(ITEM["figure9"])
    assert (case, organ, shown.panels[0].title) == ("a", "liver", "liver")
    assert Results(tmp_path, structures[:1]).shown(ITEM["figure9"])[1] == "brain"
    assert results.shown(ITEM["figure15"]) is None
    assert results.figure(ITEM["figure9"], "b", "liver") is None


def test_every_step_has_a_box_and_every_pair_an_arrow():
    steps = [f"step {number}" for number in range(7)]
    svg = draw_steps("flow", steps, "seven steps", columns=3)
    assert all(step in svg for step in steps)
    arrows = re.findall(r'<path d="[^"]*"[^>]*stroke-linecap: round', svg)
    assert len(arrows) == 2 * (len(steps) - 1)  # a line and a head each
