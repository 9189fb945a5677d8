"""Families of boundary maps beside `cccd_datasets.corruptions`: other ways in which a map comes about.

A kind of damage is one defect; a family is one cause. Leaving a whole family out of training says what a map
of another cause than training's gets. None of them is among `cccd_training.junctions.damages`, so that those
stay unseen. Every function takes a generator and a mask (I, J) uint8, and returns a map (I, J) bool and its
grey slice, or none.

================ ==========================================================================================
family           a map is
================ ==========================================================================================
``label_maps``   the edges of an image synthesised from random labels with random contrasts, resolution and
                 bias (SynthSeg: Billot et al. 2023)
``elastic``      an outline that elastic displacements have torn, with pieces of neighbours' outlines, stored
                 as a faint grey line and found again by a threshold under random intensities
``detectors``    what one of `DETECTORS` finds in a grey slice at random settings
================ ==========================================================================================
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import cv2
import numpy as np
from scipy import ndimage
from skimage import filters, morphology

from cccd.geometry.arrays import AnyArray, BoolArray, ByteArray, SingleArray
from cccd.geometry.opencv import distance_to_zero, gaussian_blur
from cccd.tolerances import CONTRAST
from cccd_junctions.boundary import gradient_ridges, outline
from cccd_training.junctions.random_masks import smooth_noise
from cccd_training.junctions.synthetic_images import canny_map, draw_image

_Drawn = tuple[BoolArray, SingleArray | None]
_Detector = Callable[[np.random.Generator, SingleArray], BoolArray]

# Pixels on either side of the true border in which edges of images are kept: as the pipeline keeps them
# around a rough region.
_BAND_PX = (4.0, 9.0)


def label_maps(rng: np.random.Generator, mask: ByteArray) -> _Drawn:
    """Find Canny edges in an image whose every label has a grey value of its own."""
    labels, count = _labels(rng, mask)
    image = _acquired(rng, rng.uniform(0, 1, count)[labels], rng.uniform(0, 0.1, count)[labels])
    return canny_map(rng, image, mask, float(rng.uniform(*_BAND_PX))), image


def _labels(rng: np.random.Generator, mask: ByteArray) -> tuple[AnyArray, int]:
    """Draw labels (I, J): regions around the organ, and perhaps some within."""
    size = float(np.sqrt(mask.sum()))
    around, within = int(rng.integers(2, 9)), int(rng.integers(1, 4))
    regions = [
        np.argmax([smooth_noise(rng, mask.shape, rng.uniform(0.2, 1) * size + 4) for _ in range(n)], axis=0)
        for n in (around, within)
    ]
    # a part of the organ is a deep one: close to the border the organ is of one label, most times
    depth = distance_to_zero(mask)
    least = rng.uniform(0, 0.3) * depth.max() if rng.random() < 0.7 else 0
    inner = np.where(depth > least, regions[1], 0)
    return np.where(mask > 0, around + inner, regions[0]), around + within


def _acquired(rng: np.random.Generator, mean: AnyArray, spread: AnyArray) -> SingleArray:
    """Scan an image: texture, partial volume of a coarser grid, a bias field, gamma, and noise."""
    image = (mean + spread * rng.standard_normal(mean.shape)).astype(np.float32)
    image = gaussian_blur(image, rng.uniform(0.4, 1.2))
    if rng.random() < 0.5:
        rows, columns = (int(n / rng.uniform(1, 2.2)) for n in image.shape)
        coarse = cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA)
        image = cv2.resize(coarse, image.shape[::-1], interpolation=cv2.INTER_LINEAR)
    image = np.asarray(image, np.float32)
    image = image * np.exp(rng.uniform(0, 0.25) * smooth_noise(rng, image.shape, 60))
    low, high = float(image.min()), float(image.max())
    image = ((image - low) / max(high - low, CONTRAST)) ** float(np.exp(rng.normal(0, 0.3)))
    return (image + rng.uniform(0, 0.05) * rng.standard_normal(image.shape)).astype(np.float32)


def elastic(rng: np.random.Generator, mask: ByteArray) -> _Drawn:
    """Tear an outline, add neighbours' outlines, and threshold it as a grey line of uneven strength."""
    line = _displaced(rng, _outline(mask), rng.uniform(0.1, 0.7), rng.uniform(4, 12))
    size = float(np.sqrt(mask.sum()))
    for _ in range(rng.integers(0, 4)):  # the same outline, moved far: other organs and their lobes
        other = _displaced(
            rng, _outline(mask), rng.uniform(0.1, 0.4) * size, rng.uniform(0.4, 1.2) * size + 8
        )
        here = smooth_noise(rng, mask.shape, 0.4 * size + 6) > rng.uniform(0.3, 1.5)
        line = np.maximum(line, other * here * np.float32(rng.uniform(0.6, 1)))
    strength = np.exp(rng.uniform(0.1, 0.6) * smooth_noise(rng, mask.shape, rng.uniform(6, 30)))
    grey = gaussian_blur(line, rng.uniform(0.4, 0.8)) * strength
    speckle = gaussian_blur(rng.standard_normal(mask.shape).astype(np.float32), rng.uniform(0.5, 1))
    near = distance_to_zero((line < 0.5).astype(np.uint8)) < rng.uniform(3, 15)
    grey = grey + near * np.float32(rng.uniform(0, 0.12)) * speckle / max(float(speckle.std()), CONTRAST)
    level = np.quantile(grey[_outline(mask) > 0], rng.uniform(0.04, 0.3))
    found = grey > max(float(level), CONTRAST)
    return (_thinned(found) if rng.random() < 0.6 else found), None


