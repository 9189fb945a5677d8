"""FUSE: a pixel corner detector fused with a B-spline (sections 6.1-6.2).

FUSE1 is Harris, FUSE2 Shi-Tomasi, FUSE3 FAST; with SUSAN, which section 1 names, there is a fourth. The
corners that lie on the boundary become the control points of a closed uniform cubic B-spline (eq. 9).
Detectors leave corners unordered and the paper does not say how it ordered them. Three ways are kept:

``angle``
    by the angle around the corners' centroid: needs nothing but the corners, and is right for star-shaped
    organs only.
``tour``
    along a short closed tour: the best that corners alone allow.
``chain``
    by the nearest place on the true boundary. It presumes the ordered boundary that the corners were
    meant to give; where a detector marks pixels on both sides of the boundary it zigzags.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from cccd_paper.comparisons.links import closed_order

#: The ways of ordering corners, from the least to the most informed.
ORDERS = ("angle", "tour", "chain")

# A corner this near to a boundary pixel lies on the boundary: it covers the eight neighbours.
_ON_BOUNDARY_PX = 1.5


def near_boundary(corners: np.ndarray, boundary: np.ndarray) -> np.ndarray:
    """Which corners (K,) lie on a boundary pixel or beside one (both in (i, j))."""
    if not len(corners) or not len(boundary):
        return np.zeros(len(corners), bool)
    return np.isfinite(cKDTree(boundary).query(corners, distance_upper_bound=_ON_BOUNDARY_PX)[0])


def order_by_angle(corners: np.ndarray) -> np.ndarray:
    """Numbers (K,) of the corners by their angle around their centroid, the nearer first where equal."""
    away = corners - corners.mean(0)
    return np.lexsort((np.hypot(*away.T), np.arctan2(away[:, 1], away[:, 0])))


def order_by_links(corners: np.ndarray, reconstruct: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Numbers (K,) of the corners along the single closed curve that ``reconstruct`` links them to."""
    if len(corners) < 4:
        return np.arange(len(corners))
    return closed_order(reconstruct(corners), len(corners))


def order_by_chain(corners: np.ndarray, curve: np.ndarray) -> np.ndarray:
    """Numbers (K,) of the corners by their nearest point on the ordered boundary ``curve`` (n, 2)."""
    distance, place = cKDTree(curve).query(corners)
    return np.lexsort((np.asarray(distance), np.asarray(place)))


def closed_spline(control_points: np.ndarray, samples_per_span: int = 8) -> np.ndarray:
    """Points on the closed uniform cubic B-spline of these control points (n, 2), eqs. (6) and (9).

    Returns
    -------
    (n * samples_per_span, 2) float64
        First point not repeated.

    Raises
    ------
    ValueError
        For fewer than three control points.
    """
    count = len(control_points)
    if count < 3:
        raise ValueError(f"a closed cubic spline needs three control points, not {count}")
    wrapped = np.concatenate([control_points, control_points[:3]])
    curve = BSpline(np.arange(-3.0, count + 4), np.asarray(wrapped, float), 3)
    return curve(np.arange(count * samples_per_span) / samples_per_span)
