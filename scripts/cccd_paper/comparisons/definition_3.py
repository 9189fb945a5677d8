"""Three readings of Definition 3, which disagree about where on a chain of pixels its corners are.

"Point i is a corner when c_ik is a local maximum or minimum such that |i - j| <= k / 2", where k is the
support that the point's own cosines chose. On a chain of pixels most points that turn choose k = 1: then no j
but i itself is within k / 2, nothing is compared, and every such point is a corner.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cccd.curves.corners import Ring, k_cosine, k_cosine_corners, local_extrema

# A straight chain has a cosine of -1; rounding leaves it above by less.
_STRAIGHT = -1 + 1e-9


def rounded_up(points: np.ndarray, offsets: np.ndarray, k: int) -> np.ndarray:
    """Corners with k / 2 rounded up: every point is compared with its two neighbours at least.

    Parameters
    ----------
    points : (P, 2) array
    offsets : (C + 1,) int array
    k : int
        Longest support that is tried.

    Returns
    -------
    (P,) bool array
    """
    return _maxima(*k_cosine(points, offsets, k), offsets)


def smoothed_chain(points: np.ndarray, offsets: np.ndarray, k: int) -> np.ndarray:
    """Corners of a smoothed chain, as `rounded_up`.

    Definition 3 speaks of "smoothing on the chain across a window of width k", which eq. (4) does not do.
    Here every point is first moved to the mean of the points within ``k // 2`` places of it.
    """
    ring = Ring(offsets)
    window = range(-(k // 2), k // 2 + 1)
    smooth = np.mean([points[ring.at(shift)] for shift in window], axis=0)
    return _maxima(*k_cosine(smooth, offsets, k), offsets)


def _maxima(cosine: np.ndarray, support: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    values = np.round(cosine, 12)
    return local_extrema(values, (support + 1) // 2, Ring(offsets)) & (values > _STRAIGHT)


#: The readings by name: (points, offsets, k) -> (P,) bool. The first is the one that the chain uses.
READINGS: dict[str, Callable[[np.ndarray, np.ndarray, int], np.ndarray]] = {
    "as printed": k_cosine_corners,
    "window rounded up": rounded_up,
    "smoothed chain": smoothed_chain,
}
