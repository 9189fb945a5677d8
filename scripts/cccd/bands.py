"""How far a surface may be off: a band for every vertex, and intervals of volumes.

`signs_of` is what can be seen at a vertex, a `Calibration` turns it into millimetres, a `Reader` is what
another reader adds. `cccd_calibration` measures these, and draws surfaces within a band.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from pydantic import TypeAdapter
from scipy.special import ndtri

from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray, SingleArray
from cccd.geometry.mesh import Mesh

#: The signs of a vertex, in the columns' order, as logarithms; lengths are in pixels.
SIGNS = (
    "slope",  # how far the slices lie apart along the normal, most in the middle of the gap
    "thick",  # through the organ along the normal
    "curvature",  # mean over the surface, times the distance between slices
)
#: Lengths of no more than this many pixels tell nothing more.
LEAST_PIXELS = 0.05
#: Steps in pixels along the normal on which the organ's other side is sought; it counts as far as the last.
STEPS = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, 12.0, 14.0, 16.0)


@dataclass(frozen=True, eq=False)
class Slices:
    """Signed distances on the slices.

    Attributes
    ----------
    z : (S,) float64
        Heights in mm, ascending.
    distance : (S, I, J) float32
        mm, negative inside.
    spacing : (2,) float64
        mm per pixel along i and j.
    """

    z: FloatArray
    distance: SingleArray
    spacing: FloatArray

    @property
    def pixel(self) -> float:
        """Edge length of a pixel in mm (the geometric mean of its two)."""
        return float(np.sqrt(self.spacing.prod()))

    @property
    def step(self) -> float:
        """Median distance of neighbouring slices in mm; a pixel's edge where there is one slice."""
        return float(np.median(np.diff(self.z))) if len(self.z) > 1 else self.pixel

    @property
    def ratio(self) -> float:
        """Distance between slices in pixels."""
        return self.step / self.pixel


def signs_of(mesh: Mesh, slices: Slices) -> FloatArray:
    """See what there is at the vertices of a closed mesh: (V, len(SIGNS)).

    Parameters
    ----------
    mesh : Mesh
        In the plane's mm and height, as the slices are.
    slices : Slices
    """
    z, points, normal = slices.z, mesh.vertices, mesh.vertex_normals
    below = np.searchsorted(z, points[:, 2], side="right").astype(np.int64) - 1
    ends = np.concatenate([[z[0] - slices.step], z, [z[-1] + slices.step]])
    low, high = ends[below + 1], ends[below + 2]
    gap = high - low
    share = np.clip((points[:, 2] - low) / gap, 0, 1)
    pixels = {
        "slope": 4 * share * (1 - share) * gap * np.abs(normal[:, 2]) / slices.pixel,
        "thick": _thickness(points, normal, slices),
        "curvature": np.full(len(points), mesh.curvature_per_area * slices.step),
    }
    return np.log(np.column_stack([pixels[name] for name in SIGNS]) + LEAST_PIXELS)


def _thickness(points: FloatArray, normal: FloatArray, slices: Slices) -> FloatArray:
    """Pixels (P,) from points on a surface along their normals through the organ, to its other side."""
    heights = np.arange(len(slices.z))
    found, nearer, held = np.full(len(points), STEPS[-1]), 0.0, np.zeros(len(points))
    for step in STEPS:
        there = points - step * slices.pixel * normal
        index = [np.interp(there[:, 2], slices.z, heights), *(there[:, :2] / slices.spacing).T]
        off = scipy.ndimage.map_coordinates(slices.distance, index, float, order=1, mode="nearest")
        off = np.maximum(off, np.maximum(slices.z[0] - there[:, 2], there[:, 2] - slices.z[-1]))
        out = (off > 0) & (found == STEPS[-1])
        share = np.divide(held, held + off, out=np.zeros(len(points)), where=out)
        found = np.where(out, nearer + share * (step - nearer), found)
        nearer, held = step, np.maximum(-off, 0)
    return found


