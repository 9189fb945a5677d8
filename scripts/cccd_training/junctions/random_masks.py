"""Random organ-like masks: what training and test contours are drawn from.

Every shape is the zero level set of a random field on a pixel grid, so that its border is a true pixel
staircase: lobed and elongated bodies, unions of balls, wrinkled cortex, notches, deep narrow inlets
with or without a bulb at their end, several components and holes.
"""

from __future__ import annotations

from typing import cast

import cv2
import numpy as np

from cccd.geometry.arrays import AnyArray, ByteArray, SingleArray
from cccd.geometry.opencv import components
from cccd.tolerances import CONTRAST

# Directions in which a polar outline is evaluated; finer than the pixels of the largest mask.
_ANGLES = 4096

# Smaller masks, components and holes are not kept, in pixels.
_SMALLEST_PX = 25


def smooth_noise(rng: np.random.Generator, shape: tuple[int, ...], scale: float) -> SingleArray:
    """Gaussian random field of unit variance whose features are about ``scale`` pixels large."""
    grid = [max(4, int(np.ceil(n / scale)) + 3) for n in shape]
    coarse = rng.standard_normal(grid).astype(np.float32)
    fine = cast(SingleArray, cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_CUBIC))
    return fine / max(float(fine.std()), CONTRAST)


def draw_mask(rng: np.random.Generator) -> ByteArray:
    """Draw one random organ-like mask.

    Returns
    -------
    (I, J) uint8 array of 0 and 1
        At least 25 pixels large, with 24 empty pixels around.
    """
    while True:
        smallest, largest = (8, 60) if rng.random() < 0.7 else (40, 120)
        radius = float(np.exp(float(rng.uniform(float(np.log(smallest)), float(np.log(largest))))))
        mask = (_field(rng, radius) > 0).astype(np.uint8)
        mask[:12], mask[-12:], mask[:, :12], mask[:, -12:] = 0, 0, 0, 0
        if rng.random() < 0.45:
            for _ in range(rng.integers(1, 5)):
                mask = _with_inlet(rng, mask, radius)
        holes = rng.random() < 0.18
        if holes:
            for _ in range(rng.integers(1, 4)):
                mask = _with_hole(rng, mask, radius)
        mask = _tidy(mask, holes)
        if mask.sum() >= _SMALLEST_PX:
            return np.pad(mask, 12)


def _field(rng: np.random.Generator, radius: float) -> AnyArray:
    """Draw a field (I, J) that is positive in an organ of about a radius, and large enough around it."""
    half = int(1.75 * radius) + 14
    y, x = np.mgrid[-half : half + 1, -half : half + 1].astype(np.float32)
    kind = rng.random()
    body = _polar_body if kind < 0.5 else _balls if kind < 0.75 else _cut_polygon
    field = body(rng, y, x, radius)
    if rng.random() < 0.2:  # a second body: another component, or a lobe when they meet
        shift = rng.normal(0, 1, 2)
        shift *= rng.uniform(0.6, 1.3) * radius / np.hypot(*shift)
        second = _polar_body(rng, y - shift[0], x - shift[1], radius * rng.uniform(0.25, 0.8))
        field = np.maximum(field, second)
    if rng.random() < 0.08:  # a crescent, as where a lung or a spleen ends
        shift = rng.normal(0, 1, 2)
        shift *= max(2.5, rng.uniform(0.1, 0.6) * radius) / np.hypot(*shift)
        field = np.minimum(field, -np.roll(field, tuple(np.rint(shift).astype(int)), (0, 1)))
    if rng.random() < 0.35:  # wrinkles
        depth = rng.uniform(0.02, 0.12) * radius
        field = field + depth * smooth_noise(rng, field.shape, rng.uniform(4, 0.4 * radius + 5))
    if rng.random() < 0.6:  # what voxel grids and hand drawing add
        field = field + rng.uniform(0.2, 1.0) * smooth_noise(rng, field.shape, rng.uniform(2, 8))
    return field


def _polar_body(rng: np.random.Generator, y: AnyArray, x: AnyArray, radius: float) -> AnyArray:
    """Outline by a Fourier series in polar coordinates: lobed and elongated bodies."""
    stretch = np.exp(rng.normal(0, 0.25))
    turn = rng.uniform(0, np.pi)
    u = (x * np.cos(turn) + y * np.sin(turn)) * stretch
    v = (-x * np.sin(turn) + y * np.cos(turn)) / stretch
    distance, angle = cast("tuple[AnyArray, AnyArray]", cv2.cartToPolar(u, v))
    order = int(rng.integers(2, 9))
    turned = np.arange(_ANGLES) * (2 * np.pi / _ANGLES)
    outline = np.zeros(_ANGLES, np.float32)
    power = rng.uniform(0.8, 2.0)
    for k in range(2, order + 1):
        size = rng.normal(0, 0.35 / float(k**power))
        outline += size * np.cos(k * turned + rng.uniform(0, 2 * np.pi))
    reach = radius * np.clip(1 + outline, 0.25, 1.8).astype(np.float32)
    return reach[(angle * (_ANGLES / (2 * np.pi))).astype(np.int32) % _ANGLES] - distance


