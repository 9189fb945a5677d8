"""Patches moved outwards, and their triangles at any density."""

from __future__ import annotations

from dataclasses import replace

import manifold3d
import numpy as np

from cccd.geometry.bsplines import Patch, greville
from cccd.geometry.mesh import Mesh

__all__ = ["swollen", "tessellate"]

#: Triangles per turn of the thinnest tube.
FEWEST_SIDES = 8


def swollen(patch: Patch, amount: float, axis: np.ndarray) -> Patch:
    """Move a patch outwards, or with a negative amount inwards, by a little.

    Control points move by ``amount`` mm times the part, square to ``axis`` (3,), of the unit normal at their
    Greville parameters: plane sections stay plane, level caps and lids where they are.
    """
    u = greville(patch.knots_u, patch.degree_u, patch.weights.shape[0])
    v = greville(patch.knots_v, patch.degree_v, patch.weights.shape[1])
    bu, slope_u = (patch.basis_u(u, order) for order in (0, 1))
    bv, slope_v = (patch.basis_v(v, order) for order in (0, 1))
    homogeneous = patch.homogeneous
    point, along_u, along_v = (
        np.einsum("au,bv,uvc->abc", around, along, homogeneous, optimize=True).reshape(-1, 4)
        for around, along in ((bu, bv), (slope_u, bv), (bu, slope_v))
    )
    # The quotient rule up to a factor: only the direction counts.
    su, sv = (point[:, 3:] * d[:, :3] - d[:, 3:] * point[:, :3] for d in (along_u, along_v))
    normal = np.cross(su, sv)
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, size, out=np.zeros_like(normal), where=size > 1e-9)
    normal -= np.outer(normal @ axis, axis)
    normal = normal.reshape(patch.control_points.shape)
    outwards = patch.control_points - patch.control_points.mean(axis=0)
    side = np.sign(np.sum(normal * outwards)) or 1.0
    return replace(patch, control_points=patch.control_points + side * amount * normal)


def tessellate(patch: Patch, edge: float) -> tuple[np.ndarray, np.ndarray]:
    """Cut one patch into a closed triangle mesh.

    Parameters
    ----------
    patch : Patch
        Closed in u; its ends in v are poles, or plane curves that get flat lids.
    edge : float
        Edge length in mm that the triangles aim at.

    Returns
    -------
    vertices : (V, 3) float64
        mm RAS.
    faces : (F, 3) int64
        Counter-clockwise seen from outside the tube, whatever its sign.
    """
    rows = _rows(patch, edge)
    low = np.ptp(patch.control_points[:, 0], axis=0).max() < 1e-9
    high = np.ptp(patch.control_points[:, -1], axis=0).max() < 1e-9
    across = patch.basis_v(rows)
    homogeneous = patch.homogeneous
    nets = np.einsum("rv,uvc->ruc", across, homogeneous)
    fine = 4 * len(patch.control_points)
    bu = patch.basis_u(np.arange(fine) / fine)
    dense = bu @ nets
    dense = dense[..., :3] / dense[..., 3:]
    steps = np.linalg.norm(np.roll(dense, -1, axis=1) - dense, axis=2)
    length = np.concatenate([np.zeros((len(rows), 1)), np.cumsum(steps, axis=1)], axis=1)
    sides = np.maximum(FEWEST_SIDES, np.ceil(length[:, -1] / edge)).astype(np.int64)
    sides[0] = 1 if low else sides[0]
    sides[-1] = 1 if high else sides[-1]
    grid = np.arange(fine + 1) / fine
    u = [np.interp(np.arange(n) / n * total[-1], total, grid) for n, total in zip(sides, length, strict=True)]
    starts = np.concatenate([[0], np.cumsum(sides)])
    row_of = np.repeat(np.arange(len(rows)), sides)
    bu = patch.basis_u(np.concatenate(u))
    vertices = np.einsum("pu,puc->pc", bu, nets[row_of])
    vertices = vertices[:, :3] / vertices[:, 3:]
    faces = [_zip(u[r], u[r + 1], starts[r], starts[r + 1]) for r in range(len(rows) - 1)]
    normal = _stack_direction(patch)
    if not low:
        faces.append(_lid(vertices[: starts[1]], normal)[:, ::-1])
    if not high:
        faces.append(_lid(vertices[starts[-2] :], normal) + starts[-2])
    faces = np.concatenate(faces)
    if Mesh(vertices, faces).volume < 0:
        faces = faces[:, ::-1]
    return vertices, np.ascontiguousarray(faces)


def _rows(patch: Patch, edge: float) -> np.ndarray:
    """Parameters v of the mesh's rows, at equal steps along the surface."""
    low, high = patch.knots_v[patch.degree_v], patch.knots_v[-patch.degree_v - 1]
    v = np.linspace(low, high, 8 * patch.control_points.shape[1])
    u = np.linspace(patch.knots_u[patch.degree_u], patch.knots_u[-patch.degree_u - 1], 17)[:-1]
    bu = patch.basis_u(u)
    bv = patch.basis_v(v)
    points = np.einsum("pu,qv,uvc->qpc", bu, bv, patch.control_points, optimize=True)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=2)
    length = np.concatenate([[0.0], np.cumsum(np.sqrt(np.mean(steps**2, axis=1)))])
    count = max(4, int(np.ceil(length[-1] / edge)))
    return np.interp(np.linspace(0, length[-1], count + 1), length, v)


def _zip(a: np.ndarray, b: np.ndarray, first_a: int, first_b: int) -> np.ndarray:
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


def _stack_direction(patch: Patch) -> np.ndarray:
    """Give the unit vector across the plane rings, from the low to the high end."""
    ring = patch.control_points[:, patch.control_points.shape[1] // 2]
    _, _, axes = np.linalg.svd(ring - ring.mean(axis=0))
    run = patch.control_points[:, -1].mean(axis=0) - patch.control_points[:, 0].mean(axis=0)
    return axes[2] * (np.sign(axes[2] @ run) or 1.0)


def _lid(ring: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Triangles (n - 2, 3) that fill a plane ring, turning like the ring does."""
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    x = np.cross(helper, normal)
    x /= np.linalg.norm(x)
    flat = np.column_stack([ring @ x, ring @ np.cross(normal, x)])
    a, b = flat, np.roll(flat, -1, axis=0)
    turned = np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) < 0
    order = np.arange(len(ring))[::-1] if turned else np.arange(len(ring))
    triangles = order[np.asarray(manifold3d.triangulate([flat[order]], allow_convex=False), np.int64)]
    return triangles[:, ::-1] if turned else triangles
