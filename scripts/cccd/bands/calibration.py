"""How signs become lengths: the scale of the error, and factors for each regime of slice distances."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from cccd.bands.signs import SIGNS
from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray, SingleArray

#: Slice distances in pixels at which one regime ends and the next begins.
REGIMES = (0.5, 1.5, 2.5, 4.5, 7.5, 30.0)
#: The shares of the surface that factors are kept for; between them they are interpolated.
SHARES = (0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95)
#: What `cccd_training.bands` wrote, and its SHA-256: the workflow lofts again when it changes.
SHIPPED = Path(__file__).with_name("shipped.json")
SHIPPED_SHA256 = "5ac03ced654a653c2f276af6758197883aa61de69c78be930bc6bdce1b267c8d"


@dataclass(frozen=True)
class Curve:
    """What a sign adds to the logarithm of the scale in pixels, linear between some of its values."""

    signs: tuple[float, ...]
    adds: tuple[float, ...]


@dataclass(frozen=True)
class Regime:
    """Factors for slice distances from ``low`` to ``high`` pixels.

    Attributes
    ----------
    low, high : float
    organs, stacks : int
        Of how many they were made.
    length : float
        Over so many pixels errors are correlated along the surface.
    factors, volume_factors : tuple of float
        By which the scale, and its integral over the surface for the volume, are multiplied; one for each of
        the first of `SHARES`, as far as there were organs enough.
    """

    low: float
    high: float
    organs: int
    stacks: int
    length: float
    factors: tuple[float, ...]
    volume_factors: tuple[float, ...]


@dataclass(frozen=True)
class Calibration:
    """How wide bands are.

    Attributes
    ----------
    made_of : str
        Of which organs and stacks.
    scale : dict of str to Curve
        What each of `SIGNS` adds to the logarithm of the error's scale.
    regimes : tuple of Regime
    spans : dict of str to ((float, float), ...)
        By what the mean scale is multiplied for the ends of an interval, for each of `SHARES`: ``area`` moves
        the surface out by it, ``diameter`` is longer by it.
    """

    made_of: str
    scale: dict[str, Curve]
    regimes: tuple[Regime, ...] = ()
    spans: dict[str, tuple[tuple[float, float], ...]] = field(default_factory=dict[str, Any])

    def lengths(self, signs: FloatArray | SingleArray) -> FloatArray:
        """Scale (V,) of the error in pixels at signs (V, F)."""
        curves = (self.scale[name] for name in SIGNS)
        added = (np.interp(signs[:, n], curve.signs, curve.adds) for n, curve in enumerate(curves))
        return np.exp(sum(added, np.zeros(len(signs))))

    def factors(self, ratio: float, share: float) -> tuple[float, float, float, bool]:
        """Factors of the scale and of the volume, correlation length, and whether all are extrapolated.

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
        return factor, volume, best.length, min(off) > 1

    def span(self, name: str, share: float) -> tuple[float, float]:
        """Factors of the mean scale for the ends of a number's interval."""
        low, high = (np.interp(share, SHARES, ends) for ends in zip(*self.spans[name], strict=True))
        return float(low), float(high)

    def write(self, path: Path) -> None:
        """Write it as JSON."""
        path.write_text(json.dumps(asdict(self), indent=1) + "\n", encoding="utf-8")

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
        found = TypeAdapter(Calibration).validate_json(path.read_bytes())
        if not ({*SIGNS} <= found.scale.keys() and found.regimes and found.spans):
            raise ValueError("something is missing")
        return found
    except OSError as error:
        raise InputError(str(path), f"the calibration cannot be read ({error.strerror})", hint) from None
    except ValueError:
        raise InputError(str(path), "that is no calibration of this version", hint) from None
