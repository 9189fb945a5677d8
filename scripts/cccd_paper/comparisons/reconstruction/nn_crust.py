"""NN-Crust: T. K. Dey, P. Kumar, A simple provable algorithm for curve reconstruction, SODA 1999, 893-894."""

from __future__ import annotations

import numpy as np

from cccd.tolerances import ROUNDING
from cccd_paper.comparisons.links import unique_links
from cccd_paper.comparisons.reconstruction.delaunay import first_of_each, triangulate


def nn_crust(points: np.ndarray) -> np.ndarray:
    """Link each point to its nearest neighbour and to its nearest one in the half-plane beyond.

    The second link is the shortest Delaunay edge at an angle of at least 90 degrees to the first.
    """
    start, end, _, length = triangulate(points).directed()
    nearest = first_of_each(start)
    towards = points[end] - points[start]
    first = np.repeat(towards[nearest], np.diff(np.r_[nearest, len(start)]), axis=0)
    beyond = (towards * first).sum(1) <= ROUNDING * length**2
    second = np.flatnonzero(beyond)[first_of_each(start[beyond])]
    chosen = np.concatenate([nearest, second])
    return unique_links(np.column_stack([start[chosen], end[chosen]]))
