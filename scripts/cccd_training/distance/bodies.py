"""Random bodies cut into slices: what learned distances are trained on. No organ is among them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from cccd.geometry.distance import to_mask
from cccd.surface.learned_distance import (
    LEAST_RATIO,
    MOST_RATIO,
    RANGE,
    REACH,
    SLICES,
    UNIT,
    Surroundings,
    in_space,
    near_surface,
)
from cccd_datasets.implicit_solids import ImplicitFunction

Array = np.ndarray[Any, np.dtype[Any]]
#: A smooth function of places (N, 3), negative inside.
Field = Callable[[Array], Array]

#: Pixels of a body's box in the plane, and along the stack.
WIDE, HIGH = 60, 84
#: Kinds of bodies, and how often they are drawn.
KINDS = ("smooth", "corners", "sheet", "tubes", "cut", "ovals")
SHARES = (0.54, 0.1, 0.1, 0.12, 0.06, 0.08)
#: Bumps of a ball: their correlation lengths, and from which to which height they reach, in pixels.
BUMPS = {9.0: (0.8, 4.0), 4.5: (0.2, 1.6), 2.2: (0.03, 0.5)}
#: Places of one stack.
PLACES = 3000
#: True distances beyond this many pixels are not learnt.
LEARNT = 2.5
#: Steps towards a surface's nearest point.
STEPS = 5


@dataclass(frozen=True, eq=False)
class Sample:
    """Places near the surface of one stack, what the network sees of them, and the truth.

    Attributes
    ----------
    seen : (N, F) int8
        `Surroundings.seen` as `packed` makes it.
    base, truth : (N,) float32
        Interpolated and true distance in pixels, times the place's sign.
    flipped : (N,) bool
    ratio, height : float
    exact : bool
    """

    seen: Array
    base: Array
    truth: Array
    flipped: Array
    ratio: float
    height: float
    exact: bool


def packed(seen: Array) -> Array:
    """Store what is seen in a byte each, finer near the surface."""
    share = seen * (UNIT / RANGE)
    return np.rint(127 * np.sign(share) * np.sqrt(np.abs(share))).astype(np.int8)


@dataclass(frozen=True, eq=False)
class _Body:
    """Smooth parts, and how they are put together: the least of some largest."""

    unions: list[list[Field]]

    def value(self, points: Array) -> Array:
        """Values (N,), negative inside."""
        return np.min([np.max([part(points) for part in one], axis=0) for one in self.unions], axis=0)

    def distance(self, points: Array) -> Array:
        """Signed distances (N,): those to the parts, put together likewise."""
        return np.min(
            [np.max([_distance(part, points) for part in one], axis=0) for one in self.unions], axis=0
        )


def _gradient(field: Field, points: Array, step: float = 0.25) -> Array:
    moves = step * np.eye(3)
    return np.stack([(field(points + m) - field(points - m)) / (2 * step) for m in moves], axis=1)


def _distance(field: Field, points: Array) -> Array:
    """Distances (N,) to a smooth surface: steps onto it, and along it towards the place."""
    start = field(points)
    at = points.copy()
    for _ in range(STEPS):
        value, way = field(at), _gradient(field, at)
        steep = np.maximum(np.linalg.norm(way, axis=1), 1e-6)
        normal = way / steep[:, None]
        back = points - at
        along = back - (back * normal).sum(axis=1, keepdims=True) * normal
        at = at - np.clip(value / steep, -2, 2)[:, None] * normal + 0.6 * along
    return np.sign(start) * np.linalg.norm(points - at, axis=1)


def _noise(rng: np.random.Generator, width: float) -> Array:
    """Gaussian random field of a correlation length in pixels, with variance one."""
    shape = (HIGH, WIDE, WIDE)
    field = ndimage.gaussian_filter(rng.standard_normal(shape).astype(np.float32), width, mode="wrap")
    return field / field.std()


def _field(rng: np.random.Generator, width: float) -> Field:
    """Draw a smooth field, of one or two correlation lengths."""
    values = _noise(rng, width)
    if rng.random() < 0.5:
        finer = rng.uniform(1.4, max(width, 1.5))
        values = values + rng.uniform(0.05, 0.5) * (finer / width) * _noise(rng, finer)
    coefficients = ndimage.spline_filter(values.astype(np.float64), 3, mode="grid-wrap")

    def value(points: Array) -> Array:
        return ndimage.map_coordinates(coefficients, points.T, order=3, mode="grid-wrap", prefilter=False)

    return value


def _shifted(field: Field, by: float, sign: float = 1.0) -> Field:
    return lambda points: sign * field(points) - by


def _oval(rng: np.random.Generator, least: float) -> Field:
    """Draw an ellipsoid somewhere in the box, of axes no shorter than so many pixels."""
    axes = np.exp(rng.uniform(np.log(least), np.log(26), 3))
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    middle = rng.uniform((12, 8, 8), (HIGH - 12, WIDE - 8, WIDE - 8))

    def value(points: Array) -> Array:
        return (np.linalg.norm((points - middle) @ turn / axes, axis=1) - 1) * axes.min()

    return value


def _body(rng: np.random.Generator, ratio: float) -> _Body:
    """Draw a smooth body, one with corners, a sheet, tubes, or some together."""
    kind = rng.choice(KINDS, p=SHARES)
    coarse = max(ratio, 1.0) ** 0.5
    if kind == "ovals":
        return _Body([[_oval(rng, 3.5 * coarse)] for _ in range(rng.integers(1, 4))])
    width = float(np.exp(rng.uniform(np.log(1.9 * coarse), np.log(8 * coarse))))
    body = _shifted(_field(rng, width), rng.uniform(-1, 1))
    thick = rng.uniform(0.5, 2.5) * coarse / 2 / width  # half, where the field is as steep as on its mean
    if kind == "smooth":
        return _Body([[body]])
    other = _field(rng, float(np.exp(rng.uniform(np.log(3 * coarse), np.log(9 * coarse)))))
    if kind == "corners":
        second = _shifted(other, rng.uniform(-0.7, 0.7))
        return _Body([[body, second]] if rng.random() < 0.5 else [[body], [second]])
    if kind == "sheet":
        sheet = [_shifted(other, thick), _shifted(other, thick, -1)]
        return _Body([sheet, [body]] if rng.random() < 0.5 else [[*sheet, body]])
    if kind == "cut":
        return _Body([[body, _shifted(other, thick)], [body, _shifted(other, thick, -1)]])
    third, radius = _field(rng, float(rng.uniform(4, 9)) * coarse), 2.5 * thick

    def tube(points: Array) -> Array:
        return np.sqrt(other(points) ** 2 + third(points) ** 2 + 1e-6) - radius

    return _Body([[tube]] if rng.random() < 0.6 else [[tube], [body]])


def closed_body(seed: int) -> tuple[ImplicitFunction, Array]:
    """Draw a body that closes before a box around the origin ends: it, and half the box's edges in pixels."""
    rng = np.random.default_rng(seed)
    body, box = _body(rng, float(np.exp(rng.uniform(0, np.log(3))))), np.array([HIGH, WIDE, WIDE]) / 2
    reach = rng.uniform(0.6, 1) * (box - 4)

    def solid(points: Array) -> Array:
        places = points.reshape(3, -1).T.astype(float)
        beyond = np.maximum(np.linalg.norm(places / reach, axis=1) - 0.75, 0)
        return (body.value(places + box) + 12 * beyond**2).reshape(points.shape[1:])

    return solid, 1.35 * (box - 4)


