"""Implicit shapes: organs as zero sets of smooth functions of world mm (RAS).

A field maps points (..., 3) to values (...): negative inside, near the signed distance in mm by the surface.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from skimage.measure import marching_cubes

from cccd.tolerances import PROJECTION_MM

__all__ = [
    "Field",
    "capsule",
    "ellipsoid",
    "enlarge",
    "half_space",
    "intersection",
    "mesh_field",
    "sample_field",
    "subtraction",
    "torus",
    "union",
    "warped",
]

Field = Callable[[np.ndarray], np.ndarray]


def ellipsoid(centre: Sequence[float], radii: Sequence[float], turn: np.ndarray | None = None) -> Field:
    """Ellipsoid with its axes turned by the rotation matrix ``turn``; a sphere is exact.

    Distance by the first-order bound of Quilez: ``k0 (k0 - 1) / k1``.
    """
    centre, radii = np.asarray(centre, float), np.asarray(radii, float)

    def field(points: np.ndarray) -> np.ndarray:
        local = points - centre if turn is None else (points - centre) @ turn
        scaled = local / radii
        k0 = np.sqrt(np.einsum("...i,...i", scaled, scaled))
        scaled /= radii
        k1 = np.sqrt(np.einsum("...i,...i", scaled, scaled))
        return np.where(k0 > 1e-6, k0 * (k0 - 1) / np.maximum(k1, 1e-12), -radii.min())

    return field


def capsule(start: Sequence[float], end: Sequence[float], radius: float) -> Field:
    """All points within ``radius`` of a line segment; exact."""
    start, along = np.asarray(start, float), np.subtract(end, start).astype(float)

    def field(points: np.ndarray) -> np.ndarray:
        local = points - start
        share = np.clip(local @ along / (along @ along), 0, 1)
        local = local - share[..., None] * along
        return np.sqrt(np.einsum("...i,...i", local, local)) - radius

    return field


def torus(centre: Sequence[float], radius: float, tube: float, axis: int) -> Field:
    """Torus around a coordinate axis; exact."""
    centre = np.asarray(centre, float)
    others = [other for other in range(3) if other != axis]

    def field(points: np.ndarray) -> np.ndarray:
        local = points - centre
        ring = np.hypot(local[..., others[0]], local[..., others[1]]) - radius
        return np.hypot(ring, local[..., axis]) - tube

    return field


def half_space(point: Sequence[float], normal: Sequence[float]) -> Field:
    """Everything behind a plane; ``normal`` points outwards."""
    point, normal = np.asarray(point, float), np.asarray(normal, float)
    normal = normal / np.linalg.norm(normal)
    return lambda points: (points - point) @ normal


def _smooth_minimum(a: np.ndarray, b: np.ndarray, radius: float) -> np.ndarray:
    """Polynomial smooth minimum (Quilez): C1, and min(a, b) where they differ by more than ``radius``."""
    if radius <= 0:
        return np.minimum(a, b)
    overlap = np.maximum(radius - np.abs(a - b), 0) / radius
    return np.minimum(a, b) - overlap**2 * radius / 4


def union(*fields: Field, radius: float = 0.0) -> Field:
    """Union, its crease rounded over ``radius`` mm."""

    def field(points: np.ndarray) -> np.ndarray:
        value = fields[0](points)
        for other in fields[1:]:
            value = _smooth_minimum(value, other(points), radius)
        return value

    return field


def intersection(*fields: Field, radius: float = 0.0) -> Field:
    """Intersection, its edge rounded over ``radius`` mm."""

    def field(points: np.ndarray) -> np.ndarray:
        value = -fields[0](points)
        for other in fields[1:]:
            value = _smooth_minimum(value, -other(points), radius)
        return -value

    return field


def subtraction(body: Field, *cuts: Field, radius: float = 0.0) -> Field:
    """``body`` without the ``cuts``, the edges rounded over ``radius`` mm."""

    def field(points: np.ndarray) -> np.ndarray:
        value = -body(points)
        for cut in cuts:
            value = _smooth_minimum(value, cut(points), radius)
        return -value

    return field


def warped(field: Field, rng: np.random.Generator, amplitude: float, wavelength: float) -> Field:
    """Bend space by six random sine waves, so that an organ looks grown and not turned on a lathe.

    ``amplitude`` mm is the standard deviation of the displacement in each direction.
    """
    waves = rng.normal(size=(6, 3))
    waves *= 2 * np.pi / wavelength / np.linalg.norm(waves, axis=1, keepdims=True)
    phases = rng.uniform(0, 2 * np.pi, 6)
    pushes = rng.normal(size=(6, 3)) * amplitude / np.sqrt(3)

    def bent(points: np.ndarray) -> np.ndarray:
        return field(points + np.sin(points @ waves.T + phases) @ pushes)

    return bent


def _lattice(origin: np.ndarray, step: np.ndarray, shape: Sequence[int]) -> np.ndarray:
    axes = [start + size * np.arange(count) for start, size, count in zip(origin, step, shape, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1)


def enlarge(values: np.ndarray, factor: Sequence[int], shape: Sequence[int]) -> np.ndarray:
    """Interpolate linearly between lattice points, ``factor`` steps for one, up to ``shape`` points."""
    for axis in range(3):
        where = np.arange(shape[axis]) / factor[axis]
        low = np.minimum(where.astype(int), values.shape[axis] - 1)
        high = np.minimum(low + 1, values.shape[axis] - 1)
        share = (where - low).astype(np.float32).reshape([-1 if a == axis else 1 for a in range(3)])
        values = values.take(low, axis) * (1 - share) + values.take(high, axis) * share
    return values


def sample_field(
    field: Field,
    origin: np.ndarray,
    step: np.ndarray,
    shape: Sequence[int],
    coarse: float = 3.0,
    exact: bool = True,
) -> np.ndarray:
    """Evaluate a field on a lattice: exactly near the surface, interpolated away from it.

    Parameters
    ----------
    field : Field
        Signed distance, near enough.
    origin, step : (3,) float
        First lattice point and signed spacing, mm.
    shape : (3,) int
        Lattice points along each axis.
    coarse : float
        Spacing in mm of the lattice that finds the surface.
    exact : bool
        Evaluate near the surface; otherwise interpolate there too.

    Returns
    -------
    (a, b, c) float32
        Values; only their sign and those well within ``coarse`` mm of zero are meaningful.
    """
    origin, step, shape = np.asarray(origin, float), np.asarray(step, float), np.asarray(shape)
    factor = np.maximum(np.floor(coarse / np.abs(step)), 1).astype(int)
    rough = _lattice(origin, step * factor, -(-(shape - 1) // factor) + 1)
    if not exact:
        return enlarge(field(rough.astype(np.float32)).astype(np.float32), factor, shape)
    values = enlarge(field(rough).astype(np.float32), factor, shape)
    if (factor > 1).any():
        near = np.argwhere(np.abs(values) < 0.8 * coarse)
        values[tuple(near.T)] = field(origin + step * near)
    return values


def mesh_field(field: Field, low: np.ndarray, high: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate a zero set: marching cubes, then Newton steps that put every vertex on it.

    Parameters
    ----------
    field : Field
        Smooth near its zero set, which lies strictly between ``low`` and ``high``.
    low, high : (3,) float
        Corners of the box, mm.
    step : float
        Edge of a cube, mm.

    Returns
    -------
    vertices : (V, 3) float64
        World mm.
    faces : (F, 3) int64
        Outward normals by the right-hand rule.
    """
    low, high = np.asarray(low, float), np.asarray(high, float)
    shape = np.ceil((high - low) / step).astype(int) + 1
    values = sample_field(field, low, np.full(3, step), shape, coarse=2 * step)
    vertices, faces, _, _ = marching_cubes(values, 0.0, spacing=(step,) * 3, gradient_direction="descent")
    vertices = vertices.astype(float) + low
    offsets = np.eye(3) * 1e-3
    for _ in range(8):
        value = field(vertices)
        if np.abs(value).max() < PROJECTION_MM:
            break
        slope = np.stack([field(vertices + o) - field(vertices - o) for o in offsets], -1) / 2e-3
        move = (value / np.maximum(np.einsum("ij,ij->i", slope, slope), 0.1))[:, None] * slope
        length = np.linalg.norm(move, axis=1, keepdims=True)
        vertices -= move * np.minimum(1, 0.3 * step / np.maximum(length, 1e-12))
    return vertices, faces.astype(np.int64)
