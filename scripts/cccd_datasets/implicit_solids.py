"""Implicit solids: organs as the insides of zero sets of smooth functions of world mm (RAS).

An implicit function maps points (3, ...) to values (...): negative inside, near the surface close to the
signed distance in mm. Coordinates come first so that each is contiguous, and the values keep the points'
precision: float32 is enough for a scan, the vertices of a true surface need float64.

The primitives and the smooth union, intersection and subtraction are those of I. Quilez,
https://iquilezles.org/articles/distfunctions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from cccd.geometry.arrays import AnyArray
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh

#: Vertices of a phantom's true surface lie this near to its zero set.
PROJECTION_MM = 1e-4

#: Maps points (3, ...) in world mm to values (...) of the same precision, negative inside.
ImplicitFunction = Callable[[AnyArray], AnyArray]

#: What fills a solid, and its grey value (HU for CT).
Tissue = tuple[ImplicitFunction, float]

#: Newton steps that put vertices onto a zero set, and the half-width of their central differences.
_NEWTON_STEPS, _SHIFT_MM = 8, 1e-3
_SHIFTS = np.eye(3)[:, :, None] * _SHIFT_MM

#: Points evaluated at once, few enough for the processor's cache.
_CHUNK = 1 << 15


def _column(values: npt.ArrayLike, like: AnyArray) -> AnyArray:
    """Three numbers as a column that broadcasts against points (3, ...), in their precision."""
    return np.asarray(values, like.dtype).reshape(3, *[1] * (like.ndim - 1))


def _length(vectors: AnyArray) -> AnyArray:
    """Lengths (...) of vectors (3, ...)."""
    x, y, z = vectors
    return np.sqrt(x * x + y * y + z * z)


def ellipsoid(
    centre: npt.ArrayLike, radii: npt.ArrayLike, rotation: AnyArray | None = None
) -> ImplicitFunction:
    """Ellipsoid; the distance is a first-order bound (Quilez: ``k0 (k0 - 1) / k1``), exact for a sphere.

    Parameters
    ----------
    centre, radii : (3,) float
        Centre and semi-axes, mm.
    rotation : (3, 3) float64, optional
        Rotation matrix that turns the semi-axes.

    Examples
    --------
    >>> float(ellipsoid((0, 0, 0), (2, 2, 2))(np.array([5.0, 0, 0])))
    3.0
    """

    def distance(points: AnyArray) -> AnyArray:
        local = points - _column(centre, points)
        if rotation is not None:
            local = np.tensordot(rotation.T.astype(points.dtype), local, 1)
        local /= _column(radii, points)
        k0 = _length(local)
        local /= _column(radii, points)
        k1 = _length(local)
        return np.where(k0 > 1e-6, k0 * (k0 - 1) / np.maximum(k1, 1e-12), -points.dtype.type(np.min(radii)))

    return distance


def capsule(start: npt.ArrayLike, end: npt.ArrayLike, radius: float) -> ImplicitFunction:
    """All points within ``radius`` mm of the segment from ``start`` to ``end``, (3,) mm; exact distance."""
    along = np.asarray(np.subtract(end, start), float)
    unit = along / (along @ along)

    def distance(points: AnyArray) -> AnyArray:
        local = points - _column(start, points)
        share = np.clip(np.tensordot(unit.astype(points.dtype), local, 1), 0, 1)
        return _length(local - _column(along, points) * share) - points.dtype.type(radius)

    return distance


def torus(centre: npt.ArrayLike, radius: float, tube: float, axis: int) -> ImplicitFunction:
    """Torus with exact distance.

    Parameters
    ----------
    centre : (3,) float
        Centre, mm.
    radius, tube : float
        Radius of the circle in the tube's middle and of the tube, mm.
    axis : int
        The coordinate axis around which it turns: 0, 1 or 2.
    """
    first, second = (other for other in range(3) if other != axis)

    def distance(points: AnyArray) -> AnyArray:
        local = points - _column(centre, points)
        ring = np.hypot(local[first], local[second]) - points.dtype.type(radius)
        return np.hypot(ring, local[axis]) - points.dtype.type(tube)

    return distance


def half_space(point: npt.ArrayLike, normal: npt.ArrayLike) -> ImplicitFunction:
    """Everything behind the plane through ``point`` (3,) mm; ``normal`` (3,) points outwards."""
    unit = np.asarray(normal, float) / np.linalg.norm(normal)

    def distance(points: AnyArray) -> AnyArray:
        return np.tensordot(unit.astype(points.dtype), points - _column(point, points), 1)

    return distance


def _smooth_minimum(a: AnyArray, b: AnyArray, radius: float) -> AnyArray:
    """Polynomial smooth minimum (Quilez): C1, and min(a, b) where they differ by more than ``radius``."""
    least = np.minimum(a, b)
    if radius <= 0:
        return least
    overlap = np.maximum(a.dtype.type(radius) - np.abs(a - b), 0)
    return least - overlap * overlap * a.dtype.type(0.25 / radius)


def union(*solids: ImplicitFunction, radius: float = 0.0) -> ImplicitFunction:
    """Union, its crease rounded over ``radius`` mm.

    Examples
    --------
    >>> both = union(ellipsoid((0, 0, 0), (1, 1, 1)), ellipsoid((5, 0, 0), (1, 1, 1)))
    >>> both(np.array([[0.0, 5.0, 2.5], [0, 0, 0], [0, 0, 0]])).tolist()
    [-1.0, -1.0, 1.5]
    """

    def distance(points: AnyArray) -> AnyArray:
        value = solids[0](points)
        for other in solids[1:]:
            value = _smooth_minimum(value, other(points), radius)
        return value

    return distance


def intersection(*solids: ImplicitFunction, radius: float = 0.0) -> ImplicitFunction:
    """Intersection, its edge rounded over ``radius`` mm."""

    def distance(points: AnyArray) -> AnyArray:
        value = -solids[0](points)
        for other in solids[1:]:
            value = _smooth_minimum(value, -other(points), radius)
        return -value

    return distance


def subtraction(body: ImplicitFunction, *cuts: ImplicitFunction, radius: float = 0.0) -> ImplicitFunction:
    """``body`` without the ``cuts``, the edges rounded over ``radius`` mm."""

    def distance(points: AnyArray) -> AnyArray:
        value = -body(points)
        for cut in cuts:
            value = _smooth_minimum(value, cut(points), radius)
        return -value

    return distance


def warped(
    solid: ImplicitFunction, rng: np.random.Generator, amplitude: float, wavelength: float
) -> ImplicitFunction:
    """Displace a solid smoothly by six random sine waves, which breaks its symmetries.

    Parameters
    ----------
    solid : ImplicitFunction
        What to displace.
    rng : numpy.random.Generator
        Draws directions and phases of the waves.
    amplitude : float
        Standard deviation of the displacement in each direction, mm.
    wavelength : float
        Length of every wave, mm.
    """
    waves = rng.normal(size=(6, 3))
    waves *= 2 * np.pi / wavelength / np.linalg.norm(waves, axis=1, keepdims=True)
    phases = rng.uniform(0, 2 * np.pi, 6)
    displacements = rng.normal(size=(6, 3)) * amplitude / np.sqrt(3)

    def distance(points: AnyArray) -> AnyArray:
        flat = points.reshape(3, -1)
        sines = np.sin(waves.astype(flat.dtype) @ flat + phases.astype(flat.dtype)[:, None])
        return solid((flat + displacements.T.astype(flat.dtype) @ sines).reshape(points.shape))

    return distance


def _evaluate(solid: ImplicitFunction, origin: AnyArray, step: AnyArray, index: AnyArray) -> AnyArray:
    """Values (N,) float32 at lattice points ``index`` (3, N)."""
    values = np.empty(index.shape[1], np.float32)
    for start in range(0, len(values), _CHUNK):
        part = index[:, start : start + _CHUNK].astype(np.float32)
        points = part * step.astype(np.float32)[:, None] + origin.astype(np.float32)[:, None]
        values[start : start + _CHUNK] = solid(points)
    return values


def interpolate_lattice(values: AnyArray, factor: AnyArray, shape: npt.ArrayLike) -> AnyArray:
    """Interpolate linearly between the points of a lattice.

    Parameters
    ----------
    values : (a, b, c) float32
        Values at every ``factor``-th point.
    factor : (3,) int
        Steps of the fine lattice in one of the coarse lattice.
    shape : (3,) int
        Points of the fine lattice.

    Returns
    -------
    (shape) float32
        Beyond the last coarse point its value goes on.

    Examples
    --------
    >>> ends = np.array([0.0, 3.0]).reshape(2, 1, 1)
    >>> interpolate_lattice(ends, np.array([2, 1, 1]), (3, 1, 1)).ravel().tolist()
    [0.0, 1.5, 3.0]
    """
    shape = np.asarray(shape)
    for axis in range(3):
        where = np.arange(shape[axis]) / factor[axis]
        low = np.minimum(where.astype(int), values.shape[axis] - 1)
        high = np.minimum(low + 1, values.shape[axis] - 1)
        share = (where - low).astype(np.float32).reshape([-1 if a == axis else 1 for a in range(3)])
        values = values.take(low, axis) * (1 - share) + values.take(high, axis) * share
    return values


def sample_lattice(
    solid: ImplicitFunction,
    origin: npt.ArrayLike,
    step: npt.ArrayLike,
    shape: npt.ArrayLike,
    coarse: float = 3.0,
    exact: bool = True,
) -> AnyArray:
    """Evaluate a solid on a lattice: exactly near the surface, interpolated away from it.

    Parameters
    ----------
    solid : ImplicitFunction
        Near the signed distance.
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
    rough = _evaluate(solid, origin, step * factor, np.indices(rough_shape).reshape(3, -1))
    values = interpolate_lattice(rough.reshape(rough_shape), factor, shape)
    if exact and (factor > 1).any():
        near = np.nonzero(np.abs(values) < 0.8 * coarse)
        values[near] = _evaluate(solid, origin, step, np.stack(near))
    return values


