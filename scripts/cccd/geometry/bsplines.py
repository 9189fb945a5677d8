"""B-spline bases (eqs. 7-9) and tensor-product patches, eq. (10): points, derivatives, curvature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, NdBSpline

from cccd.geometry.arrays import FloatArray

__all__ = [
    "DEGREE",
    "Patch",
    "SurfacePoints",
    "basis",
    "closed_knots",
    "greville",
    "open_knots",
    "smoothing_operator",
]

#: Both directions are cubic, eq. (9).
DEGREE = 3


def closed_knots(count: int, degree: int = DEGREE) -> FloatArray:
    """Knots (count + 2 * degree + 1,) of a closed uniform spline on [0, 1]."""
    return np.arange(-degree, count + degree + 1) / count


def open_knots(count: int, length: float, degree: int = DEGREE) -> FloatArray:
    """Knots (count + degree + 1,) of a clamped uniform spline on [0, length]."""
    inner = np.linspace(0.0, length, count - degree + 1)
    return np.concatenate([np.zeros(degree), inner, np.full(degree, length)])


def greville(knots: FloatArray, degree: int, count: int) -> FloatArray:
    """Parameters (count,) at which each control point has most weight."""
    return np.array([knots[n + 1 : n + degree + 1].mean() for n in range(count)])


def basis(at: FloatArray, knots: FloatArray, degree: int, closed: bool, derivative: int = 0) -> FloatArray:
    """Values (P, n) of the n basis functions, or of a derivative of them, at parameters (P,).

    A closed basis wraps: its last ``degree`` functions are added onto the first.
    """
    at = _within(at, knots, degree, closed)
    functions = len(knots) - degree - 1
    if derivative > degree:
        full = np.zeros((len(at), functions))
    elif derivative:
        full = BSpline(knots, np.eye(functions), degree).derivative(derivative)(at)
    else:
        full = BSpline.design_matrix(at, knots, degree).toarray()
    if not closed:
        return full
    count = functions - degree
    wrapped = full[:, :count].copy()
    for extra in range(degree):  # a spline of fewer than `degree` points wraps more than once
        wrapped[:, extra % count] += full[:, count + extra]
    return wrapped


def _within(at: FloatArray, knots: FloatArray, degree: int, closed: bool) -> FloatArray:
    """Parameters on the base period: a closed direction wraps, an open one ends."""
    low, high = float(knots[degree]), float(knots[-degree - 1])
    at = np.asarray(at, float)
    return low + np.mod(at - low, high - low) if closed else np.clip(at, low, high)


def smoothing_operator(design: FloatArray, roughness: float, closed: bool) -> FloatArray:
    """Operator (n, P) from samples to the control points that minimise squares plus a little roughness.

    The penalty on second differences of the control points only settles what the samples leave open.

    Parameters
    ----------
    design : (P, n) float64
        Basis functions at the samples' parameters.
    roughness : float
        Weight of the penalty, as a share of the mean weight of a control point.
    closed : bool
        Whether the differences go on from the last control point to the first.
    """
    count = design.shape[1]
    difference = np.roll(np.eye(count), 1, 0) - 2 * np.eye(count) + np.roll(np.eye(count), -1, 0)
    if not closed:
        difference = difference[1:-1]
    normal: FloatArray = design.T @ design
    weight = roughness * float(np.trace(normal)) / count
    bending: FloatArray = weight * difference.T @ difference
    system: FloatArray = normal + bending + 1e-12 * np.eye(count)
    return np.linalg.solve(system, design.T).astype(float, copy=False)


@dataclass(frozen=True)
class SurfacePoints:
    """Points of a surface and their differential geometry; curvature in 1/mm.

    Where the surface closes on a pole one derivative vanishes: normals and curvature are NaN there.
    """

    points: FloatArray  # (P, 3) mm RAS
    normals: FloatArray  # (P, 3) unit length, outwards for a solid
    gaussian: FloatArray  # (P,) 1/mm^2
    mean: FloatArray  # (P,) 1/mm, positive where the solid is convex


@dataclass
class Patch:
    """A tensor-product (rational) B-spline surface, eq. (10), in world mm RAS.

    A closed direction keeps n control points unwrapped and ``n + 2 * degree + 1`` knots; an open one
    has ``n + degree + 1``. ``sign`` is +1 for a solid and -1 for a cavity.
    """

    control_points: FloatArray  # (nu, nv, 3)
    weights: FloatArray  # (nu, nv)
    knots_u: FloatArray
    knots_v: FloatArray
    degree_u: int
    degree_v: int
    closed_u: bool
    closed_v: bool
    sign: int

    @property
    def homogeneous(self) -> FloatArray:
        """Control points times their weight, and the weight: (nu, nv, 4)."""
        return np.dstack([self.control_points * self.weights[..., None], self.weights])

    def basis_u(self, u: FloatArray, derivative: int = 0) -> FloatArray:
        """Values (P, nu) of the basis functions around the tube at parameters (P,)."""
        return basis(u, self.knots_u, self.degree_u, self.closed_u, derivative)

    def basis_v(self, v: FloatArray, derivative: int = 0) -> FloatArray:
        """Values (P, nv) of the basis functions along the tube at parameters (P,)."""
        return basis(v, self.knots_v, self.degree_v, self.closed_v, derivative)

    def evaluate(self, u: FloatArray, v: FloatArray, derivatives: tuple[int, int] = (0, 0)) -> FloatArray:
        """Points (P, 3), or one of the partial derivatives, at parameters u (P,) and v (P,).

        Rational derivatives follow the quotient rule up to second order.

        Raises
        ------
        ValueError
            For derivatives of higher order.
        """
        du, dv = derivatives
        if du + dv > 2:
            raise ValueError("derivatives are available up to second order")
        spline, at = self._spline(), self._within(u, v)

        def sums(a: int, b: int) -> tuple[FloatArray, FloatArray]:
            values: FloatArray = spline(at, nu=(a, b))
            return values[:, :3], values[:, 3:]

        top, w = sums(0, 0)
        point = top / w
        if (du, dv) == (0, 0):
            return point
        first: dict[tuple[int, int], tuple[FloatArray, FloatArray]] = {}
        for order in ((1, 0), (0, 1)):
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

    def _spline(self) -> NdBSpline:
        """Homogeneous points as a function of (u, v) on the base period; control points of turns repeated."""
        nu, nv = self.weights.shape
        extra_u, extra_v = int(self.closed_u) * self.degree_u, int(self.closed_v) * self.degree_v
        net = self.homogeneous
        net = np.take(net, range(nu + extra_u), axis=0, mode="wrap")
        net = np.take(net, range(nv + extra_v), axis=1, mode="wrap")
        return NdBSpline((self.knots_u, self.knots_v), net, (self.degree_u, self.degree_v))

    def _within(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """Parameters (P, 2) on the base period: closed directions wrap, open ones end."""
        return np.column_stack(
            [
                _within(u, self.knots_u, self.degree_u, self.closed_u),
                _within(v, self.knots_v, self.degree_v, self.closed_v),
            ]
        )

    def differential_geometry(self, u: FloatArray, v: FloatArray) -> SurfacePoints:
        """Points, outward normals, Gaussian and mean curvature from the fundamental forms."""
        su, sv = self.evaluate(u, v, (1, 0)), self.evaluate(u, v, (0, 1))
        suu, suv, svv = (self.evaluate(u, v, order) for order in ((2, 0), (1, 1), (0, 2)))
        with np.errstate(divide="ignore", invalid="ignore"):
            normal = np.cross(su, sv)
            size = np.linalg.norm(normal, axis=1, keepdims=True)
            normal = self.sign * np.where(size > 1e-12, normal / size, np.nan)
            E, F, G = (np.einsum("pc,pc->p", a, b) for a, b in ((su, su), (su, sv), (sv, sv)))
            L, M, N = (np.einsum("pc,pc->p", second, normal) for second in (suu, suv, svv))
            metric = E * G - F * F
            gaussian = (L * N - M * M) / metric
            mean = -(E * N - 2 * F * M + G * L) / (2 * metric)
        return SurfacePoints(self.evaluate(u, v), normal, gaussian, mean)
