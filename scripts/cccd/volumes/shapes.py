"""Implicit shapes: organs as zero sets of smooth functions of world mm (RAS).

A field maps points (3, ...) to values (...): negative inside, near the signed distance in mm by the surface.
Coordinates come first so that each is contiguous, and fields keep the points' precision: float32 is plenty
for a scan, float64 puts the vertices of a true surface onto it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from cccd.geometry.grid import ScalarGrid
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

#: Newton steps that put vertices onto a zero set, and the half-width of their central differences.
_NEWTON_STEPS, _SHIFT_MM = 8, 1e-3
_SHIFTS = np.eye(3)[:, :, None] * _SHIFT_MM

#: Points evaluated at once, few enough for the processor's cache.
_CHUNK = 1 << 15


def _column(values: Sequence[float], like: np.ndarray) -> np.ndarray:
    """Three numbers as a column that broadcasts against points (3, ...), in their precision."""
    return np.asarray(values, like.dtype).reshape(3, *[1] * (like.ndim - 1))


def _length(vectors: np.ndarray) -> np.ndarray:
    x, y, z = vectors
    return np.sqrt(x * x + y * y + z * z)


def ellipsoid(centre: Sequence[float], radii: Sequence[float], turn: np.ndarray | None = None) -> Field:
    """Ellipsoid with its axes turned by the rotation matrix ``turn``; a sphere is exact.

    Distance by the first-order bound of Quilez: ``k0 (k0 - 1) / k1``.
    """

    def field(points: np.ndarray) -> np.ndarray:
        local = points - _column(centre, points)
        if turn is not None:
            local = np.tensordot(turn.T.astype(points.dtype), local, 1)
        local /= _column(radii, points)
        k0 = _length(local)
        local /= _column(radii, points)
        k1 = _length(local)
        return np.where(k0 > 1e-6, k0 * (k0 - 1) / np.maximum(k1, 1e-12), -points.dtype.type(min(radii)))

    return field


def capsule(start: Sequence[float], end: Sequence[float], radius: float) -> Field:
    """All points within ``radius`` of a line segment; exact."""
    along = np.subtract(end, start).astype(float)
    unit = along / (along @ along)

    def field(points: np.ndarray) -> np.ndarray:
        local = points - _column(start, points)
        share = np.clip(np.tensordot(unit.astype(points.dtype), local, 1), 0, 1)
        return _length(local - _column(along, points) * share) - points.dtype.type(radius)

    return field


def torus(centre: Sequence[float], radius: float, tube: float, axis: int) -> Field:
    """Torus around a coordinate axis; exact."""
    first, second = (other for other in range(3) if other != axis)

    def field(points: np.ndarray) -> np.ndarray:
        local = points - _column(centre, points)
        ring = np.hypot(local[first], local[second]) - points.dtype.type(radius)
        return np.hypot(ring, local[axis]) - points.dtype.type(tube)

    return field


def half_space(point: Sequence[float], normal: Sequence[float]) -> Field:
    """Everything behind a plane; ``normal`` points outwards."""
    unit = np.asarray(normal, float) / np.linalg.norm(normal)

    def field(points: np.ndarray) -> np.ndarray:
        return np.tensordot(unit.astype(points.dtype), points - _column(point, points), 1)

    return field


def _smooth_minimum(a: np.ndarray, b: np.ndarray, radius: float) -> np.ndarray:
    """Polynomial smooth minimum (Quilez): C1, and min(a, b) where they differ by more than ``radius``."""
    least = np.minimum(a, b)
    if radius <= 0:
        return least
    overlap = np.maximum(a.dtype.type(radius) - np.abs(a - b), 0)
    return least - overlap * overlap * a.dtype.type(0.25 / radius)


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
        flat = points.reshape(3, -1)
        sines = np.sin(waves.astype(flat.dtype) @ flat + phases.astype(flat.dtype)[:, None])
        return field((flat + pushes.T.astype(flat.dtype) @ sines).reshape(points.shape))

    return bent


def _evaluate(field: Field, origin: np.ndarray, step: np.ndarray, index: np.ndarray) -> np.ndarray:
    """Field values (N,) float32 at lattice points ``index`` (3, N)."""
    values = np.empty(index.shape[1], np.float32)
    for start in range(0, len(values), _CHUNK):
        part = index[:, start : start + _CHUNK].astype(np.float32)
        points = part * step.astype(np.float32)[:, None] + origin.astype(np.float32)[:, None]
        values[start : start + _CHUNK] = field(points)
    return values


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
    rough_shape = tuple(-(-(shape - 1) // factor) + 1)
    rough = _evaluate(field, origin, step * factor, np.indices(rough_shape).reshape(3, -1))
    values = enlarge(rough.reshape(rough_shape), factor, shape)
    if exact and (factor > 1).any():
        near = np.nonzero(np.abs(values) < 0.8 * coarse)
        values[near] = _evaluate(field, origin, step, np.stack(near))
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
    mesh = ScalarGrid.uniform(values, low, step).isosurface(0.0)
    vertices = mesh.vertices
    loose = np.arange(len(vertices))
    for _ in range(_NEWTON_STEPS):
        points = vertices[loose].T
        value = field(points)
        far = np.abs(value) > PROJECTION_MM
        if not far.any():
            break
        loose, points, value = loose[far], points[:, far], value[far]
        slope = np.stack([field(points + shift) - field(points - shift) for shift in _SHIFTS]) / (
            2 * _SHIFT_MM
        )
        move = slope * (value / np.maximum((slope**2).sum(axis=0), 0.1))
        # a vertex that strays farther than a part of its cube would fold the mesh
        move *= np.minimum(1, 0.3 * step / np.maximum(_length(move), 1e-12))
        vertices[loose] -= move.T
    return vertices, mesh.faces
