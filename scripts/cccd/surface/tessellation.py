"""A patch as a closed triangle mesh of any density."""

from __future__ import annotations

from typing import Any, cast

import manifold3d
import numpy as np

from cccd.geometry.arrays import FloatArray, IntArray, offsets_of
from cccd.geometry.bsplines import Patch
from cccd.geometry.mesh import Mesh

__all__ = ["SAME_POINT_MM", "tessellate"]

#: Triangles per turn of the thinnest tube.
FEWEST_SIDES = 8
#: Control points of an end nearer to each other than this, in mm, are a pole.
SAME_POINT_MM = 1e-9


def tessellate(patch: Patch, edge: float) -> Mesh:
    """Cut one patch into a closed triangle mesh, oriented outwards whatever the patch's sign.

    Parameters
    ----------
    patch : Patch
        Closed in u; its ends in v are poles, or plane curves that get planar caps.
    edge : float
        Edge length in mm that the triangles aim at.
    """
    v = _row_parameters(patch, edge)
    nets = np.tensordot(patch.basis_v(v), patch.homogeneous, (1, 1))
    low, high = (_is_pole(patch, end) for end in (0, -1))
    u = _parameters_around(patch, nets, edge, low, high)
    starts = offsets_of([len(row) for row in u])
    vertices = patch.evaluate(np.concatenate(u), np.repeat(v, np.diff(starts)))
    faces = [_band(u[r], u[r + 1], starts[r], starts[r + 1]) for r in range(len(v) - 1)]
    normal = _stack_direction(patch)
    if not low:
        faces.append(_planar_cap(vertices[: starts[1]], normal)[:, ::-1])
    if not high:
        faces.append(_planar_cap(vertices[starts[-2] :], normal) + starts[-2])
    return Mesh(vertices, np.concatenate(faces)).outwards()


def _is_pole(patch: Patch, end: int) -> bool:
    """Whether the patch closes on a point at its first (0) or last (-1) row of control points."""
    return bool(np.ptp(patch.control_points[:, end], axis=0).max() < SAME_POINT_MM)


def _row_parameters(patch: Patch, edge: float) -> FloatArray:
    """Parameters v (R,) of the mesh's rows, at equal steps along the surface."""
    rows = patch.control_points.shape[1]
    v = np.linspace(*_range(patch.knots_v, patch.degree_v), 8 * rows)
    u = np.linspace(*_range(patch.knots_u, patch.degree_u), 17)[:-1]
    bu, bv = patch.basis_u(u), patch.basis_v(v)
    points = np.einsum("pu,qv,uvc->qpc", bu, bv, patch.control_points, optimize=True)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=2)
    length = np.concatenate([[0.0], np.cumsum(np.sqrt(np.mean(steps**2, axis=1)))])
    count = max(4, int(np.ceil(length[-1] / edge)))
    return np.interp(np.linspace(0.0, float(length[-1]), count + 1), length, v)


def _range(knots: FloatArray, degree: int) -> tuple[float, float]:
    """First and last parameter of a spline."""
    return float(knots[degree]), float(knots[-degree - 1])


def _parameters_around(
    patch: Patch, nets: FloatArray, edge: float, low_pole: bool, high_pole: bool
) -> list[FloatArray]:
    """Parameters u of every row's vertices, from zero, at equal steps around; one where the row is a pole.

    ``nets`` (R, nu, 4) are the rows' control points in homogeneous coordinates.
    """
    fine = int(4 * nets.shape[1])
    dense = patch.basis_u(np.arange(fine) / fine) @ nets
    dense = dense[..., :3] / dense[..., 3:]
    steps = np.linalg.norm(np.roll(dense, -1, axis=1) - dense, axis=2)
    length = np.concatenate([np.zeros((len(nets), 1)), np.cumsum(steps, axis=1)], axis=1)
    sides = np.maximum(FEWEST_SIDES, np.ceil(length[:, -1] / edge)).astype(np.int64)
    sides[0] = 1 if low_pole else sides[0]
    sides[-1] = 1 if high_pole else sides[-1]
    grid = np.arange(fine + 1) / fine
    shares = [np.arange(int(count), dtype=float) / int(count) for count in sides]
    return [
        np.interp(share * float(total[-1]), total, grid) for share, total in zip(shares, length, strict=True)
    ]


def _band(a: FloatArray, b: FloatArray, first_a: int, first_b: int) -> IntArray:
    """Triangles between two rows with ascending parameters a (n,) and b (m,), both from zero.

    Each side of either row makes one triangle with the vertex of the other row that is current when
    the side's middle is passed.
    """
    n, m = len(a), len(b)
    if n == 1 or m == 1:
        ring, first, apex = (b, first_b, first_a) if n == 1 else (a, first_a, first_b)
        here = first + np.arange(len(ring))
        after = first + (np.arange(len(ring)) + 1) % len(ring)
        order = (after, here) if n == 1 else (here, after)
        return np.column_stack([*order, np.full(len(ring), apex)])
    middle_a = (a + np.append(a[1:], 1.0)) / 2
    middle_b = (b + np.append(b[1:], 1.0)) / 2
    current_b = np.searchsorted(middle_b, middle_a)
    current_a = np.searchsorted(middle_a, middle_b, side="right")
    lower = np.column_stack(
        [first_a + np.arange(n), first_a + (np.arange(n) + 1) % n, first_b + current_b % m]
    )
    upper = np.column_stack(
        [first_b + (np.arange(m) + 1) % m, first_b + np.arange(m), first_a + current_a % n]
    )
    return np.concatenate([lower, upper])


def _stack_direction(patch: Patch) -> FloatArray:
    """Return the unit vector (3,) across the plane rings, from the low to the high end."""
    ring = patch.control_points[:, patch.control_points.shape[1] // 2]
    _, _, axes = np.linalg.svd(ring - ring.mean(axis=0))
    run = patch.control_points[:, -1].mean(axis=0) - patch.control_points[:, 0].mean(axis=0)
    return axes[2] * (np.sign(axes[2] @ run) or 1.0)


def _planar_cap(ring: FloatArray, normal: FloatArray) -> IntArray:
    """Triangles (n - 2, 3) that fill a plane ring (n, 3), turning like the ring does."""
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    x = np.cross(helper, normal)
    x /= np.linalg.norm(x)
    flat = np.column_stack([ring @ x, ring @ np.cross(normal, x)])
    a, b = flat, np.roll(flat, -1, axis=0)
    turned = np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) < 0
    order = np.arange(len(ring))[::-1] if turned else np.arange(len(ring))
    triangulate = cast(Any, manifold3d).triangulate  # its stubs leave the arrays' types open
    triangles = order[np.asarray(triangulate([flat[order]], allow_convex=False), np.int64)]
    return triangles[:, ::-1] if turned else triangles
