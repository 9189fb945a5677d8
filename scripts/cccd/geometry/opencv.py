"""OpenCV's image operations, with types that a checker understands."""

from __future__ import annotations

from typing import Any, TypeVar, cast

import cv2
import numpy as np
import numpy.typing as npt

from cccd.geometry.arrays import AnyArray, BoolArray, ByteArray, IntArray, SingleArray

_Number = TypeVar("_Number", np.uint8, np.float32)


def gaussian_blur(image: npt.NDArray[_Number], sigma_px: float) -> npt.NDArray[_Number]:
    """Blur an image (I, J) by a Gaussian."""
    return cast(npt.NDArray[_Number], cv2.GaussianBlur(image, (0, 0), sigma_px))


def sobel(image: ByteArray | SingleArray) -> tuple[SingleArray, SingleArray]:
    """Differentiate an image (I, J) along j and along i by Sobel's kernels: eight times its slope."""
    orders = ((1, 0), (0, 1))
    along_j, along_i = (cast(SingleArray, cv2.Sobel(image, cv2.CV_32F, *order)) for order in orders)
    return along_j, along_i


def distance_to_zero(mask: ByteArray | BoolArray, exact: bool = False) -> SingleArray:
    """Distance (I, J) in pixels of every pixel to the nearest zero, by steps (chamfer) or exactly."""
    size = cv2.DIST_MASK_PRECISE if exact else cv2.DIST_MASK_3
    far = cast(SingleArray, cv2.distanceTransform(mask.view(np.uint8), cv2.DIST_L2, size))
    return np.sqrt(np.rint(far * far)) if exact else far  # whole squares: the last bits differ by the call


def components(mask: ByteArray, connectivity: int) -> tuple[IntArray, IntArray]:
    """Label each pixel (I, J) with its component, 0 where the mask is, and count the pixels (C,) of each."""
    _, labels, stats, _ = cast(Any, cv2).connectedComponentsWithStats(mask, connectivity=connectivity)
    return labels, stats[:, cv2.CC_STAT_AREA]


def borders_of(mask: AnyArray) -> tuple[list[IntArray], BoolArray]:
    """Borders of a mask (I, J): the ordered pixels (N, 2) of each as (i, j), and which are of holes."""
    found, links = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    holes = np.zeros(0, np.bool_) if not found else links[0, :, 3] >= 0
    return [contour[:, 0, ::-1].astype(np.int64) for contour in found], holes


def border_pixels(mask: AnyArray) -> list[IntArray]:
    """Ordered pixels (N, 2) as (i, j) of every border of a mask (I, J), holes' included."""
    return borders_of(mask)[0]
