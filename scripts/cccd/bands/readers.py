"""How far another reader's border may be off: a number in mm, or what pairs of masks show."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.special import ndtri

from cccd.bands.calibration import SHARES
from cccd.errors import InputError

#: Unit of the widths of a file.
UNIT = "mm"
#: Of a number alone: how far the whole border moves together, as a share of how far each of its places does.
TOGETHER = 0.5
#: A normally distributed length by its mean size.
_BY_MEAN = np.sqrt(np.pi / 2)


@dataclass(frozen=True)
class Reader:
    """What another reader adds to a band, for each of `SHARES`.

    Attributes
    ----------
    widths : tuple of float
        mm. The root of the sum of its square and the band's is the wider band.
    swept : tuple of float
        The same for the volume's difference by the area, mm.
    made_of : str
    """

    widths: tuple[float, ...]
    swept: tuple[float, ...]
    made_of: str

    def at(self, share: float) -> tuple[float, float]:
        """Width and swept length in mm for a share.

        Raises
        ------
        InputError
            There were too few organs for it.
        """
        shares = SHARES[: len(self.widths)]
        if not shares[0] <= share <= shares[-1]:
            problem = f"{self.made_of} are too few for a share of {share:g}"
            hint = f"choose surface.band from {shares[0]:g} to {shares[-1]:g}"
            raise InputError("surface.reader_mm", problem, hint)
        return float(np.interp(share, shares, self.widths)), float(np.interp(share, shares, self.swept))

    @classmethod
    def of(cls, given: float | str) -> Reader:
        """Take by how many mm two readers differ on the mean, or read what `write` wrote.

        Examples
        --------
        >>> [round(mm, 2) for mm in Reader.of(0.5).at(0.9)]
        [1.03, 0.52]
        """
        try:
            mean = float(given)
        except ValueError:
            return cls.read(Path(str(given)))
        if not 0 < mean <= 100:
            problem = f"{given} is no distance between two readers' borders"
            raise InputError("surface.reader_mm", problem, "give mm, above 0 and up to 100")
        widths = mean * _BY_MEAN * ndtri((1 + np.array(SHARES)) / 2)
        return cls((*widths.tolist(),), (*(TOGETHER * widths).tolist(),), f"{mean:g} mm")

    @classmethod
    def read(cls, path: Path) -> Reader:
        """Read what `write` wrote."""
        hint = "make one with cccd calibrate --readers"
        try:
            plain = json.loads(path.read_text(encoding="utf-8"))
            table = np.array([plain["widths"], plain["swept"]], float)
            widths, swept = table.tolist()
            unit, reader = plain["unit"], cls((*widths,), (*swept,), str(plain["made_of"]))
            if not np.all((table >= 0) & (table < np.inf)) or not 0 < len(table[0]) <= len(SHARES):
                raise ValueError(table)
        except OSError as error:
            problem = f"the readers' calibration cannot be read ({error.strerror})"
            raise InputError(str(path), problem, hint) from None
        except (ValueError, KeyError, TypeError):
            raise InputError(str(path), "that is no calibration of readers", hint) from None
        if unit != UNIT:
            raise InputError(str(path), f"its lengths are in {unit}, not in {UNIT}", hint)
        return reader

    def write(self, path: Path) -> None:
        """Write it as JSON."""
        path.write_text(json.dumps(asdict(self) | {"unit": UNIT}, indent=1) + "\n", encoding="utf-8")
