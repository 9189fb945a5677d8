"""How well a result agrees with the truth: in the plane (equations 12-21), and on surfaces.

The paper prints its rates as shares of *all* pixels and calls TP / (TP + FN) precision, which everyone
else calls recall. `Confusion.printed` gives the equations as printed, `Confusion.standard` the usual
definitions of what goes by the same or a neighbouring name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cccd.containers import Curves, concatenate_ragged
from cccd.tolerances import ROUNDING

__all__ = [
    "Confusion",
    "confusion",
    "dice",
    "jaccard",
    "rasterise",
    "rasterise_slice",
]

Counts = np.ndarray | int
Rates = np.ndarray | float


def _ratio(part: Counts, whole: Counts, empty: float = np.nan) -> Rates:
    """``part / whole``, and ``empty`` where the whole is nothing."""
    part, whole = np.asarray(part, float), np.asarray(whole, float)
    return np.divide(part, whole, out=np.full(np.shape(whole), empty), where=whole > 0)[()]


@dataclass(frozen=True)
class Confusion:
    """Pixel counts of a prediction against the truth, for one region or an array of them.

    Attributes
    ----------
    tp, fp, tn, fn : int or array of int
        True positives, false positives, true negatives, false negatives (section 4.4).

    Examples
    --------
    >>> counts = Confusion(tp=40, fp=10, tn=40, fn=10)
    >>> float(counts.printed["DSC"]), float(counts.printed["TP rate"])
    (0.8, 0.4)
    """

    tp: Counts
    fp: Counts
    tn: Counts
    fn: Counts

    @property
    def printed(self) -> dict[str, Rates]:
        """Equations 12-21 as the paper prints them, under the abbreviations of its Figure 11."""
        tp, fp, tn, fn = self.tp, self.fp, self.tn, self.fn
        everything = tp + fp + tn + fn
        return {
            "TP rate": _ratio(tp, everything),  # eq. (12)
            "FP rate": _ratio(fp, everything),  # eq. (13)
            "TN rate": _ratio(tn, everything),  # eq. (14)
            "FN rate": _ratio(fn, everything),  # eq. (15)
            "ACC": _ratio(tp + tn, everything),  # eq. (16)
            "MC": _ratio(fp + fn, everything),  # eq. (17)
            "PRE": _ratio(tp, tp + fn),  # eq. (18): the usual recall
            "SPEC": _ratio(tn, tn + fp),  # eq. (19)
            "DSC": _ratio(2 * tp, 2 * tp + fp + fn, empty=1.0),  # eq. (20)
            "JI": _ratio(tp, tp + fp + fn, empty=1.0),  # eq. (21)
        }

    @property
    def standard(self) -> dict[str, Rates]:
        """The usual definitions where the printed ones differ from them."""
        return {
            "precision": _ratio(self.tp, self.tp + self.fp),
            "recall": _ratio(self.tp, self.tp + self.fn),
            "false positive rate": _ratio(self.fp, self.fp + self.tn),
            "false negative rate": _ratio(self.fn, self.fn + self.tp),
        }


def confusion(
    truth: np.ndarray, predicted: np.ndarray, axis: int | tuple[int, ...] | None = None
) -> Confusion:
    """Count agreeing and disagreeing pixels.

    Parameters
    ----------
    truth, predicted : bool arrays of one shape
        Foreground of the ground truth and of the prediction.
    axis : int or tuple of int, optional
        Axes to count over; all by default. ``(1, 2)`` counts each slice of a stack (S, I, J).

    Raises
    ------
    ValueError
        When the shapes differ.
    """
    truth, predicted = np.asarray(truth, bool), np.asarray(predicted, bool)
    if truth.shape != predicted.shape:
        raise ValueError(f"truth {truth.shape} and prediction {predicted.shape} differ in shape")
    tp = np.count_nonzero(truth & predicted, axis=axis)
    positives = np.count_nonzero(truth, axis=axis)
    claimed = np.count_nonzero(predicted, axis=axis)
    pixels = truth.size if axis is None else truth.size // max(np.size(positives), 1)
    return Confusion(tp=tp, fp=claimed - tp, tn=pixels - positives - claimed + tp, fn=positives - tp)


def dice(truth: np.ndarray, predicted: np.ndarray, axis: int | tuple[int, ...] | None = None) -> Rates:
    """Dice score, eq. (20); two empty regions agree (1)."""
    return confusion(truth, predicted, axis).printed["DSC"]


def jaccard(truth: np.ndarray, predicted: np.ndarray, axis: int | tuple[int, ...] | None = None) -> Rates:
    """Jaccard index, eq. (21); two empty regions agree (1)."""
    return confusion(truth, predicted, axis).printed["JI"]


# Polygons to pixels -----------------------------------------------------------------------------------


def rasterise(curves: Curves, origin: Sequence[int] | np.ndarray, shape: tuple[int, int, int]) -> np.ndarray:
    """Pixels whose centres lie in or on the curves of their slice (even-odd rule, so holes are holes).

    Parameters
    ----------
    curves : Curves
        Closed polygons; parts outside the stack are cut off.
    origin : (3,) int
        Source index ``(k, i, j)`` of the stack's first pixel (`Structure.stack_origin`).
    shape : (S, I, J)
        Shape of the stack.

    Returns
    -------
    (S, I, J) bool array

    Notes
    -----
    A centre on a polygon counts as inside, so the pixel-centre polygons of a mask's borders (outer
    borders and holes, `cccd.chaincode.trace_mask`) give back the mask itself.
    """
    k, i, j = (int(index) for index in origin)
    return _fill(curves.points - (i, j), curves.offsets, np.asarray(curves.slice, np.int64) - k, shape)


def rasterise_slice(
    polygons: Sequence[np.ndarray], origin: Sequence[int] | np.ndarray, shape: tuple[int, int]
) -> np.ndarray:
    """`rasterise` for the polygons (n, 2) of one slice; ``origin`` is (i, j), the result (I, J) bool."""
    points, offsets = concatenate_ragged(polygons)
    stack = _fill(points - np.asarray(origin, float), offsets, np.zeros(len(polygons), np.int64), (1, *shape))
    return stack[0]


def _fill(
    points: np.ndarray, offsets: np.ndarray, layer: np.ndarray, shape: tuple[int, int, int]
) -> np.ndarray:
    """Scan-line even-odd fill of ragged polygons (P, 2), each into its own ``layer`` of a stack.

    Every edge toggles the parity of the pixels to its right on each row ``i`` that it crosses; a row
    counts for an edge from its lower end up to, but without, its upper end, so that a shared vertex is
    counted once. What lies exactly on an edge is added afterwards.
    """
    layers, rows, columns = shape
    parity = np.zeros(shape, np.uint8)
    sizes = np.diff(offsets)
    if len(points) == 0 or parity.size == 0:
        return parity.astype(bool)
    start = points
    end = np.roll(points, -1, axis=0)
    filled = sizes > 0
    end[offsets[1:][filled] - 1] = points[offsets[:-1][filled]]
    layer = np.repeat(layer, sizes)
    here = (layer >= 0) & (layer < layers)
    start, end, layer = start[here], end[here], layer[here]

    upward = start[:, 0] <= end[:, 0]
    low = np.where(upward[:, None], start, end)
    high = np.where(upward[:, None], end, start)
    edge, row = _integers_between(low[:, 0], high[:, 0], rows)
    rise = (high - low)[edge]
    level = rise[:, 0] == 0  # the row runs along the edge
    share = np.divide(row - low[edge, 0], rise[:, 0], out=np.zeros(len(row)), where=~level)
    column = low[edge, 1] + share * rise[:, 1]
    nearest = np.rint(column)
    exact = np.abs(column - nearest) <= ROUNDING * np.maximum(1.0, np.abs(column))
    column = np.where(exact, nearest, column)

    crossing = ~level & (row < high[edge, 0])
    entry = np.maximum(np.ceil(column), 0).astype(np.int64)
    flat = (layer[edge] * rows + row) * columns
    kept = crossing & (entry < columns)
    np.add.at(parity.reshape(-1), (flat + entry)[kept], np.uint8(1))
    # Unsigned bytes wrap at 256, which is even: the parity survives any number of crossings.
    inside = (np.add.accumulate(parity, axis=2, dtype=np.uint8) & 1).astype(bool)

    touched = ~level & exact & (column >= 0) & (column < columns)
    inside.reshape(-1)[(flat + entry)[touched]] = True
    along = edge[level]
    left = np.minimum(low[along, 1], high[along, 1])
    right = np.maximum(low[along, 1], high[along, 1])
    which, column = _integers_between(left, right, columns)
    inside.reshape(-1)[flat[level][which] + column] = True
    return inside


def _integers_between(low: np.ndarray, high: np.ndarray, stop: int) -> tuple[np.ndarray, np.ndarray]:
    """Every integer of ``[low[n], high[n]]`` within ``[0, stop)``, with the n it belongs to."""
    first = np.maximum(np.ceil(low), 0).astype(np.int64)
    last = np.minimum(np.floor(high), stop - 1).astype(np.int64)
    count = np.maximum(last - first + 1, 0)
    owner = np.repeat(np.arange(len(count)), count)
    begin = np.cumsum(count) - count
    return owner, first[owner] + np.arange(len(owner)) - begin[owner]
