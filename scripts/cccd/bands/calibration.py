"""What the scale of the error is multiplied by: factors for each regime of slice distances."""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from cccd.bands.conformal import coverage_curve, fewest_organs, smallest_factor
from cccd.bands.scale import Scale, shipped_scale
from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray, SingleArray

__all__ = ["REGIMES", "SHARES", "Calibration", "Regime", "Thinned", "calibrate"]

#: Slice distances in pixels at which one regime ends and the next begins.
REGIMES = (0.5, 1.5, 2.5, 4.5, 7.5, 30.0)
#: The shares of the surface that factors are kept for; between them they are interpolated.
SHARES = (0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95)
#: Factors that `cccd_training.bands` wrote, and their SHA-256: the workflow lofts again when they change.
SHIPPED = Path(__file__).with_name("shipped.json")
SHIPPED_SHA256 = "73b302a2f2af634780ad38d4a911839ba352f34a4a09f0fe1b0d263547d098b1"


@dataclass(frozen=True)
class Regime:
    """Factors for slice distances from ``low`` to ``high`` pixels.

    Attributes
    ----------
    low, high : float
    organs, stacks : int
        Of how many they were made.
    factors, volume_factors : tuple of float
        By which the scale, and its integral over the surface for the volume, are multiplied; one for each of
        the first of `SHARES`, as far as there were organs enough.
    """

    low: float
    high: float
    organs: int
    stacks: int
    factors: tuple[float, ...]
    volume_factors: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Thinned:
    """A surface from some slices of an organ whose surface is known.

    Attributes
    ----------
    organ : str
        Stacks of one organ count as one.
    ratio : float
        Distance between slices in pixels.
    outer, inner : (5 N, F) float32
        Signs on both sides of 4 N points of the surface, by its area, and where it lies nearest to N points
        of the true one.
    offset : (5 N,) float32
        How far outside the true surface lies there, in pixels.
    swept : float
        True volume less the surface's by its area, in pixels.
    """

    organ: str
    ratio: float
    outer: SingleArray
    inner: SingleArray
    offset: SingleArray
    swept: float

    @property
    def of_surface(self) -> int:
        """The number of points (4 N) on the lofted surface; those of the true one follow."""
        return 4 * len(self.offset) // 5

    def scores(self, scale: Scale) -> tuple[FloatArray, float]:
        """Offsets (5 N,) by the scale on their side, and the swept volume by that of the scale."""
        outer, inner = scale(self.outer), scale(self.inner)
        of_surface = slice(self.of_surface)
        mean = float((outer if self.swept > 0 else inner)[of_surface].mean())
        return np.abs(self.offset) / np.where(self.offset > 0, outer, inner), abs(self.swept) / mean


@dataclass(frozen=True)
class Calibration:
    """By what the scale of the error is multiplied.

    Attributes
    ----------
    regimes : tuple of Regime
    made_of : str
        Of which organs and stacks.
    scale : str
        Name of the scale that the factors are of.
    """

    regimes: tuple[Regime, ...]
    made_of: str
    scale: str

    def factors(self, ratio: float, share: float) -> tuple[float, float, bool]:
        """Factors of the scale and of the volume, and whether they are extrapolated.

        The ratio is that of slice distance and pixel; the nearest regime with factors for the share is taken.

        Raises
        ------
        InputError
            No regime had organs enough for the share.
        """
        last = np.searchsorted(SHARES, share, side="left")
        known = [regime for regime in self.regimes if len(regime.factors) > last]
        if not known or share < SHARES[0]:
            problem = f"the calibration has no factors for a share of {share:g}"
            most = max((SHARES[len(regime.factors) - 1] for regime in self.regimes), default=SHARES[0])
            raise InputError("surface.band", problem, f"choose one from {SHARES[0]:g} to {most:g}")
        off = [max(regime.low / ratio, ratio / regime.high, 1.0) for regime in known]
        best = known[int(np.argmin(off))]
        shares = SHARES[: len(best.factors)]
        factor, volume = (
            float(np.exp(np.interp(share, shares, np.log(values))))
            for values in (best.factors, best.volume_factors)
        )
        return factor, volume, min(off) > 1

    def write(self, path: Path) -> None:
        """Write it as JSON."""
        regimes = [vars(regime) for regime in self.regimes]
        plain = {"made_of": self.made_of, "scale": self.scale, "regimes": regimes}
        path.write_text(json.dumps(plain, indent=1) + "\n", encoding="utf-8")

    @classmethod
    def read(cls, path: Path | str | None = None) -> Calibration:
        """Read what `write` wrote; the shipped calibration without a path.

        Raises
        ------
        InputError
            The file is missing or no calibration.
        """
        return _read(Path(path or SHIPPED))


@cache
def _read(path: Path) -> Calibration:
    hint = "make one with cccd calibrate"
    try:
        plain: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        regimes = tuple(
            Regime(
                **{**regime, "factors": (*regime["factors"],), "volume_factors": (*regime["volume_factors"],)}
            )
            for regime in plain["regimes"]
        )
        calibration = Calibration(regimes, str(plain["made_of"]), str(plain["scale"]))
    except OSError as error:
        raise InputError(str(path), f"the calibration cannot be read ({error.strerror})", hint) from None
    except (ValueError, KeyError, TypeError):
        raise InputError(str(path), "that is no calibration", hint) from None
    if calibration.scale != shipped_scale().name:
        raise InputError(str(path), "another version made this calibration", hint)
    return calibration


def calibrate(
    thinned: Sequence[Thinned], scale: Scale, made_of: str, share: float, location: str
) -> Calibration:
    """Find the factors of every regime in which there are organs enough.

    Parameters
    ----------
    thinned : sequence of Thinned
    scale : Scale
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
    scored = [(stack, *stack.scores(scale)) for stack in thinned]
    regimes: list[Regime] = []
    for low, high in itertools.pairwise(REGIMES):
        here = [found for found in scored if low <= found[0].ratio < high]
        names = np.array([stack.organ for stack, _, _ in here])
        organs = np.unique(names)
        curves = np.array([coverage_curve(scores) for _, scores, _ in here])
        volumes = np.array([coverage_curve(np.array([score])) for _, _, score in here])
        pairs: list[tuple[float, float]] = []
        for share in SHARES if here else ():
            found = [
                smallest_factor(np.array([of[names == organ].mean(axis=0) for organ in organs]), share)
                for of in (curves, volumes)
            ]
            if found[0] is None or found[1] is None:
                break
            pairs.append((round(found[0], 4), round(found[1], 4)))
        if pairs:
            factors, volume_factors = zip(*pairs, strict=True)
            regimes.append(Regime(low, high, len(organs), len(here), factors, volume_factors))
    if not any(len(regime.factors) > np.searchsorted(SHARES, share) for regime in regimes):
        count = len({stack.organ for stack in thinned})
        problem = f"{count} organs are too few to guarantee {share:.0%}"
        raise InputError(location, problem, f"give {2 * fewest_organs(share)} organs or more")
    return Calibration(tuple(regimes), made_of, scale.name)
