"""HNN-Crust: S. Ohrhallinger, S. A. Mitchell, M. Wimmer, Curve reconstruction with many fewer samples.

Computer Graphics Forum 35 (2016) 167-176.
"""

from __future__ import annotations

import numpy as np

from cccd.tolerances import ROUNDING
from cccd_paper.comparisons.links import unique_links
from cccd_paper.comparisons.reconstruction.delaunay import first_of_each, triangulate


def hnn_crust(points: np.ndarray) -> np.ndarray:
    """Link each point to its nearest and its half-nearest neighbour, where both ends agree.

    The half-nearest neighbour is the nearest one on the point's own side of the bisector between it and
    its nearest neighbour; angles from 60 degrees are therefore kept, where NN-Crust stops at 90. Taken
    here: candidates are Delaunay edges, and a link stands when each end chooses the other.
    """
    start, end, edge, length = triangulate(points).directed()
    nearest = first_of_each(start)
    sizes = np.diff(np.r_[nearest, len(start)])
    towards = points[end] - points[start]
    first = np.repeat(towards[nearest], sizes, axis=0)
    reach = np.repeat(length[nearest] ** 2, sizes)
    own_side = (towards * first).sum(1) <= (0.5 + ROUNDING) * reach
    second = np.flatnonzero(own_side)[first_of_each(start[own_side])]
    chosen, votes = np.unique(np.concatenate([edge[nearest], edge[second]]), return_counts=True)
    agreed = np.isin(edge, chosen[votes == 2])
    return unique_links(np.column_stack([start[agreed], end[agreed]]))
