"""SIGDT: D. Marin, S. Ohrhallinger, M. Wimmer, SIGDT: 2D curve reconstruction, CGF 41(7) (2022) 25-36."""

from __future__ import annotations

import numpy as np

from cccd.geometry.arrays import connected_parts
from cccd.tolerances import ROUNDING
from cccd_paper.comparisons.links import unique_links
from cccd_paper.comparisons.reconstruction.adjustment import adjust_boundary
from cccd_paper.comparisons.reconstruction.delaunay import first_of_each, triangulate


def sigdt(points: np.ndarray) -> np.ndarray:
    """Spheres-of-influence graph within the Delaunay triangulation, then boundary adjustment.

    The proximity graph links points whose circles, each as wide as the way to the nearest neighbour,
    meet. It holds the curve and more; redundant edges go by Connect2D's adjustment within each connected
    piece, which is what the publication calls SIG-Connect2D.
    """
    mesh = triangulate(points)
    start, _, _, length = mesh.directed()
    reach = length[first_of_each(start)]
    meet = mesh.length <= reach[mesh.edges].sum(1) * (1 + ROUNDING)
    if not len(mesh.triangles):
        return mesh.edges[meet]
    one, other = mesh.edges[meet].T
    piece = connected_parts(one, other, len(points))
    return unique_links(mesh.edges[adjust_boundary(mesh, meet, piece)])