def paint_tissues(
    image: AnyArray, tissues: Sequence[Tissue], origin: npt.ArrayLike, step: npt.ArrayLike
) -> AnyArray:
    """Paint tissues that cover one another in their order, each with an edge one pixel wide.

    Parameters
    ----------
    image : (a, b, c) float32
        What they are painted on; it changes, and is returned.
    tissues : sequence of Tissue
    origin, step : (3,) float
        The image's first voxel and signed spacing, mm.
    """
    step = np.asarray(step, float)
    for solid, value in tissues:
        depths = sample_lattice(solid, origin, step, image.shape, exact=False)
        share = np.clip(0.5 - depths / abs(step[0]), 0, 1)
        image += share * (np.float32(value) - image)
    return image


def mesh_zero_set(
    solid: ImplicitFunction, bbox_min: npt.ArrayLike, bbox_max: npt.ArrayLike, step: float
) -> Mesh:
    """Triangulate a zero set: marching cubes, then Newton steps that move every vertex onto it.

    Parameters
    ----------
    solid : ImplicitFunction
        Smooth near its zero set, which lies strictly inside the box.
    bbox_min, bbox_max : (3,) float
        The box, mm.
    step : float
        Edge of a cube, mm.

    Returns
    -------
    Mesh
        Outwards, in world mm; each vertex within `PROJECTION_MM` of the zero set where Newton's steps
        converge.

    See Also
    --------
    sample_lattice : The values between which marching cubes interpolate.
    """
    bbox_min, bbox_max = np.asarray(bbox_min, float), np.asarray(bbox_max, float)
    shape = np.ceil((bbox_max - bbox_min) / step).astype(int) + 1
    values = sample_lattice(solid, bbox_min, np.full(3, step), shape, coarse=2 * step)
    mesh = ScalarGrid.uniform(values, bbox_min, step).isosurface(0.0)
    return Mesh(_project(solid, mesh.vertices, step), mesh.faces)


def _project(solid: ImplicitFunction, vertices: AnyArray, step: float) -> AnyArray:
    """Move vertices (V, 3) of cubes of edge ``step`` onto the zero set by Newton's method."""
    vertices = vertices.copy()
    loose = np.arange(len(vertices))
    for _ in range(_NEWTON_STEPS):
        points = vertices[loose].T
        value = solid(points)
        far = np.abs(value) > PROJECTION_MM
        if not far.any():
            break
        loose, points, value = loose[far], points[:, far], value[far]
        slope = np.stack([solid(points + shift) - solid(points - shift) for shift in _SHIFTS]) / (
            2 * _SHIFT_MM
        )
        move = slope * (value / np.maximum((slope**2).sum(axis=0), 0.1))
        # a vertex that moves by more than a part of its cube would fold the mesh
        move *= np.minimum(1, 0.3 * step / np.maximum(_length(move), 1e-12))
        vertices[loose] -= move.T
    return vertices