def _balls(rng: np.random.Generator, y: AnyArray, x: AnyArray, radius: float) -> AnyArray:
    """Sum of bumps: a union of balls that flow into each other."""
    field = np.zeros_like(x)
    for _ in range(rng.integers(2, 7)):
        size = radius * rng.uniform(0.3, 0.7)
        ci, cj = rng.normal(0, 0.45 * radius, 2)
        field += np.exp(-((y - ci) ** 2 + (x - cj) ** 2) / size**2)
    return (field - rng.uniform(0.35, 0.6)) * radius


def _cut_polygon(rng: np.random.Generator, y: AnyArray, x: AnyArray, radius: float) -> AnyArray:
    """Intersection of half planes and discs: flat sides and rounded corners (spleen, liver wedge)."""
    field = radius - np.hypot(x, y)
    for _ in range(rng.integers(1, 5)):
        angle = rng.uniform(0, 2 * np.pi)
        field = np.minimum(field, rng.uniform(0.2, 0.9) * radius - x * np.cos(angle) - y * np.sin(angle))
    if rng.random() < 0.6:  # a round bite, like a hilum or the bed of a neighbour
        angle, far = rng.uniform(0, 2 * np.pi), rng.uniform(0.8, 1.5)
        bite = np.hypot(x - far * radius * np.cos(angle), y - far * radius * np.sin(angle))
        field = np.minimum(field, bite - radius * rng.uniform(0.4, far - 0.25))
    return field


def _with_inlet(rng: np.random.Generator, mask: ByteArray, radius: float) -> ByteArray:
    """Carve a deep narrow bay from a border pixel inwards; sometimes it ends in a bulb or a fork."""
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    contour = max(contours, key=len, default=np.zeros((0, 1, 2), np.int32))[:, 0]
    if len(contour) < 30:
        return mask
    here, heading = _way_inwards(rng, mask, contour)
    width = int(rng.integers(1, 5))
    length = radius * rng.uniform(0.15, 0.8)
    bend, steps = rng.normal(0, 0.25), max(3, int(length / 3))
    path = [here - 3 * np.array([np.cos(heading), np.sin(heading)])]
    for _ in range(steps):
        path.append(path[-1] + 3 * np.array([np.cos(heading), np.sin(heading)]))
        heading += rng.normal(bend / 5, 0.12)
    line = np.rint(path).astype(np.int32).reshape(-1, 1, 2)
    end = (int(line[-1, 0, 0]), int(line[-1, 0, 1]))
    carved = mask.copy()
    cv2.polylines(carved, [line], False, 0, width)
    if rng.random() < 0.4:
        cv2.circle(carved, end, int(rng.integers(2, 3 + max(1, int(radius // 12)))), 0, -1)
    if rng.random() < 0.25:
        i, j = np.rint(path[-1] + rng.normal(0, 0.3 * length, 2))
        cv2.line(carved, end, (int(i), int(j)), 0, width)
    return carved


def _way_inwards(rng: np.random.Generator, mask: ByteArray, contour: AnyArray) -> tuple[AnyArray, float]:
    """Choose a pixel (j, i) of a contour (n, 2), and the angle of a way from there into the mask."""
    at = rng.integers(len(contour))
    here = contour[at].astype(float)
    tangent = contour[(at + 5) % len(contour)] - contour[at - 5]
    inwards = np.array([-tangent[1], tangent[0]], float)
    inwards /= max(float(np.hypot(*inwards)), 1.0)
    probe = np.rint(here + 4 * inwards).astype(int)
    inside = (probe >= 0).all() and (probe < mask.shape[::-1]).all() and mask[probe[1], probe[0]]
    return here, float(np.arctan2(*(inwards if inside else -inwards)[::-1]) + rng.normal(0, 0.35))


def _with_hole(rng: np.random.Generator, mask: ByteArray, radius: float) -> ByteArray:
    """Punch an elliptic hole near the middle."""
    centre = rng.normal(0, 0.35 * radius, 2) + mask.shape[0] // 2
    size = radius * rng.uniform(0.08, 0.35, 2)
    turn = float(rng.uniform(0, 180))
    axes = (int(max(3, size[0])), int(max(3, size[1])))
    holed = mask.copy()
    cv2.ellipse(holed, (int(centre[0]), int(centre[1])), axes, turn, 0, 360, 0, -1)
    return holed


def _tidy(mask: ByteArray, holes: bool) -> ByteArray:
    """Open away what is one pixel thin, drop crumbs, close holes unless they are wanted."""
    mask = cast(ByteArray, cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((2, 2), np.uint8)))
    labels, areas = components(mask, connectivity=4)
    if len(areas) > 1:
        keep = areas >= max(_SMALLEST_PX, 0.03 * areas[1:].max())
        keep[0] = False
        mask = keep[labels].astype(np.uint8)
    labels, areas = components(1 - mask, connectivity=4)
    hole = areas < (_SMALLEST_PX if holes else mask.size)
    hole[[labels[0, 0], *np.unique(labels[mask > 0])]] = False
    return np.where(hole[labels], np.uint8(1), mask)
