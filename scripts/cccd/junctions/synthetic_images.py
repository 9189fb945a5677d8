"""Synthetic grey slices around a mask, and what an edge detector makes of them.

CT- and MR-like: tissues of similar grey beside the organ, texture and vessels in it, bone or skull, air,
a bias field, partial volume and noise.
"""

from __future__ import annotations

import cv2
import numpy as np

from cccd.boundary import edge_map
from cccd.junctions.random_masks import smooth_noise
from cccd.settings import BoundarySettings

__all__ = ["canny_map", "draw_image"]


def _warp(rng: np.random.Generator, mask: np.ndarray, shift: float) -> np.ndarray:
    """Move the mask by a smooth random displacement: annotators do not follow every edge."""
    rows, columns = np.mgrid[: mask.shape[0], : mask.shape[1]].astype(np.float32)
    di, dj = (shift * smooth_noise(rng, mask.shape, rng.uniform(8, 30)) for _ in range(2))
    return cv2.remap(mask.astype(np.float32), columns + dj, rows + di, cv2.INTER_LINEAR)


def draw_image(rng: np.random.Generator, mask: np.ndarray) -> np.ndarray:
    """Draw a grey slice in which the mask (I, J) is an organ.

    Returns
    -------
    (I, J) float32 array
        Arbitrary units; the organ may be brighter or darker than its surroundings.
    """
    shape = mask.shape
    size = np.sqrt(mask.sum())
    around = np.full(shape, rng.uniform(0.1, 0.9), np.float32)
    for _ in range(rng.integers(1, 5)):  # neighbouring tissues
        region = smooth_noise(rng, shape, rng.uniform(0.25, 1.2) * size + 4) > rng.uniform(-0.3, 1.0)
        around[region] = rng.uniform(0, 1)
    organ_grey = rng.uniform(0.2, 0.8)
    organ = np.full(shape, organ_grey, np.float32)
    if rng.random() < 0.5:  # vessels, ventricles, cortex: structure inside
        for _ in range(rng.integers(1, 4)):
            scale = rng.uniform(3, 0.4 * size + 5)
            inner = smooth_noise(rng, shape, scale) > rng.uniform(0.6, 1.6)
            organ[inner] = organ_grey + rng.normal(0, 0.25)
    if rng.random() < 0.35:  # a rim of another grey, inside or outside
        depth = cv2.distanceTransform((mask > 0).astype(np.uint8), cv2.DIST_L2, 3)
        rim = depth < rng.uniform(2, 7) + smooth_noise(rng, shape, 8)
        organ[rim] = organ_grey + rng.normal(0, 0.15)
    if rng.random() < 0.45:
        away = cv2.distanceTransform((mask == 0).astype(np.uint8), cv2.DIST_L2, 3)
        inner = rng.uniform(0.5, 5) + smooth_noise(rng, shape, 15)
        around[(away < inner + rng.uniform(1, 6)) & (away > inner)] = rng.uniform(0, 1.3)
        if rng.random() < 0.6:
            around[away <= inner] = rng.uniform(0, 0.6)
    contrast = rng.uniform(0.1, 0.5)
    near = np.abs(around - organ_grey) < contrast
    lift = rng.choice([-1, 1]) * contrast
    around = np.where(near & (rng.random() < 0.85), organ_grey + lift, around).astype(np.float32)
    if rng.random() < 0.4:  # a neighbour of nearly the same grey hides part of the border
        same = smooth_noise(rng, shape, 0.7 * size + 6) > rng.uniform(1.0, 1.8)
        around[same] = organ_grey + rng.normal(0, 0.06)
    bare = rng.random() < 0.3  # an extracted organ, or one in air: nothing around it, not even noise
    if bare:
        around[:] = 0.0
    drawn = _warp(rng, mask, rng.uniform(0.0, 0.3) if bare else rng.uniform(0.1, 1.1))
    image = drawn * organ + (1 - drawn) * around
    image = cv2.GaussianBlur(image, (0, 0), rng.uniform(0.3, 1.1))
    image += rng.uniform(0, 0.06) * smooth_noise(rng, shape, rng.uniform(2, 12))
    image *= 1 + rng.uniform(0, 0.2) * smooth_noise(rng, shape, 2 * size + 20)
    if rng.random() < 0.3:  # bone, metal or air that outshine all else
        bright = smooth_noise(rng, shape, rng.uniform(4, 20)) > rng.uniform(1.2, 2.2)
        image[bright & (mask == 0)] += rng.choice([-1, 1]) * rng.uniform(0.5, 4)
    noise = rng.standard_normal(shape).astype(np.float32)
    if rng.random() < 0.5:
        noise = cv2.GaussianBlur(noise, (0, 0), 0.8) * 2.3
    if bare:
        noise *= drawn
    return (image + rng.uniform(0.005, 0.09) * noise).astype(np.float32)


def canny_map(
    rng: np.random.Generator, image: np.ndarray, mask: np.ndarray, band_px: float | None = 6.0
) -> np.ndarray:
    """Canny edges (1986) of an image, in a band along the mask's border if wanted.

    Every other time by `cccd.boundary.edge_map`, else by OpenCV's detector; blur and thresholds are drawn.

    Parameters
    ----------
    rng : Generator
    image : (I, J) array
    mask : (I, J) uint8 array
    band_px : float or None
        Edges farther than this from the border are left out; ``None`` keeps all.

    Returns
    -------
    (I, J) bool array
    """
    if rng.random() < 0.5:  # as the pipeline finds them
        region = None if band_px is None else mask[None] > 0
        dilations = 1 if band_px is None else round(band_px / 2)
        blur, quantile = rng.uniform(0.8, 2.2), rng.uniform(0.6, 0.93)
        settings = BoundarySettings(blur_px=blur, dilations=dilations, edge_quantile=quantile)
        return edge_map(image[None], region, settings)[0]
    low, high = np.percentile(image, (1, 99))
    grey = np.clip(255 * (image - low) / max(high - low, 1e-6), 0, 255).astype(np.uint8)
    sigma = rng.uniform(0.6, 2.0)
    grey = cv2.GaussianBlur(grey, (0, 0), sigma)
    slope = np.hypot(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1))
    strong = float(np.percentile(slope, rng.uniform(70, 93)))
    edges = cv2.Canny(grey, rng.uniform(0.3, 0.6) * strong, max(strong, 8.0), L2gradient=True) > 0
    if band_px is not None:
        border = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
        edges &= cv2.distanceTransform(1 - border, cv2.DIST_L2, 3) <= band_px
    return edges
