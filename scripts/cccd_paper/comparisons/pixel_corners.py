"""Corner detectors on pixels: Harris, Shi-Tomasi, FAST (OpenCV) and SUSAN.

All accept an 8-bit image (I, J) and return corner pixels (K, 2) in (i, j), in raster order.
"""

from __future__ import annotations

import cv2
import numpy as np


def _in_raster_order(pixels: np.ndarray) -> np.ndarray:
    pixels = np.asarray(pixels, np.int64).reshape(-1, 2)
    return pixels[np.lexsort(pixels.T[::-1])]


def _peaks(response: np.ndarray, radius: int) -> np.ndarray:
    """Pixels (I, J) bool whose response is the largest within a square of this radius."""
    return response >= cv2.dilate(response, np.ones((2 * radius + 1, 2 * radius + 1), np.uint8))


def harris(
    image: np.ndarray, block: int, aperture: int, k: float, threshold: float = 0.01, radius: int = 0
) -> np.ndarray:
    """Harris and Stephens' corners (Alvey Vision Conference 1988).

    Parameters
    ----------
    image : (I, J) uint8
    block, aperture, k : int, int, float
        Neighbourhood, Sobel aperture and free parameter of `cv2.cornerHarris`.
    threshold : float
        Share of the largest response that a corner exceeds. The paper names none; 0.01 is the customary
        value.
    radius : int
        Keep only the largest response within this many pixels; 0 keeps all, as the paper must have done
        to find 716 corners on one slice.
    """
    response = cv2.cornerHarris(np.ascontiguousarray(image, np.float32), block, aperture, k)
    if response.max() <= 0:
        return np.zeros((0, 2), np.int64)
    strong = response > threshold * response.max()
    return np.argwhere(strong & _peaks(response, radius) if radius else strong)


def shi_tomasi(image: np.ndarray, max_corners: int, quality: float, distance: float) -> np.ndarray:
    """Shi and Tomasi's good features to track (CVPR 1994).

    Parameters
    ----------
    image : (I, J) uint8
    max_corners, quality, distance : int, float, float
        Largest number of corners, least share of the best response, and least distance in pixels.
    """
    found = cv2.goodFeaturesToTrack(image, max_corners, quality, distance)
    columns_rows = np.zeros((0, 2)) if found is None else np.rint(found.reshape(-1, 2))
    return _in_raster_order(columns_rows[:, ::-1])


def fast(image: np.ndarray, threshold: int = 10, suppress: bool = True) -> np.ndarray:
    """Rosten and Drummond's FAST-9 corners (ECCV 2006).

    Parameters
    ----------
    image : (I, J) uint8
    threshold : int
        Grey-value difference between the centre and nine contiguous pixels of the circle.
    suppress : bool
        Keep only local maxima of the score. Both as OpenCV's defaults, the paper names no parameter.
    """
    found = cv2.FastFeatureDetector.create(threshold, suppress).detect(np.ascontiguousarray(image))
    columns_rows = np.rint(cv2.KeyPoint.convert(found)) if found else np.zeros((0, 2))
    return _in_raster_order(columns_rows[:, ::-1])


# Offsets of SUSAN's 37-pixel disc of radius 3.4.
_DISC = np.array([(i, j) for i in range(-3, 4) for j in range(-3, 4) if i * i + j * j <= 3.4**2])
_NUCLEUS = int(np.flatnonzero((_DISC == 0).all(1))[0])


def susan(image: np.ndarray, contrast: float = 25.0, share: float = 0.5, radius: int = 2) -> np.ndarray:
    """Smith and Brady's SUSAN corners (Int. J. Comput. Vis. 23 (1997) 45-78).

    The area of the disc that looks like its nucleus (the USAN) is small at a corner. A corner needs an
    area below ``share`` of the disc, a USAN whose centroid lies away from the nucleus and whose pixels
    from the nucleus towards the centroid are all of the USAN, and the least area around.

    Parameters
    ----------
    image : (I, J) uint8
    contrast : float
        Grey-value difference t in ``exp(-((I(r) - I(r0)) / t)**6)``.
    share : float
        Geometric threshold g over the largest area: 0.5 for corners.
    radius : int
        Radius in pixels of the non-maximum suppression; 2 is a window of 5 x 5.
    """
    grey = np.asarray(image, np.float32)
    rows, columns = grey.shape
    padded = np.pad(grey, 3, mode="edge")
    alike = np.empty((len(_DISC), rows, columns), np.float32)
    for plane, (i, j) in zip(alike, _DISC, strict=True):
        plane[:] = np.exp(-(((padded[3 + i : 3 + i + rows, 3 + j : 3 + j + columns] - grey) / contrast) ** 6))
    area = alike.sum(0)
    response = np.maximum(share * len(_DISC) - area, 0)
    centroid = np.tensordot(_DISC.T.astype(np.float32), alike, axes=(1, 0)) / area
    reach = np.hypot(*centroid)
    candidates = np.argwhere((response > 0) & (reach > 1) & _peaks(response, radius))

    # The pixels one, two and three steps from the nucleus towards the centroid.
    towards = (centroid / np.maximum(reach, 1))[:, candidates[:, 0], candidates[:, 1]]
    steps = np.rint(towards.T[:, None] * np.arange(1, 4)[:, None]).astype(np.int64)
    number = np.full((7, 7), -1)
    number[_DISC[:, 0] + 3, _DISC[:, 1] + 3] = np.arange(len(_DISC))
    ray = number[steps[..., 0] + 3, steps[..., 1] + 3]
    likeness = alike[np.where(ray >= 0, ray, _NUCLEUS), candidates[:, :1], candidates[:, 1:]]
    return candidates[(likeness > 0.5).all(1)]
