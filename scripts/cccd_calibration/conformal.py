"""The smallest factor that covers enough, with a guarantee for a finite number of organs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray

#: Factors that are tried, each 2.5 % above the one before.
FACTORS = 0.01 * 1.025 ** np.arange(354)


def coverage_curve(scores: FloatArray) -> FloatArray:
    """Share (F,) of scores (N,) that lie within each of `FACTORS`; what is not a number lies in none."""
    found = np.sort(scores[np.isfinite(scores)])
    return np.searchsorted(found, FACTORS, side="right") / max(len(scores), 1)


def fewest_organs(share: float) -> int:
    """Organs without which a share cannot be guaranteed.

    Examples
    --------
    >>> fewest_organs(0.9), fewest_organs(0.5)
    (9, 1)
    """
    return int(np.ceil(share / (1 - share) - 1e-9))


def too_few_organs(location: str, count: int, share: float) -> InputError:
    """Return the error that so many organs cannot guarantee a share."""
    are = "organ is" if count == 1 else "organs are"
    hint = f"give {2 * fewest_organs(share)} different organs or more"
    return InputError(location, f"{count} {are} too few to guarantee {share:.0%}", hint)


def smallest_factor(curves: FloatArray, names: Sequence[str | int], share: float) -> float | None:
    r"""Return the smallest of `FACTORS` that covers a share of a further organ's surface, on the mean.

    Parameters
    ----------
    curves : (N, F) float64
        What share of each organ the factors cover; they do not fall from left to right.
    names : sequence (N,) of str or int
        Of the organs: curves of one organ count as one, their mean.
    share : float
        Between 0 and 1.

    Returns
    -------
    float or None
        None where no factor guarantees the share: there are too few organs.

    Examples
    --------
    >>> organs = np.array([coverage_curve(np.array([score])) for score in np.arange(1.0, 20)])
    >>> 18 <= smallest_factor(organs, range(19), 0.9) < 18.5
    True
    """
    organs = np.array(names)
    means = np.array([curves[organs == organ].mean(axis=0) for organ in np.unique(organs)])
    first = first_enough(means, share)
    return None if first is None else round(float(FACTORS[first]), 4)


def first_enough(curves: FloatArray, share: float) -> int | None:
    r"""Return the first column in which a further row is covered to a share, on the mean.

    Parameters
    ----------
    curves : (N, F) float64
        Covered shares of N exchangeable things; they do not fall from left to right.
    share : float
        Between 0 and 1.

    Returns
    -------
    int or None
        None where no column guarantees the share: there are too few rows.

    Notes
    -----
    Conformal risk control (Angelopoulos et al. 2024): with the mean miss :math:`R` of n rows,
    :math:`n R / (n + 1) + 1 / (n + 1) \le 1 - share`. If the next row is exchangeable with these, its mean
    is at least ``share``. With scores that are one number per row this is split conformal prediction's
    quantile of rank :math:`\lceil (n + 1) share \rceil`.
    """
    count = len(curves)
    missed = (count * (1 - curves.mean(axis=0)) + 1) / (count + 1)
    enough = np.flatnonzero(missed <= 1 - share + 1e-12)
    return int(enough[0]) if len(enough) else None
