"""Inside or outside for every triangle: an exact minimum cut."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray, RealArray

# SciPy's flows are whole numbers of 32 bits: all capacities together come to half of the largest.
_MOST_FLOW = 2**30


def minimum_cuts(unaries: RealArray, pairwise: RealArray, link_triangles: AnyArray) -> BoolArray:
    """Label triangles so that unary energies inside and pairwise ones along the border are least.

    Parameters
    ----------
    unaries : (K, T) array
        What a triangle inside costs; negative where inside is better. Each of the K is cut by itself.
    pairwise : (L,) array, not negative
        What the border costs where it runs along a link.
    link_triangles : (L, 2) int array
        The two triangles that share a link.

    Returns
    -------
    (K, T) bool array
        Inside. Of several least cuts, the one with the smallest inside.

    Notes
    -----
    By the max-flow min-cut theorem the triangles that the source still reaches beside a maximum flow are
    inside (Greig, Porteous and Seheult 1989). Energies are rounded, to less than a millionth of what a border
    along all links costs. What a triangle's own energy has above the cost of all its sides decides nothing.

    Examples
    --------
    Two triangles side by side: the second follows the first where the link between them costs more.

    >>> [minimum_cuts([[-2, 1]], [cost], np.array([(0, 1)]))[0].tolist() for cost in (0.5, 1.5)]
    [[True, False], [True, True]]
    """
    unaries, pairwise = np.asarray(unaries, float), np.asarray(pairwise, float)
    count, size = len(unaries), unaries.shape[1]
    scale = _MOST_FLOW / max(2 * count * (pairwise.sum() + size), 1)
    border = np.rint(scale * pairwise)
    sides = np.bincount(link_triangles.ravel(), np.repeat(border, 2), size) + 1
    own: FloatArray = np.clip(np.rint(scale * unaries), -sides, sides).ravel()
    copy = size * np.repeat(np.arange(count), len(pairwise))
    first, second = (copy + np.tile(link_triangles[:, side], count) for side in range(2))
    gains, costs, source, sink = np.flatnonzero(own < 0), np.flatnonzero(own > 0), own.size, own.size + 1
    start = np.concatenate([np.full(len(gains), source), costs, first, second])
    end = np.concatenate([gains, np.full(len(costs), sink), second, first])
    capacity = np.concatenate([-own[gains], own[costs], *2 * count * (border,)]).astype(np.int32)
    network = csr_array((capacity, (start, end)), shape=(own.size + 2, own.size + 2))
    left = network - maximum_flow(network, source, sink).flow  # what is used up is no entry of it
    inside = np.zeros(own.size + 2, bool)
    inside[breadth_first_order(left, source, return_predecessors=False)] = True
    return inside[: own.size].reshape(unaries.shape)
