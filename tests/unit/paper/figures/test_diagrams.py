"""Block diagrams."""

import re

from cccd_paper.figures.diagrams import draw_steps


def test_every_step_has_a_box_and_every_pair_an_arrow():
    steps = [f"step {number}" for number in range(7)]
    svg = draw_steps("flow", steps, "seven steps", columns=3)
    assert all(step in svg for step in steps)
    arrows = re.findall(r'<path d="[^"]*"[^>]*stroke-linecap: round', svg)
    assert len(arrows) == 2 * (len(steps) - 1)  # a line and a head each
