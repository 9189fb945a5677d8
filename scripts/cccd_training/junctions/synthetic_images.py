"""Synthetic grey slices around a mask, and what an edge detector makes of them.

CT- and MR-like: tissues of similar intensity beside the organ, texture and vessels in it, bone or skull, air,
a bias field, partial volume and noise.
"""

from __future__ import annotations

from typing import cast

import cv2
import numpy as np

from cccd.geometry.arrays import BoolArray, ByteArray, SingleArray
from cccd.geometry.opencv import distance_to_zero, gaussian_blur, sobel
from cccd.settings.junctions import BoundarySettings
from cccd.tolerances import CONTRAST
from cccd_junctions.boundary import edge_map
from cccd_training.junctions.random_masks import smooth_noise


def draw_image(rng: np.random.Generator, mask: ByteArray, size_px: float | None = None) -> SingleArray:
    """Draw a grey slice in which the mask (I, J) is an organ.

    Parameters
    ----------
    rng : Generator
    mask : (I, J) uint8 array
    size_px : float or None
        What tissues are scaled by: the root of the mask's area when it is ``None``. Slices of one stack have
        the same, so that equal generators draw the same tissues around each.

    Returns
    -------
    (I, J) float32 array
        Arbitrary units; the organ may be brighter or darker than its surroundings.
    """
    size = float(np.sqrt(mask.sum())) if size_px is None else size_px
    tissues = _tissues(rng, mask.shape, size)
    intensity = rng.uniform(0.2, 0.8)
    organ = _organ(rng, mask, intensity, size)
    around = _surroundings(rng, tissues, mask, intensity, size)
    bare = rng.random() < 0.3  # an extracted organ, or one in air: nothing around it, not even noise
    if bare:
        around = np.zeros_like(around)
    drawn = _warp(rng, mask, rng.uniform(0.0, 0.3) if bare else rng.uniform(0.1, 1.1))
    blended = (drawn * organ + (1 - drawn) * around).astype(np.float32)
    image = _acquired(rng, blended, mask, size)
    noise = rng.standard_normal(mask.shape).astype(np.float32)
    if rng.random() < 0.5:
        noise = gaussian_blur(noise, 0.8) * np.float32(2.3)
    if bare:
        noise = noise * drawn
    return (image + rng.uniform(0.005, 0.09) * noise).astype(np.float32)


def _warp(rng: np.random.Generator, mask: ByteArray, shift: float) -> SingleArray:
    """Move the mask by a smooth random displacement: annotators do not follow every edge."""
    rows, columns = np.mgrid[: mask.shape[0], : mask.shape[1]].astype(np.float32)
    di, dj = (shift * smooth_noise(rng, mask.shape, rng.uniform(8, 30)) for _ in range(2))
    moved = cv2.remap(mask.astype(np.float32), columns + dj, rows + di, cv2.INTER_LINEAR)
    return cast(SingleArray, moved)


def _tissues(rng: np.random.Generator, shape: tuple[int, ...], size: float) -> SingleArray:
    """Draw what is around the organ: patches of even intensity."""
    around = np.full(shape, rng.uniform(0.1, 0.9), np.float32)
    for _ in range(rng.integers(1, 5)):
        region = smooth_noise(rng, shape, rng.uniform(0.25, 1.2) * size + 4) > rng.uniform(-0.3, 1.0)
        around[region] = rng.uniform(0, 1)
    return around


def _organ(rng: np.random.Generator, mask: ByteArray, intensity: float, size: float) -> SingleArray:
    """Draw the organ's inside, perhaps with vessels, ventricles or a cortex, and with a rim."""
    organ = np.full(mask.shape, intensity, np.float32)
    if rng.random() < 0.5:
        for _ in range(rng.integers(1, 4)):
            scale = float(rng.uniform(3, 0.4 * size + 5))
            inner = smooth_noise(rng, mask.shape, scale) > rng.uniform(0.6, 1.6)
            organ[inner] = intensity + rng.normal(0, 0.25)
    if rng.random() < 0.35:
        depth = distance_to_zero((mask > 0).astype(np.uint8))
        rim = depth < rng.uniform(2, 7) + smooth_noise(rng, mask.shape, 8)
        organ[rim] = intensity + rng.normal(0, 0.15)
    return organ


def _surroundings(
    rng: np.random.Generator, tissues: SingleArray, mask: ByteArray, intensity: float, size: float
) -> SingleArray:
    """Fit tissues to an organ: shells around it, a contrast to it, and neighbours that have none."""
    around = tissues.copy()
    if rng.random() < 0.45:
        away = distance_to_zero((mask == 0).astype(np.uint8))
        inner = rng.uniform(0.5, 5) + smooth_noise(rng, mask.shape, 15)
        around[(away < inner + rng.uniform(1, 6)) & (away > inner)] = rng.uniform(0, 1.3)
        if rng.random() < 0.6:
            around[away <= inner] = rng.uniform(0, 0.6)
    contrast = rng.uniform(0.1, 0.5)
    near = np.abs(around - intensity) < contrast
    lift = float(rng.choice([-1, 1])) * contrast
    around = np.where(near & (rng.random() < 0.85), intensity + lift, around).astype(np.float32)
    if rng.random() < 0.4:  # a neighbour of nearly the same intensity hides part of the border
        same = smooth_noise(rng, mask.shape, 0.7 * size + 6) > rng.uniform(1.0, 1.8)
        around[same] = intensity + rng.normal(0, 0.06)
    return around


def _acquired(rng: np.random.Generator, image: SingleArray, mask: ByteArray, size: float) -> SingleArray:
    """Add what a scanner does: partial volume, texture, a bias field, and what outshines all else."""
    image = gaussian_blur(image, rng.uniform(0.3, 1.1))
    image += rng.uniform(0, 0.06) * smooth_noise(rng, mask.shape, rng.uniform(2, 12))
    image *= 1 + rng.uniform(0, 0.2) * smooth_noise(rng, mask.shape, 2 * size + 20)
    if rng.random() < 0.3:  # bone, metal or air
        bright = smooth_noise(rng, mask.shape, rng.uniform(4, 20)) > rng.uniform(1.2, 2.2)
        image[bright & (mask == 0)] += rng.choice([-1, 1]) * rng.uniform(0.5, 4)
    return image


def canny_map(
    rng: np.random.Generator, image: SingleArray, mask: ByteArray, band_px: float | None = 6.0
) -> BoolArray:
    """Canny edges (1986) of an image, in a band along the mask's border if wanted.

    Half of them by `cccd_junctions.boundary.edge_map`, half by OpenCV; blur and thresholds are drawn.

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
    scaled = np.clip(255 * (image - low) / max(high - low, CONTRAST), 0, 255).astype(np.uint8)
    scaled = gaussian_blur(scaled, rng.uniform(0.6, 2.0))
    strong = float(np.percentile(np.hypot(*sobel(scaled)), rng.uniform(70, 93)))
    weak = rng.uniform(0.3, 0.6) * strong
    edges = cast(ByteArray, cv2.Canny(scaled, weak, max(strong, 8.0), L2gradient=True)) > 0
    if band_px is None:
        return edges
    border = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
    return edges & (distance_to_zero(1 - cast(ByteArray, border)) <= band_px)
