"""Crust: N. Amenta, M. Bern, D. Eppstein, The crust and the beta-skeleton, 1998.

Graphical Models and Image Processing 60, 125-135.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import QhullError, Voronoi

from cccd_paper.comparisons.links import unique_links
from cccd_paper.comparisons.reconstruction.delaunay import triangulate


def crust(points: np.ndarray) -> np.ndarray:
    """Edges between points in the Delaunay triangulation of the points and their Voronoi vertices.

    An edge is in the crust when some disc through both ends holds neither another point nor a Voronoi
    vertex, that is, no part of the medial axis.
    """
    try:
        centres = Voronoi(points).vertices
    except QhullError:
        return triangulate(points).edges
    edges = triangulate(np.concatenate([points, centres])).edges
    return unique_links(edges[edges[:, 1] < len(points)])
