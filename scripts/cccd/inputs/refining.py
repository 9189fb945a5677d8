"""A mask's border moved to the image's edges near by, below the pixel.

A segmenter knows where an organ is, and the image where its border runs. On either side of the border, the
grey values near by have a mean; the border is where the image is half-way between the two, as in localised
active contours (Lankton and Tannenbaum 2008). That counts as much as the two sides differ, compared with how
much each varies; where they do not, the border stays.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from cccd.geometry.arrays import AnyArray, FloatArray, SingleArray
from cccd.geometry.opencv import distance_to_zero

__all__ = ["refine_border"]

#: The border moves by this at most, pixels. 3 did as well on phantoms.
_REACH_PX = 2.0

#: Grey values of the two sides: from this distance from the border on, and over this width (standard
#: deviation), pixels. 3 and 4 did as well on phantoms.
_AWAY_PX, _WIDTH_PX = 1.5, 3.0

#: A contrast of this multiple of the variation on the sides counts as much as the mask; 1.4 and 3 did
#: as well.
_EVEN_ODDS = 2.0

#: Blur of the image, pixels: less than a scanner's own.
_BLUR_PX = 0.5


def refine_border(image: SingleArray, inside: AnyArray, slice_axis: int) -> SingleArray:
    """Move the border of a mask, or of probabilities, to the image's edges, slice by slice.

    Parameters
    ----------
    image : (a, b, c) float32
        Grey values.
    inside : (a, b, c) bool or float32
        The mask, or probabilities.
    slice_axis : int
        Axis along which slices run.

    Returns
    -------
    (a, b, c) float32
        Probabilities, one half on the border.

    Examples
    --------
    >>> import numpy as np
    >>> i = np.indices((40, 40, 3))[0]
    >>> image = np.clip(i - 19.7, -0.5, 0.5).astype(np.float32)  # an edge at 19.7
    >>> found = refine_border(image, i >= 21, 2)[:, 20, 1]
    >>> int(np.flatnonzero(found >= 0.5)[0])
    20
    """
    slices, masks = (np.moveaxis(volume, slice_axis, 0) for volume in (image, inside))
    refined = np.stack([_refine(grey, mask) for grey, mask in zip(slices, masks, strict=True)])
    return np.ascontiguousarray(np.moveaxis(refined, 0, slice_axis))


def _refine(grey: SingleArray, inside: AnyArray) -> SingleArray:
    """Refine one slice (I, J)."""
    mask = inside if inside.dtype == bool else inside >= 0.5
    away = _signed_distance(mask)
    own = np.clip(0.5 + away / 2, 0, 1) if inside.dtype == bool else inside
    if not mask.any() or mask.all():
        return own.astype(np.float32)
    smooth = ndimage.gaussian_filter(grey.astype(np.float64), _BLUR_PX)
    near = np.abs(away) < _AWAY_PX + 2 * _WIDTH_PX
    within, spread_within, known_within = _local(smooth, near & (away > _AWAY_PX))
    around, spread_around, known_around = _local(smooth, near & (away < -_AWAY_PX))
    contrast, spread = within - around, spread_within + spread_around
    squared = contrast**2
    weight = squared / np.maximum(squared + _EVEN_ODDS**2 * spread / 2, 1e-12)
    weight[(np.abs(away) > _REACH_PX) | ~(known_within & known_around)] = 0
    flat = np.where(contrast == 0, 1, contrast)
    edge = np.clip(0.5 + (smooth - (within + around) / 2) / flat, 0, 1)
    return (own + weight * (edge - own)).astype(np.float32)


def _signed_distance(mask: AnyArray) -> SingleArray:
    """Signed distance (I, J) in pixels to a mask's border, positive inside."""
    return distance_to_zero(mask) - distance_to_zero(~mask) + np.where(mask, -0.5, 0.5).astype(np.float32)


def _local(values: FloatArray, where: AnyArray) -> tuple[FloatArray, FloatArray, AnyArray]:
    """Mean and variance of values near every pixel, of those of a mask; and where there are any."""
    sums = [ndimage.gaussian_filter(where * values**power, _WIDTH_PX, truncate=3.0) for power in range(3)]
    count = np.maximum(sums[0], 1e-3)
    mean = sums[1] / count
    return mean, np.maximum(sums[2] / count - mean**2, 0), sums[0] > 1e-3
