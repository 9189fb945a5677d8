"""By what the scale of errors is multiplied, so that bands cover what they promise."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.distance import pdist

from cccd.bands import REGIMES, SHARES, Calibration, Regime
from cccd.geometry.arrays import FloatArray, SingleArray
from cccd_calibration.conformal import coverage_curve, smallest_factor, too_few_organs

#: Points of a stack whose errors are compared with each other; correlation lengths in pixels that are tried.
CORRELATED, LENGTHS = 300, np.geomspace(0.5, 12, 25)


@dataclass(frozen=True, eq=False)
class Thinned:
    """A surface from some slices of an organ whose surface is known.

    Attributes
    ----------
    organ : str
        Stacks of one organ count as one.
    ratio : float
        Distance between slices in pixels.
    points : (2 N, 3) float32
        N points of the surface, by its area, and where it lies nearest to N of the true one, in pixels.
    signs : (2 N, F) float32
    offset : (2 N,) float32
        How far outside the true surface lies there, in pixels.
    swept, area, diameter : float
        True volume less the surface's by its area; true area less the surface's by what its area grows when
        it moves out by a pixel; true diameter less the surface's. All in pixels.
    """

    organ: str
    ratio: float
    points: SingleArray
    signs: SingleArray
    offset: SingleArray
    swept: float
    area: float
    diameter: float

    def scores(self, known: Calibration) -> tuple[FloatArray, float]:
        """Offsets (2 N,) by the scale, and the swept volume by that of the scale."""
        lengths = known.lengths(self.signs)
        return np.abs(self.offset) / lengths, abs(self.swept) / float(lengths[: len(lengths) // 2].mean())


def calibrate(
    thinned: Sequence[Thinned], known: Calibration, made_of: str, share: float, location: str
) -> Calibration:
    """Find the factors of every regime in which there are organs enough.

    Parameters
    ----------
    thinned : sequence of Thinned
    known : Calibration
        Whose scale is kept.
    made_of : str
    share : float
        That at least one regime must have factors for.
    location : str
        What messages name.

    Raises
    ------
    InputError
        In no regime there are organs enough for the share.
    """
    scored = [(stack, *stack.scores(known)) for stack in thinned]
    regimes: list[Regime] = []
    for low, high in itertools.pairwise(REGIMES):
        here = [found for found in scored if low <= found[0].ratio < high]
        names = [stack.organ for stack, _, _ in here]
        curves = np.array([coverage_curve(scores) for _, scores, _ in here])
        volumes = np.array([coverage_curve(np.array([score])) for _, _, score in here])
        pairs: list[tuple[float, float]] = []
        for one in SHARES if here else ():
            factor, volume = (smallest_factor(of, names, one) for of in (curves, volumes))
            if factor is None or volume is None:
                break
            pairs.append((factor, volume))
        if pairs:
            factors, volume_factors = zip(*pairs, strict=True)
            lengths = [_correlation_length(stack.points, scores, stack.offset) for stack, scores, _ in here]
            length = round(float(np.median(lengths)), 2)
            regimes.append(Regime(low, high, len(set(names)), len(here), length, factors, volume_factors))
    if not any(len(regime.factors) > np.searchsorted(SHARES, share) for regime in regimes):
        raise too_few_organs(location, len({stack.organ for stack in thinned}), share)
    means = np.array([known.lengths(stack.signs)[: len(stack.signs) // 2].mean() for stack in thinned])
    numbers = {"area": [stack.area for stack in thinned], "diameter": [stack.diameter for stack in thinned]}
    spans = {name: tuple(_middle(of / means, one) for one in SHARES) for name, of in numbers.items()}
    return replace(known, made_of=made_of, regimes=tuple(regimes), spans=spans)


def _middle(scores: FloatArray, share: float) -> tuple[float, float]:
    """Return the ends of the middle share of scores (N,)."""
    low, high = np.quantile(scores, [(1 - share) / 2, (1 + share) / 2])
    return round(float(low), 4), round(float(high), 4)


def _correlation_length(points: SingleArray, scores: FloatArray, offset: SingleArray) -> float:
    """Find the length in pixels over which signed scores are correlated, by a Gaussian of the distance."""
    some = slice(0, CORRELATED)
    errors = np.sign(offset[some]) * np.minimum(scores[some], 4 * np.median(scores[some]))
    apart = pdist(points[some])
    alike = np.outer(errors, errors)[np.triu_indices(len(errors), 1)] / np.mean(errors**2)
    near = apart < LENGTHS[-1]
    off = [np.mean((alike[near] - np.exp(-(apart[near] ** 2) / (2 * length**2))) ** 2) for length in LENGTHS]
    return float(LENGTHS[int(np.argmin(off))])