def ball_with_bumps(seed: int) -> tuple[ImplicitFunction, Array]:
    """Draw a ball, drawn out and turned, with bumps: it, and half its box's edges in pixels."""
    rng = np.random.default_rng(seed)
    axes, turn = np.exp(rng.uniform(*np.log([11, 23]), size=3)), np.linalg.qr(rng.standard_normal((3, 3)))[0]
    bumps = [_noise(rng, width) * np.exp(rng.uniform(*np.log(heights))) for width, heights in BUMPS.items()]
    coefficients = ndimage.spline_filter(np.sum(bumps, axis=0, dtype=float), 3, mode="grid-wrap")
    box = np.full(3, 31.0)

    def solid(points: Array) -> Array:
        places = points.reshape(3, -1).T.astype(float)
        ball = (np.linalg.norm(places @ turn / axes, axis=1) - 1) * axes.min()
        out = ndimage.map_coordinates(
            coefficients, (places + box).T, order=3, mode="grid-wrap", prefilter=False
        )
        return 0.6 * (ball + out).reshape(points.shape[1:])

    return solid, box


def draw_sample(seed: int) -> Sample | None:
    """Draw a body, cut it into slices and look around places near its surface; None where there are few."""
    rng = np.random.default_rng(seed)
    ratio = 1.0 if rng.random() < 0.4 else float(np.exp(rng.uniform(np.log(LEAST_RATIO), np.log(MOST_RATIO))))
    parts = max(1, round(ratio))
    height = rng.integers(parts) / parts
    height = float(height if height <= 0.5 else height - 1)
    exact = bool(rng.random() < 0.15)
    body = _body(rng, ratio)
    count = int(HIGH / ratio)
    planes = _slices(body, rng, ratio, count, exact)
    if not 0.02 < (planes < 0).mean() < 0.98:
        return None
    padded = np.pad(planes, ((SLICES, SLICES), (0, 0), (0, 0)), mode="edge")
    around = padded[SLICES - 1 : 1 - SLICES, 2:-2, 2:-2]
    base = in_space(around[:-2], around[1:-1], around[2:], ratio, height)
    base[0] = base[-1] = RANGE  # what the body's box cuts tells nothing
    near = np.argwhere(np.abs(base) < near_surface(ratio))
    if len(near) < 200:
        return None
    near = rng.choice(near, min(PLACES, len(near)), replace=False)
    base = base[tuple(near.T)]
    nodes = near + np.array([0, 2, 2])
    padded = np.pad(padded, ((0, 0), (REACH, REACH), (REACH, REACH)), mode="edge")
    points = nodes * [ratio, 1, 1] + [height * ratio, 0, 0]
    truth = body.distance(points)
    learnt = np.abs(truth) < LEARNT
    around = Surroundings.of(padded, nodes[learnt], base[learnt])
    return Sample(
        packed(around.seen),
        around.base,
        (truth[learnt] * around.sign).astype(np.float32),
        around.flipped,
        ratio,
        height,
        exact,
    )