#: Slice distances in pixels at which one regime ends and the next begins.
REGIMES = (0.5, 1.5, 2.5, 4.5, 7.5, 30.0)
#: The shares of the surface that factors are kept for; between them they are interpolated.
SHARES = (0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95)
#: What `cccd_calibration.shipped_bands` wrote, and its SHA-256: the workflow lofts again when it changes.
SHIPPED = Path(__file__).with_name("bands.json")
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


@dataclass(frozen=True, eq=False)
class Band:
    """Where a share of the true surface lies, along the normals of a surface.

    Attributes
    ----------
    inner, outer : (V,) float64
        mm inwards and outwards from each vertex.
    share : float
        Of the surface that is covered, on the mean of organs like those of the calibration.
    volume_factor : float
        What ``inner`` and ``outer`` times the surface's area are multiplied by for the volume's interval.
    extrapolated : bool
        Whether the calibration knows no slices so far apart, or so near to each other.
    length_mm : float
        Over which errors are correlated along the surface.
    area_low, area_high, diameter_low, diameter_high : float
        By what the band's mean width is multiplied for the ends of these intervals.
    """

    inner: FloatArray
    outer: FloatArray
    share: float
    volume_factor: float
    extrapolated: bool
    length_mm: float = 1.0
    area_low: float = -1.0
    area_high: float = 1.0
    diameter_low: float = -1.0
    diameter_high: float = 1.0

    def volume_interval(self, mesh: Mesh) -> tuple[float, float]:
        """Lowest and highest volume in mm^3 of the band's mesh, for the same share."""
        area = mesh.vertex_areas
        low, high = (self.volume_factor * float(area @ side) for side in (self.inner, self.outer))
        return max(mesh.volume - low, 0.0), mesh.volume + high

    def warnings(self, ratio: float) -> list[str]:
        """Say so where the band is extrapolated; ``ratio``: distance between slices in pixels."""
        if not self.extrapolated:
            return []
        return [f"the error band is extrapolated: the calibration has no slices {ratio:.2g} pixels apart"]

    def sides(self, mesh: Mesh) -> dict[str, Mesh]:
        """Move the band's mesh ``inner`` and ``outer``; in thin organs inner may pass through itself."""
        points, normals = mesh.vertices, mesh.vertex_normals
        moves = {"inner": -self.inner, "outer": self.outer}
        return {name: Mesh(points + by[:, None] * normals, mesh.faces) for name, by in moves.items()}

    def moved_to(self, vertices: FloatArray, points: FloatArray) -> Band:
        """Return the band at other points (P, 3): that of the nearest of its ``vertices`` (V, 3)."""
        nearest = scipy.spatial.cKDTree(vertices).query(points)[1]
        return replace(self, inner=self.inner[nearest], outer=self.outer[nearest])


def estimate_band(
    mesh: Mesh,
    slices: Slices,
    share: float,
    calibration: Calibration,
    reader: Reader | None = None,
    doubt: FloatArray | None = None,
) -> Band:
    """Estimate the band of a surface that was lofted from slices.

    Parameters
    ----------
    mesh : Mesh
        In the plane's mm and height, as the slices are.
    slices : Slices
    share : float
        Of the surface that shall lie within.
    calibration : Calibration
    reader : Reader, optional
        The band then holds that share of another reader's border, too.
    doubt : (V,) float64, optional
        How far from the border, in mm, a network's probabilities are not certain: see `find_doubt`.

    Raises
    ------
    InputError
        The calibration has no factors for the share.
    """
    factor, volume_factor, length, extrapolated = calibration.factors(slices.ratio, share)
    between = factor * slices.pixel * calibration.lengths(signs_of(mesh, slices))
    width, swept = between, volume_factor / factor * between
    if doubt is not None:
        width, swept = np.hypot(width, doubt), np.hypot(swept, doubt)
    if reader is not None:
        beyond, together = reader.at(share)
        width, swept = np.hypot(width, beyond), np.hypot(swept, together)
    area = mesh.vertex_areas
    ratio = float(area @ swept) / max(float(area @ width), 1e-12)
    ends = [end / factor for name in ("area", "diameter") for end in calibration.span(name, share)]
    return Band(width, width, share, ratio, extrapolated, length * slices.pixel, *ends)
