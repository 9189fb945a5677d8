"""A patch at any parameter, eq. (10): points, normals, curvature; and its triangles at any density."""

from __future__ import annotations

from dataclasses import dataclass, replace

import manifold3d
import numpy as np

from cccd.containers import Patch
from cccd.surface.bsplines import basis

__all__ = ["SurfacePoints", "differential_geometry", "evaluate", "swollen", "tessellate"]

#: Triangles per turn of the thinnest tube.
FEWEST_SIDES = 8


@dataclass(frozen=True)
class SurfacePoints:
    """Points of a surface and their differential geometry; curvature in 1/mm.

    Where the surface closes on a pole one derivative vanishes: normals and curvature are NaN there.
    """

    points: np.ndarray  # (P, 3) mm RAS
    normals: np.ndarray  # (P, 3) unit length, outwards for a solid
    gaussian: np.ndarray  # (P,) 1/mm^2
    mean: np.ndarray  # (P,) 1/mm, positive where the solid is convex


def evaluate(patch: Patch, u: np.ndarray, v: np.ndarray, derivatives: tuple[int, int] = (0, 0)) -> np.ndarray:
    """Points (P, 3) of a patch, or of one of its partial derivatives, at parameters u (P,) and v (P,).

    Rational derivatives follow the quotient rule up to second order.
    """
    du, dv = derivatives
    if du + dv > 2:
        raise ValueError("derivatives are available up to second order")
    homogeneous = np.dstack([patch.control_points * patch.weights[..., None], patch.weights])

    def sums(a: int, b: int) -> tuple[np.ndarray, np.ndarray]:
        bu = basis(u, patch.knots_u, patch.degree_u, patch.closed_u, a)
        bv = basis(v, patch.knots_v, patch.degree_v, patch.closed_v, b)
        values = np.einsum("pu,pv,uvc->pc", bu, bv, homogeneous, optimize=True)
        return values[:, :3], values[:, 3:]

    top, w = sums(0, 0)
    point = top / w
    if (du, dv) == (0, 0):
        return point
    first = {}
    for order in {(1, 0), (0, 1)}:
        top, dw = sums(*order)
        first[order] = ((top - dw * point) / w, dw)
    if du + dv == 1:
        return first[du, dv][0]
    top, ddw = sums(du, dv)
    if (du, dv) == (1, 1):
        (su, wu), (sv, wv) = first[1, 0], first[0, 1]
        return (top - wu * sv - wv * su - ddw * point) / w
    slope, dw = first[(1, 0) if du else (0, 1)]
    return (top - 2 * dw * slope - ddw * point) / w


def differential_geometry(patch: Patch, u: np.ndarray, v: np.ndarray) -> SurfacePoints:
    """Points, outward normals, Gaussian and mean curvature from the fundamental forms."""
    su, sv = evaluate(patch, u, v, (1, 0)), evaluate(patch, u, v, (0, 1))
    suu, suv, svv = (evaluate(patch, u, v, order) for order in ((2, 0), (1, 1), (0, 2)))
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = np.cross(su, sv)
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = patch.sign * np.where(size > 1e-12, normal / size, np.nan)
        E, F, G = (np.einsum("pc,pc->p", a, b) for a, b in ((su, su), (su, sv), (sv, sv)))
        L, M, N = (np.einsum("pc,pc->p", second, normal) for second in (suu, suv, svv))
        metric = E * G - F * F
        gaussian = (L * N - M * M) / metric
        mean = -(E * N - 2 * F * M + G * L) / (2 * metric)
    return SurfacePoints(evaluate(patch, u, v), normal, gaussian, mean)


def swollen(patch: Patch, amount: float, axis: np.ndarray) -> Patch:
    """Move a patch outwards, or with a negative amount inwards, by a little.

    Control points move by ``amount`` mm times the part, square to ``axis`` (3,), of the unit normal at their
    Greville parameters: plane sections stay plane, level caps and lids where they are.
    """
    u = _greville(patch.knots_u, patch.degree_u, patch.weights.shape[0])
    v = _greville(patch.knots_v, patch.degree_v, patch.weights.shape[1])
    bu, slope_u = (basis(u, patch.knots_u, patch.degree_u, patch.closed_u, order) for order in (0, 1))
    bv, slope_v = (basis(v, patch.knots_v, patch.degree_v, patch.closed_v, order) for order in (0, 1))
    homogeneous = np.dstack([patch.control_points * patch.weights[..., None], patch.weights])
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


def _greville(knots: np.ndarray, degree: int, count: int) -> np.ndarray:
    """Parameters (count,) at which each control point has most weight."""
    return np.array([knots[n + 1 : n + degree + 1].mean() for n in range(count)])


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
    across = basis(rows, patch.knots_v, patch.degree_v, patch.closed_v)
    homogeneous = np.dstack([patch.control_points * patch.weights[..., None], patch.weights])
    nets = np.einsum("rv,uvc->ruc", across, homogeneous)
    fine = 4 * len(patch.control_points)
    bu = basis(np.arange(fine) / fine, patch.knots_u, patch.degree_u, patch.closed_u)
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
    bu = basis(np.concatenate(u), patch.knots_u, patch.degree_u, patch.closed_u)
    vertices = np.einsum("pu,puc->pc", bu, nets[row_of])
    vertices = vertices[:, :3] / vertices[:, 3:]
    faces = [_zip(u[r], u[r + 1], starts[r], starts[r + 1]) for r in range(len(rows) - 1)]
    normal = _stack_direction(patch)
    if not low:
        faces.append(_lid(vertices[: starts[1]], normal)[:, ::-1])
    if not high:
        faces.append(_lid(vertices[starts[-2] :], normal) + starts[-2])
    faces = np.concatenate(faces)
    if _volume(vertices, faces) < 0:
        faces = faces[:, ::-1]
    return vertices, np.ascontiguousarray(faces)


def _rows(patch: Patch, edge: float) -> np.ndarray:
    """Parameters v of the mesh's rows, at equal steps along the surface."""
    low, high = patch.knots_v[patch.degree_v], patch.knots_v[-patch.degree_v - 1]
    v = np.linspace(low, high, 8 * patch.control_points.shape[1])
    u = np.linspace(patch.knots_u[patch.degree_u], patch.knots_u[-patch.degree_u - 1], 17)[:-1]
    bu = basis(u, patch.knots_u, patch.degree_u, patch.closed_u)
    bv = basis(v, patch.knots_v, patch.degree_v, patch.closed_v)
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


def _volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, n]] - vertices.mean(axis=0) for n in range(3))
    return float(np.einsum("fc,fc->", a, np.cross(b, c))) / 6