def _outline(mask: ByteArray) -> SingleArray:
    return outline(mask[None] > 0)[0].astype(np.float32)


def _thinned(found: BoolArray) -> BoolArray:
    return np.asarray(cast(Any, morphology).skeletonize(found), bool)


def _displaced(rng: np.random.Generator, line: SingleArray, far: float, size: float) -> SingleArray:
    """Move a picture by a smooth random field of about so many pixels, with features of such a size."""
    rows, columns = np.mgrid[: line.shape[0], : line.shape[1]].astype(np.float32)
    di, dj = (np.float32(far) * smooth_noise(rng, line.shape, size) for _ in range(2))
    return cast(SingleArray, cv2.remap(line, columns + dj, rows + di, cv2.INTER_LINEAR))


def ridges(rng: np.random.Generator, image: SingleArray) -> BoolArray:
    """Maxima of Sobel's gradient along its direction, above one level: no hysteresis."""
    magnitude, thin = gradient_ridges(image[None], rng.uniform(0.6, 2.2))
    return (thin & (magnitude > np.quantile(magnitude, rng.uniform(0.6, 0.9))))[0]


def gradients(rng: np.random.Generator, image: SingleArray) -> BoolArray:
    """Thinned or thick stretches of a large gradient, by Scharr's or Prewitt's kernels."""
    smooth = gaussian_blur(image, rng.uniform(0.6, 1.8))
    slopes = (
        [cv2.Scharr(smooth, cv2.CV_32F, *axis) for axis in ((1, 0), (0, 1))]
        if rng.random() < 0.5
        else [ndimage.prewitt(smooth, axis) for axis in (0, 1)]
    )
    steep = np.hypot(*slopes)
    low, high = np.quantile(steep, np.sort(rng.uniform(0.75, 0.95, 2)))
    found = np.asarray(cast(Any, filters).apply_hysteresis_threshold(steep, low, high), bool)
    return _thinned(found) if rng.random() < 0.8 else found


def zero_crossings(rng: np.random.Generator, image: SingleArray) -> BoolArray:
    """Zero crossings of the Laplacian of a Gaussian or of a difference of Gaussians, where it is steep."""
    scale = rng.uniform(1.0, 2.5)
    if rng.random() < 0.5:
        curved = ndimage.gaussian_laplace(image, scale)
    else:
        curved = gaussian_blur(image, 1.6 * scale) - gaussian_blur(image, scale)
    lowest, highest = (filtered(curved, 3) for filtered in (ndimage.minimum_filter, ndimage.maximum_filter))
    steep = highest - lowest
    crossing = (curved >= 0) & (lowest < 0)
    return crossing & (steep > np.quantile(steep, rng.uniform(0.6, 0.9)))


def levels(rng: np.random.Generator, image: SingleArray) -> BoolArray:
    """Borders between a few levels of grey, of a smoothed slice."""
    smooth = gaussian_blur(image, rng.uniform(0.8, 2.5))
    low, high = np.percentile(smooth, (1, 99))
    bounds = low + (high - low) * np.sort(rng.uniform(0.15, 0.85, int(rng.integers(1, 4))))
    steps = np.digitize(smooth, bounds)
    return steps > ndimage.minimum_filter(steps, footprint=np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]]))


def local_levels(rng: np.random.Generator, image: SingleArray) -> BoolArray:
    """Borders of what is brighter than its neighbourhood."""
    smooth = gaussian_blur(image, rng.uniform(0.8, 2.0))
    bright = smooth - gaussian_blur(image, rng.uniform(6, 20)) > rng.normal(0, 0.1) * smooth.std()
    return outline(bright[None])[0]


def opencv_canny(rng: np.random.Generator, image: SingleArray) -> BoolArray:
    """OpenCV's Canny by sums of slopes, with larger kernels, after a filter that keeps edges."""
    low, high = np.percentile(image, (1, 99))
    scaled = np.clip(255 * (image - low) / max(float(high - low), CONTRAST), 0, 255).astype(np.uint8)
    if rng.random() < 0.5:
        kept = cast(ByteArray, cast(Any, cv2).medianBlur(scaled, int(rng.choice([3, 5, 7]))))
    else:
        kept = cast(
            ByteArray, cast(Any, cv2).bilateralFilter(scaled, 7, rng.uniform(20, 80), rng.uniform(1, 4))
        )
    aperture = int(rng.choice([3, 5]))
    size = 4.0 if aperture == 3 else 48.0  # the sum of a kernel's weights on one side
    strong = rng.uniform(20, 70) * size
    weak = rng.uniform(0.2, 0.6) * strong
    return cast(AnyArray, cv2.Canny(kept, weak, strong, apertureSize=aperture)) > 0


DETECTORS: dict[str, _Detector] = {
    detector.__name__: detector
    for detector in (ridges, gradients, zero_crossings, levels, local_levels, opencv_canny)
}


def detectors(rng: np.random.Generator, mask: ByteArray) -> _Drawn:
    """Find edges near the border of an organ in a grey slice, by one of `DETECTORS`."""
    image = draw_image(rng, mask)
    found = DETECTORS[str(rng.choice([*DETECTORS]))](rng, image)
    border = _outline(mask) > 0
    return found & (distance_to_zero((~border).astype(np.uint8)) <= rng.uniform(*_BAND_PX)), image


FAMILIES: dict[str, Callable[[np.random.Generator, ByteArray], _Drawn]] = {
    family.__name__: family for family in (label_maps, elastic, detectors)
}
