"""A B-spline snake from a circular seed (section 6.4), after Marsousi et al.

M. Marsousi, A. Eftekhari, A. Kocharian, J. Alirezaie, Endocardial boundary extraction in left
ventricular echocardiographic images using fast and adaptive B-spline snake algorithm, Int. J. CARS 5
(2010) 501-513. Its abstract names a combination of external forces, adaptive node insertion, a
multiresolution strategy and no optimisation; its force equations could not be had. What follows is that,
with a balloon force and an attraction; the smoothness is the spline itself (P. Brigger, J. Hoeg, M.
Unser, IEEE Trans. Image Process. 9 (2000) 1484-1496) and a slight tension, without which the balloon
runs into loops.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates, sobel
from scipy.spatial import cKDTree

Force = Callable[[np.ndarray, np.ndarray], np.ndarray]
Bound = float | np.ndarray

#: Nodes of the seed, the spacing in pixels beyond which a node is inserted, and where that ends.
SEED_NODES, SPACING_PX = 12, 12.0
MOST_NODES = 400
#: Largest step of a node in pixels, number of steps, and the mean step at which the snake has settled.
STEP_PX, STEPS, SETTLED_PX = 1.0, 300, 0.02
#: Share of the way to the middle of its neighbours that a node is drawn back at each step.
TENSION = 0.1
#: Samples per span, and the uniform cubic B-spline (eq. 9) of four control points at them.
SAMPLES = 4
_CUBIC = np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6
_T = np.arange(SAMPLES)[:, None] / SAMPLES
BASIS = _T ** np.arange(4) @ _CUBIC
SLOPES = _T ** np.arange(3) * (1, 2, 3) @ _CUBIC[1:]


def seed_circle(centre: np.ndarray | Sequence[float], radius: float, count: int = SEED_NODES) -> np.ndarray:
    """Points (count, 2) evenly around a circle, counter-clockwise in (i, j)."""
    angle = 2 * np.pi * np.arange(count) / count
    return np.asarray(centre, float) + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def b_spline_snake(corners: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    """Wrap corner points from a circular seed, as the paper's Figure 15 does.

    The snake shrinks when the seed holds most corners and swells otherwise; each of its points is drawn
    to the nearest corner, the pressure fading where a corner is reached. It knows nothing else of the
    boundary.

    Parameters
    ----------
    corners : (K, 2) float
        Target points, (i, j).
    centre : (2,) float
    radius : float
        The seed, in pixels.

    Returns
    -------
    (n, 2) float64
        The snake's curve, ordered, closed, first point not repeated.
    """
    corners = np.asarray(corners, float).reshape(-1, 2)
    if not len(corners):
        return _curve(seed_circle(centre, radius))[0]
    tree = cKDTree(corners)
    within = np.hypot(*(corners - centre).T) < radius
    sign = -1.0 if np.count_nonzero(within) * 2 >= len(corners) else 1.0

    def force(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        distance, nearest = tree.query(points)
        pull = (corners[nearest] - points) / np.maximum(distance, 1.0)[:, None]
        pressure = sign * np.minimum(distance / SPACING_PX, 1.0)[:, None]
        return 0.5 * (pull + pressure * normals)

    return _curve(_evolve(seed_circle(centre, radius), force))[0]


def image_snake(image: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    """Find a region of an image from a circular seed within it, coarse to fine.

    The balloon swells where the image looks like the inner half of the seed (within two standard
    deviations of its mean) and shrinks where it does not; edges draw the snake over the last pixels.

    Parameters
    ----------
    image : (I, J)
        Grey values.
    centre, radius : (2,) float, float
        The seed in the image's pixels.

    Returns
    -------
    (n, 2) float64
        The snake's curve, ordered, closed, first point not repeated.
    """
    image = np.asarray(image, float)
    away = np.hypot(*(np.indices(image.shape) - np.reshape(centre, (2, 1, 1))))
    core = image[away <= radius / 2] if (away <= radius / 2).any() else image.ravel()
    width = 2 * max(core.std(), 0.02 * np.ptp(image), 1e-6)
    last = np.array(image.shape) - 1.0
    low, high = np.minimum(0, centre - radius), np.maximum(last, centre + radius)
    nodes = seed_circle(centre, radius)
    for blur in (4.0, 2.0, 1.0):
        smooth = gaussian_filter(image, blur)
        edges = np.hypot(sobel(smooth, 0), sobel(smooth, 1))
        slope = np.stack([sobel(edges, 0), sobel(edges, 1)])
        slope /= max(np.abs(slope).max(), 1e-12)

        def force(points: np.ndarray, normals: np.ndarray, smooth=smooth, slope=slope) -> np.ndarray:
            here = points.T
            unlike = np.abs(map_coordinates(smooth, here, order=1, mode="nearest") - core.mean()) / width
            balloon = np.clip(1 - unlike, -1, 1)
            pull = np.column_stack([map_coordinates(part, here, order=1, mode="nearest") for part in slope])
            return 0.8 * balloon[:, None] * normals + 0.4 * pull

        nodes = _evolve(nodes, force, low, high)
    return _curve(nodes)[0]


def _curve(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and unit outward normals (n * SAMPLES, 2) of the closed spline of these nodes."""
    local = nodes[(np.arange(len(nodes))[:, None] + np.arange(-1, 3)) % len(nodes)]
    points = np.einsum("sb,nbd->nsd", BASIS, local).reshape(-1, 2)
    along = np.einsum("sb,nbd->nsd", SLOPES, local).reshape(-1, 2)
    across = np.column_stack([along[:, 1], -along[:, 0]])
    return points, across / np.maximum(np.hypot(*across.T), 1e-12)[:, None]


def _evolve(nodes: np.ndarray, force: Force, low: Bound = -np.inf, high: Bound = np.inf) -> np.ndarray:
    """Move nodes, within bounds, by the force on their stretch of the curve until it rests."""
    weight = BASIS.sum(0)
    for step in range(STEPS):
        if step % 10 == 0:
            nodes = _respace(nodes)
        push = force(*_curve(nodes)).reshape(len(nodes), SAMPLES, 2)
        share = np.einsum("sb,nsd->bnd", BASIS, push)
        total = sum(np.roll(part, shift, axis=0) for part, shift in zip(share, range(-1, 3), strict=True))
        moved = np.clip(nodes + STEP_PX * total / weight.sum(), low, high)
        moved += TENSION * ((np.roll(moved, 1, axis=0) + np.roll(moved, -1, axis=0)) / 2 - moved)
        move, nodes = moved - nodes, moved
        if np.hypot(*move.T).mean() < SETTLED_PX:
            break
    return nodes


def _respace(nodes: np.ndarray) -> np.ndarray:
    """Insert a node in every gap wider than the spacing; drop every other of nodes that crowd."""
    gap = np.hypot(*(np.roll(nodes, -1, axis=0) - nodes).T)
    crowded = (gap < SPACING_PX / 4) & (np.arange(len(nodes)) % 2 == 1)
    if len(nodes) - np.count_nonzero(crowded) >= SEED_NODES:
        nodes, gap = nodes[~crowded], gap[~crowded]
    following = np.roll(nodes, -1, axis=0)
    wide = (np.hypot(*(following - nodes).T) > SPACING_PX) & (len(nodes) < MOST_NODES)
    return np.insert(nodes, np.flatnonzero(wide) + 1, (nodes + following)[wide] / 2, axis=0)
