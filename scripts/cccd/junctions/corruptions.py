"""What goes wrong with boundary maps: corruptions of true contours, of graded severity.

Rates follow a contour's length: the counts named below are for 300 pixels at severity 1.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

__all__ = ["KINDS", "contours_of", "corrupt"]


def contours_of(mask: np.ndarray) -> list[np.ndarray]:
    """Ordered border pixels (N, 2) as (i, j) of every outer border and hole of a mask (I, J)."""
    found, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    return [contour[:, 0, ::-1].astype(np.int64) for contour in found]


class _Sheet:
    """A boundary map in the making."""

    def __init__(self, rng: np.random.Generator, contours: list[np.ndarray], shape: tuple[int, int]):
        self.rng = rng
        self.contours = contours
        self.shape = shape
        self.drawn = np.zeros(shape, np.uint8)
        for contour in contours:
            self.drawn[contour[:, 0], contour[:, 1]] = 1
        self.sizes = np.array([len(contour) for contour in contours])

    def count(self, per_300: float) -> int:
        """How many of a defect there are: at least one, and about ``per_300`` for 300 pixels."""
        return max(1, int(self.rng.poisson(per_300 * self.sizes.sum() / 300)))

    def pick(self) -> tuple[np.ndarray, int]:
        """Pick a random place on a random contour."""
        contour = self.contours[self.rng.choice(len(self.sizes), p=self.sizes / self.sizes.sum())]
        return contour, int(self.rng.integers(len(contour)))

    def normal(self, contour: np.ndarray, at: int | np.ndarray, reach: int = 4) -> np.ndarray:
        """Estimate unit normal(s) of a contour over ``reach`` pixels to both sides."""
        n = len(contour)
        tangent = contour[(at + reach) % n] - contour[(at - reach) % n]
        normal = np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1).astype(float)
        return normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)

    def line(self, path: np.ndarray, value: int = 1, width: int = 1) -> None:
        """Draw a polyline (N, 2) of (i, j)."""
        path = np.rint(np.asarray(path, float))[:, ::-1].astype(np.int32).reshape(-1, 1, 2)
        cv2.polylines(self.drawn, [path], False, value, width)

    def arc(self, low: int, high: int) -> np.ndarray:
        """Pixels (n, 2) of a random stretch of ``low`` to ``high`` pixels, at most half a contour."""
        contour, at = self.pick()
        length = min(int(self.rng.integers(low, high + 1)), len(contour) // 2)
        return contour[(at + np.arange(max(length, 2))) % len(contour)]


def _spurs(sheet: _Sheet, severity: float) -> None:
    rng = sheet.rng
    for _ in range(sheet.count(8 * severity)):
        contour, at = sheet.pick()
        normal = sheet.normal(contour, at)
        if not normal.any():
            normal = np.array([0.0, 1.0])
        angle = np.arctan2(*normal) + rng.choice([0, np.pi]) + rng.normal(0, 0.5)
        length, bend = rng.uniform(3, 12.5), rng.normal(0, 0.5) * (rng.random() < 0.5)
        middle = contour[at] + length / 2 * np.array([np.sin(angle), np.cos(angle)])
        end = middle + length / 2 * np.array([np.sin(angle + bend), np.cos(angle + bend)])
        sheet.line([contour[at], middle, end])


def _bridges(sheet: _Sheet, severity: float) -> None:
    rng = sheet.rng
    for _ in range(max(1, round(2 * severity))):
        (one, a), (other, b) = sheet.pick(), sheet.pick()
        if rng.random() < 0.5:  # across a shorter stretch, as between neighbouring lobes
            other, b = one, int(a + rng.integers(8, max(9, len(one) // 3))) % len(one)
        path = [one[a], other[b]]
        if rng.random() < 0.2:
            path.insert(1, (one[a] + other[b]) / 2 + rng.normal(0, 0.1 * np.hypot(*(one[a] - other[b])), 2))
        sheet.line(path)


def _pinch(sheet: _Sheet, severity: float) -> None:
    """Short links where a contour comes close to itself or to another one, but not along it."""
    rng = sheet.rng
    points = np.concatenate(sheet.contours)
    which = np.repeat(np.arange(len(sheet.sizes)), sheet.sizes)
    place = np.concatenate([np.arange(n) for n in sheet.sizes])
    tried = rng.choice(len(points), min(len(points), 150), replace=False)
    apart = np.linalg.norm(points[tried, None] - points[None], axis=-1)
    along = np.abs(place[tried, None] - place[None])
    along = np.minimum(along, sheet.sizes[which][None] - along)
    along = np.where(which[tried, None] == which[None], along, 10_000)
    ratio = np.where((along > 12) & (apart > 1.5), apart / np.clip(along, 1, 100), np.inf)
    best = ratio.min(axis=1)
    order = np.argsort(best + rng.uniform(0, 0.05, len(best)))
    for n in range(max(1, round(2 * severity))):
        pick = order[min(int(rng.exponential(4)) + n, len(order) - 1)]
        if np.isfinite(best[pick]):
            sheet.line([points[tried[pick]], points[ratio[pick].argmin()]])


def _blocks(sheet: _Sheet, severity: float) -> None:
    for _ in range(sheet.count(15 * severity)):
        contour, at = sheet.pick()
        i, j = contour[at] - sheet.rng.integers(0, 2, 2)
        sheet.drawn[i : i + 2, j : j + 2] = 1


def _gaps(sheet: _Sheet, severity: float) -> None:
    longest = 8 if sheet.rng.random() < 0.8 else 14
    for _ in range(sheet.count(5 * severity)):
        arc = sheet.arc(2, longest)
        sheet.drawn[arc[:, 0], arc[:, 1]] = 0


def _noise(sheet: _Sheet, severity: float) -> None:
    rng = sheet.rng
    near = cv2.distanceTransform(1 - sheet.drawn, cv2.DIST_L2, 3) <= 10
    salt = near & (rng.random(sheet.shape) < 0.01 * severity)
    for _ in range(max(1, round(3 * severity))):
        contour, at = sheet.pick()
        angle, half = rng.uniform(0, 2 * np.pi), rng.uniform(5, 22)
        shift = half * rng.uniform(-0.8, 0.8)
        step = np.array([np.sin(angle), np.cos(angle)])
        sheet.line([contour[at] + (shift - half) * step, contour[at] + (shift + half) * step])
    sheet.drawn |= salt.astype(np.uint8)


def _double(sheet: _Sheet, severity: float) -> None:
    rng = sheet.rng
    for _ in range(max(1, round(2 * severity))):
        contour, at = sheet.pick()
        length = int(len(contour) * rng.uniform(0.05, 0.25))
        place = (at + np.arange(max(length, 6))) % len(contour)
        offset = rng.uniform(2.5, 5.5) * rng.choice([-1, 1])
        path = contour[place] + offset * sheet.normal(contour, place, reach=6)
        if rng.random() < 0.25:  # closed at its ends
            path = np.vstack([contour[place[0]], path, contour[place[-1]]])
        sheet.line(path)


def _thick(sheet: _Sheet, severity: float) -> None:
    rng = sheet.rng
    for _ in range(max(1, round(5 * severity))):
        contour, at = sheet.pick()
        length = int(len(contour) * rng.uniform(0.04, 0.14)) + 4
        place = (at + np.arange(length)) % len(contour)
        band = np.zeros(sheet.shape, np.uint8)
        band[contour[place, 0], contour[place, 1]] = 1
        radius = int(rng.integers(1, 3))
        shape = cv2.MORPH_ELLIPSE if rng.random() < 0.7 else cv2.MORPH_RECT
        band = cv2.dilate(band, cv2.getStructuringElement(shape, (2 * radius + 1, 2 * radius + 1)))
        sheet.drawn |= band & (rng.random(sheet.shape) >= 0.1)


def _jitter(sheet: _Sheet, severity: float) -> None:
    """Single pixels off by one, as in digitised or Canny-like chains."""
    rng = sheet.rng
    for contour in sheet.contours:
        moved = contour[rng.random(len(contour)) < 0.15 * severity]
        sheet.drawn[moved[:, 0], moved[:, 1]] = 0
        moved = moved + rng.integers(-1, 2, moved.shape)
        sheet.drawn[moved[:, 0], moved[:, 1]] = 1


def _mixed(sheet: _Sheet, severity: float) -> None:
    _gaps(sheet, 0.4 * severity)
    _spurs(sheet, 0.5 * severity)
    _bridges(sheet, 0.5 * severity)
    _blocks(sheet, 0.4 * severity)
    _double(sheet, 0.5 * severity)
    _noise(sheet, 0.5 * severity)


def _everything(sheet: _Sheet, severity: float) -> None:
    """Any mixture, pinches and thick bands included."""
    chosen = [_gaps, _spurs, _bridges, _blocks, _double, _noise, _pinch, _thick, _jitter]
    for defect in chosen:
        if sheet.rng.random() < 0.4:
            defect(sheet, severity * sheet.rng.uniform(0.2, 0.8))


#: The ten kinds, by name, and ``everything`` for training.
KINDS: dict[str, Callable[[_Sheet, float], None]] = {
    "clean": lambda sheet, severity: None,
    "spurs": _spurs,
    "bridges": _bridges,
    "pinch": _pinch,
    "blocks": _blocks,
    "gaps": _gaps,
    "noise": _noise,
    "double": _double,
    "thick": _thick,
    "mixed": _mixed,
    "everything": _everything,
}


def corrupt(rng: np.random.Generator, mask: np.ndarray, kind: str, severity: float = 1.0) -> np.ndarray:
    """Boundary map of a mask with one kind of corruption.

    Parameters
    ----------
    rng : Generator
    mask : (I, J) uint8 array
        With a margin of at least 10 pixels.
    kind : str
        One of `KINDS`.
    severity : float
        1 for the rates of the published comparison.

    Returns
    -------
    (I, J) bool array
    """
    sheet = _Sheet(rng, contours_of(mask), mask.shape)
    KINDS[kind](sheet, severity)
    return sheet.drawn.astype(bool)