def _slices(body: _Body, rng: np.random.Generator, ratio: float, count: int, exact: bool) -> Array:
    """Signed distances (S, I, J) within slices, at most `RANGE` pixels: of masks, or exact ones."""
    averaged = ratio > 1.4 and rng.random() < 0.25
    within = (np.arange(5) - 2) / 5 * ratio if averaged else np.zeros(1)
    layers = [_layer(body, z * ratio + within) for z in range(count)]
    values = np.stack([np.median(layer, axis=0) for layer in layers])
    if rng.random() < 0.1:
        trembling = ndimage.gaussian_filter(rng.standard_normal(values.shape), (0, 0.7, 0.7))
        steep = np.abs(np.diff(values, axis=1)).mean() * 1.6
        values = values + rng.uniform(0.1, 0.6) * steep * trembling / trembling.std()
    if ratio > 1.4 and rng.random() < 0.1:
        shifts = rng.normal(0, 0.35, (count, 2))
        values = np.stack(
            [ndimage.shift(v, s, order=1, mode="nearest") for v, s in zip(values, shifts, strict=True)]
        )
    planes = _exact(values) if exact else _of_masks(values < 0)
    return np.clip(planes, -RANGE, RANGE).astype(np.float32)


def _layer(body: _Body, heights: Array) -> Array:
    """Values (Z, I, J) on planes at heights in pixels."""
    z, i, j = np.meshgrid(heights, np.arange(WIDE), np.arange(WIDE), indexing="ij")
    return body.value(np.column_stack([z.ravel(), i.ravel(), j.ravel()]).astype(float)).reshape(z.shape)


def _of_masks(masks: Array) -> Array:
    """Distances (S, I, J) to the borders of pixels."""
    planes = np.empty(masks.shape)
    for number, mask in enumerate(masks):
        if mask.all() or not mask.any():
            planes[number] = -RANGE if mask.all() else RANGE
        else:
            planes[number] = to_mask(mask, np.ones(2))
    return planes


def _exact(values: Array) -> Array:
    """Distances (S, I, J) to where values vanish within their slice: by slope, by thirds of pixels beyond."""
    planes = np.empty(values.shape)
    for number, layer in enumerate(values):
        finer = ndimage.zoom(layer, (3 * (WIDE - 1) + 1) / WIDE, order=1, grid_mode=False) < 0
        far = _of_masks(finer[None])[0][::3, ::3] / 3
        slope = np.maximum(np.hypot(*np.gradient(layer)), 1e-6)
        planes[number] = np.where(np.abs(far) < 0.7, np.clip(layer / slope, -1, 1), far)
        if np.abs(far).min() >= RANGE / 3:  # nothing on this slice
            planes[number] = np.where(layer < 0, -RANGE, RANGE)
    return planes
