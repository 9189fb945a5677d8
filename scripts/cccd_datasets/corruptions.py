"""What goes wrong with boundary maps: corruptions of true contours, of graded severity.

Rates follow a contour's length: the counts named below are for 300 pixels at severity 1.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import cv2
import numpy as np

from cccd.geometry.arrays import AnyArray, BoolArray, ByteArray, IntArray, ranks_of
from cccd.geometry.opencv import border_pixels, distance_to_zero
from cccd.tolerances import ROUNDING


class _Canvas:
    """A boundary map in the making: defects are drawn onto it, one after the other."""

    def __init__(self, rng: np.random.Generator, contours: list[IntArray], shape: tuple[int, ...]):
        self.rng = rng
        self.contours = contours
        self.shape = shape
        self.observed = np.zeros(shape, np.uint8)
        for contour in contours:
            self.observed[contour[:, 0], contour[:, 1]] = 1
        self.sizes: IntArray = np.array([len(contour) for contour in contours])

    def count(self, per_300: float) -> int:
        """How many of a defect there are: at least one, and about ``per_300`` for 300 pixels."""
        return max(1, int(self.rng.poisson(per_300 * int(self.sizes.sum()) / 300)))

    def pick(self) -> tuple[IntArray, int]:
        """Pick a random place on a random contour."""
        contour = self.contours[self.rng.choice(len(self.sizes), p=self.sizes / self.sizes.sum())]
        return contour, int(self.rng.integers(len(contour)))

    def normal(self, contour: IntArray, at: int | IntArray, reach: int = 4) -> AnyArray:
        """Estimate unit normal(s) of a contour over ``reach`` pixels to both sides."""
        n = len(contour)
        tangent = contour[(at + reach) % n] - contour[(at - reach) % n]
        normal = np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1).astype(float)
        return normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), ROUNDING)

    def line(self, path: AnyArray | list[AnyArray]) -> None:
        """Draw a polyline (N, 2) of (i, j)."""
        corners = np.rint(np.asarray(path, float))[:, ::-1].astype(np.int32).reshape(-1, 1, 2)
        cv2.polylines(self.observed, [corners], False, 1)

    def arc(self, low: int, high: int) -> IntArray:
        """Pixels (n, 2) of a random stretch of ``low`` to ``high`` pixels, at most half a contour."""
        contour, at = self.pick()
        length = min(int(self.rng.integers(low, high + 1)), len(contour) // 2)
        return contour[(at + np.arange(max(length, 2))) % len(contour)]


def _spurs(canvas: _Canvas, severity: float) -> None:
    rng = canvas.rng
    for _ in range(canvas.count(8 * severity)):
        contour, at = canvas.pick()
        normal = canvas.normal(contour, at)
        if not normal.any():
            normal = np.array([0.0, 1.0])
        angle = np.arctan2(*normal) + rng.choice([0, np.pi]) + rng.normal(0, 0.5)
        length, bend = rng.uniform(3, 12.5), rng.normal(0, 0.5) * (rng.random() < 0.5)
        middle = contour[at] + length / 2 * np.array([np.sin(angle), np.cos(angle)])
        end = middle + length / 2 * np.array([np.sin(angle + bend), np.cos(angle + bend)])
        canvas.line([contour[at], middle, end])


def _bridges(canvas: _Canvas, severity: float) -> None:
    rng = canvas.rng
    for _ in range(max(1, round(2 * severity))):
        (one, a), (other, b) = canvas.pick(), canvas.pick()
        if rng.random() < 0.5:  # across a shorter stretch, as between neighbouring lobes
            other, b = one, int(a + rng.integers(8, max(9, len(one) // 3))) % len(one)
        path: list[AnyArray] = [one[a], other[b]]
        if rng.random() < 0.2:
            path.insert(1, (one[a] + other[b]) / 2 + rng.normal(0, 0.1 * np.hypot(*(one[a] - other[b])), 2))
        canvas.line(path)


def _pinch(canvas: _Canvas, severity: float) -> None:
    """Short links where a contour comes close to itself or to another one, but not along it."""
    rng = canvas.rng
    points = np.concatenate(canvas.contours)
    which = np.repeat(np.arange(len(canvas.sizes)), canvas.sizes)
    place = ranks_of(canvas.sizes)
    tried = rng.choice(len(points), min(len(points), 150), replace=False)
    apart = np.linalg.norm(points[tried, None] - points[None], axis=-1)
    along = np.abs(place[tried, None] - place[None])
    along = np.minimum(along, canvas.sizes[which][None] - along)
    along = np.where(which[tried, None] == which[None], along, 10_000)
    ratio = np.where((along > 12) & (apart > 1.5), apart / np.clip(along, 1, 100), np.inf)
    best = ratio.min(axis=1)
    order = np.argsort(best + rng.uniform(0, 0.05, len(best)))
    for n in range(max(1, round(2 * severity))):
        pick = order[min(int(rng.exponential(4)) + n, len(order) - 1)]
        if np.isfinite(best[pick]):
            canvas.line([points[tried[pick]], points[ratio[pick].argmin()]])


def _blocks(canvas: _Canvas, severity: float) -> None:
    for _ in range(canvas.count(15 * severity)):
        contour, at = canvas.pick()
        i, j = contour[at] - canvas.rng.integers(0, 2, 2)
        canvas.observed[i : i + 2, j : j + 2] = 1


def _gaps(canvas: _Canvas, severity: float) -> None:
    longest = 8 if canvas.rng.random() < 0.8 else 14
    for _ in range(canvas.count(5 * severity)):
        arc = canvas.arc(2, longest)
        canvas.observed[arc[:, 0], arc[:, 1]] = 0


def _noise(canvas: _Canvas, severity: float) -> None:
    rng = canvas.rng
    near = distance_to_zero(1 - canvas.observed) <= 10
    salt = near & (rng.random(canvas.shape) < 0.01 * severity)
    for _ in range(max(1, round(3 * severity))):
        contour, at = canvas.pick()
        angle, half = rng.uniform(0, 2 * np.pi), rng.uniform(5, 22)
        shift = half * rng.uniform(-0.8, 0.8)
        step = np.array([np.sin(angle), np.cos(angle)])
        canvas.line([contour[at] + (shift - half) * step, contour[at] + (shift + half) * step])
    canvas.observed |= salt.astype(np.uint8)


def _double(canvas: _Canvas, severity: float) -> None:
    rng = canvas.rng
    for _ in range(max(1, round(2 * severity))):
        contour, at = canvas.pick()
        length = int(len(contour) * rng.uniform(0.05, 0.25))
        place = (at + np.arange(max(length, 6))) % len(contour)
        offset = rng.uniform(2.5, 5.5) * rng.choice([-1, 1])
        path = contour[place] + offset * canvas.normal(contour, place, reach=6)
        if rng.random() < 0.25:  # closed at its ends
            path = np.vstack([contour[place[0]], path, contour[place[-1]]])
        canvas.line(path)


def _thick(canvas: _Canvas, severity: float) -> None:
    rng = canvas.rng
    for _ in range(max(1, round(5 * severity))):
        contour, at = canvas.pick()
        length = int(len(contour) * rng.uniform(0.04, 0.14)) + 4
        place = (at + np.arange(length)) % len(contour)
        band = np.zeros(canvas.shape, np.uint8)
        band[contour[place, 0], contour[place, 1]] = 1
        radius = int(rng.integers(1, 3))
        shape = cv2.MORPH_ELLIPSE if rng.random() < 0.7 else cv2.MORPH_RECT
        kernel = cv2.getStructuringElement(shape, (2 * radius + 1, 2 * radius + 1))
        band = cast(ByteArray, cv2.dilate(band, kernel))
        canvas.observed |= band & (rng.random(canvas.shape) >= 0.1)


def _jitter(canvas: _Canvas, severity: float) -> None:
    """Single pixels off by one, as in digitised or Canny-like chains."""
    rng = canvas.rng
    for contour in canvas.contours:
        moved = contour[rng.random(len(contour)) < 0.15 * severity]
        canvas.observed[moved[:, 0], moved[:, 1]] = 0
        moved = moved + rng.integers(-1, 2, moved.shape)
        canvas.observed[moved[:, 0], moved[:, 1]] = 1


def _mixed(canvas: _Canvas, severity: float) -> None:
    _gaps(canvas, 0.4 * severity)
    _spurs(canvas, 0.5 * severity)
    _bridges(canvas, 0.5 * severity)
    _blocks(canvas, 0.4 * severity)
    _double(canvas, 0.5 * severity)
    _noise(canvas, 0.5 * severity)


def _everything(canvas: _Canvas, severity: float) -> None:
    """Any mixture, pinches and thick bands included."""
    chosen = [_gaps, _spurs, _bridges, _blocks, _double, _noise, _pinch, _thick, _jitter]
    for defect in chosen:
        if canvas.rng.random() < 0.4:
            defect(canvas, severity * canvas.rng.uniform(0.2, 0.8))


#: The ten kinds, by name, and ``everything`` for training.
KINDS: dict[str, Callable[[_Canvas, float], None]] = {
    "clean": lambda canvas, severity: None,
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


def corrupt(rng: np.random.Generator, mask: ByteArray, kind: str, severity: float = 1.0) -> BoolArray:
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
    canvas = _Canvas(rng, border_pixels(mask), mask.shape)
    KINDS[kind](canvas, severity)
    return canvas.observed.astype(bool)
