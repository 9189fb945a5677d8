"""Equations 12-21.

The paper prints its rates as shares of *all* pixels and calls TP / (TP + FN) precision, which everyone
else calls recall. `Confusion.printed` gives the equations as printed, `Confusion.standard` the usual
definitions of what goes by the same or a neighbouring name.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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

    def take(self, regions: np.ndarray) -> Confusion:
        """Keep the counts of some of the regions, by their numbers."""
        tp, fp, tn, fn = (np.asarray(count)[regions] for count in (self.tp, self.fp, self.tn, self.fn))
        return Confusion(tp, fp, tn, fn)

    def together(self) -> Confusion:
        """Count all regions as one.

        Examples
        --------
        >>> counts = Confusion(*(np.array(count) for count in ([4, 1], [0, 2], [5, 5], [1, 0])))
        >>> int(counts.together().tp), float(counts.together().printed["JI"])
        (5, 0.625)
        """
        tp, fp, tn, fn = (np.sum(count) for count in (self.tp, self.fp, self.tn, self.fn))
        return Confusion(tp, fp, tn, fn)

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
