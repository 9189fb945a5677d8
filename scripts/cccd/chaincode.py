"""Freeman chain codes, and what ordering changed.

Codes are numbered as in Figure 1: 0 points along +j (to the right of a slice shown with i downwards) and
the numbers rise counter-clockwise on the screen in steps of 45 degrees::

    3 2 1
    4 . 0        i grows downwards, j to the right
    5 6 7

Curves are ragged (`cccd.containers.Curves`): functions here work on all curves at once.
"""

from __future__ import annotations

import numpy as np

from cccd.containers import Boundaries, Curves
from cccd.geometry.arrays import BoolArray, owners_of, successors, sum_per_part

#: Step (di, dj) of each Freeman code (Figure 1).
DIRECTIONS = np.array([(0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0), (1, 1)])

# code of a step, looked up at [di + 1, dj + 1]; 255 where nothing moves
_CODE_OF_STEP = np.full((3, 3), 255, np.uint8)
_CODE_OF_STEP[DIRECTIONS[:, 0] + 1, DIRECTIONS[:, 1] + 1] = np.arange(8)


def broken_links(points: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Points (P,) bool of closed curves whose successor is not one of their eight neighbours."""
    step = points[successors(offsets)] - points
    return ~((np.abs(step).max(axis=1, initial=0) == 1) & (step == np.rint(step)).all(axis=1))


def on_pixel_chain(points: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Whether each closed curve (C,) steps from pixel centre to neighbouring pixel centre."""
    whole = (points == np.rint(points)).all(axis=1)
    return sum_per_part(broken_links(points, offsets) | ~whole, offsets) == 0


def chain_codes(points: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Freeman code of the link from each point to its successor (Definition 1).

    Parameters
    ----------
    points : (P, 2) array
        Closed 8-connected pixel chains.
    offsets : (C + 1,) int array

    Returns
    -------
    (P,) uint8 array of 0..7

    Raises
    ------
    ValueError
        When a link is not a step to one of the 8 neighbours.
    """
    broken = broken_links(points, offsets)
    if broken.any():
        curve = int(np.searchsorted(offsets, np.argmax(broken), side="right")) - 1
        raise ValueError(f"curve {curve} has a link that is not a step to a neighbouring pixel")
    step = (points[successors(offsets)] - points).astype(np.int64)
    return _CODE_OF_STEP[step[:, 0] + 1, step[:, 1] + 1]


def changed_pixels(boundaries: Boundaries, curves: Curves) -> tuple[BoolArray, BoolArray]:
    """Find what ordering dropped of a boundary map and what it bridged.

    Returns
    -------
    dropped : (P,) bool
        Pixels of the map that lie on no curve.
    bridged : (Q,) bool
        Points of the curves that are no pixel of the map.
    """
    rows = [
        np.column_stack([part.slice[owners_of(part.offsets)], np.rint(part.points)]).astype(np.int64)
        for part in (boundaries, curves)
    ]
    _, number = np.unique(np.concatenate(rows), axis=0, return_inverse=True)
    given, chained = np.split(number, [len(rows[0])])
    return ~np.isin(given, chained), ~np.isin(chained, given)
