"""Grey slices as the network reads them, and the edges in them that a boundary map lacks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np

from cccd.geometry.arrays import AnyArray, BoolArray, ByteArray, IntArray, RealArray, SingleArray
from cccd.geometry.opencv import components, distance_to_zero, gaussian_blur, sobel
from cccd.tolerances import CONTRAST
from cccd_junctions.boundary import gradient_ridges
from cccd_junctions.delaunay import HASHES, pixel_hash

#: Blurs of the equalised intensity in pixels, and how far to either side of a link each is read.
BLURS = ((1.0, 1.5), (2.5, 3.5))

# Bins of grey values that are ranked.
_BINS = 1024

# Least slope of a further edge of the image, in medians of the slice's: between the two of 1, 1.5 and 2.5
# under which the true labels did best.
_EDGE_SLOPE = 1.25

# Shorter edges are noise, whose ridges are short.
_SHORTEST_EDGE_PX = 4

# Further edges at most, and for each pixel of the map besides: a bound on the time that a textured slice
# takes.
_MOST_EDGES = 60
_MOST_EDGES_PER_PIXEL = 0.75

# An edge's slope counts half at this distance from the map, most gaps of which are narrower.
_HALF_AWAY_PX = 8.0

# Edges nearer than this to a pixel of the map touch it.
_TOUCHING_PX = 1.9


@dataclass(frozen=True, eq=False)
class IntensitySlice:
    """A grey slice around a boundary map's pixels.

    Attributes
    ----------
    scaled : (I, J) uint8
        1 % and 99 % quantiles at 0 and 255.
    blurred : (I, J) float32
        In the image's own units.
    channels : (I, J, 2 + len(BLURS)) uint8
        ``scaled``; ranks among the grey values (equalised), so that bone and air beside it leave an organ
        its contrast, one per blur; and the rank of the gradient's magnitude.
    origin : (2,) int array
        Pixel of the arrays' first elements.
    """

    scaled: ByteArray
    blurred: SingleArray
    channels: ByteArray
    origin: IntArray


def _ranks(values: SingleArray, low: float, high: float) -> ByteArray:
    """Assign each value (I, J) its rank among all, 0 to 255; alike ones rank in the middle of their own."""
    bins = np.clip((values - low) * ((_BINS - 1) / max(high - low, CONTRAST)), 0, _BINS - 1).astype(np.uint16)
    counts = np.bincount(bins.ravel(), minlength=_BINS)
    middle = np.cumsum(counts) - counts / 2
    return (middle * (255 / values.size)).astype(np.uint8)[bins]


def normalised_intensity(image: RealArray, pixels: AnyArray) -> IntensitySlice:
    """Normalise a grey slice (I, J) around the pixels (N, 2)."""
    low = np.clip(pixels.min(axis=0) - 12, 0, np.array(image.shape) - 1)
    high = np.maximum(pixels.max(axis=0) + 13, low + 1)
    around = np.ascontiguousarray(image[low[0] : high[0], low[1] : high[1]], np.float32)
    darkest, dark, bright, brightest = np.percentile(around, (0.2, 1, 99, 99.8))
    scaled = np.clip((around - dark) * (255 / max(bright - dark, CONTRAST)), 0, 255).astype(np.uint8)
    scaled = gaussian_blur(scaled, 0.8)
    blurred = gaussian_blur(around, BLURS[0][0])
    ranks = _ranks(blurred, darkest, brightest)
    rest = np.sqrt(BLURS[1][0] ** 2 - BLURS[0][0] ** 2)
    slope = cast(SingleArray, cv2.magnitude(*sobel(blurred)))
    steep = _ranks(slope, 0.0, 2 * float(brightest - darkest))
    channels = np.dstack([scaled, ranks, gaussian_blur(ranks, rest), steep])
    return IntensitySlice(scaled, blurred, channels, low)


def sample_channels(intensity: IntensitySlice, points: AnyArray) -> SingleArray:
    """Channels (..., 2 + len(BLURS)) in 0..1 at the pixels nearest to points (..., 2)."""
    i, j = np.moveaxis(np.rint(points - intensity.origin).astype(np.int64), -1, 0)
    rows, columns, _ = intensity.channels.shape
    samples = intensity.channels[np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1)]
    return np.divide(samples, 255, dtype=np.float32)


def image_edges(intensity: IntensitySlice, pixels: AnyArray) -> IntArray:
    """Find places on edges of a grey slice that the boundary map lacks.

    An edge detector with one threshold leaves out what is weak beside the strongest edges of the slice.
    Of the gradient's ridges (Canny 1986) that the map is without, about every other pixel is taken, the
    steepest and nearest first.

    Parameters
    ----------
    intensity : IntensitySlice
    pixels : (N, 2) int array
        The boundary map (i, j).

    Returns
    -------
    (E, 2) int64 array
        Pixels (i, j) in raster order, none of which touches another or the map.
    """
    shape = intensity.blurred.shape
    slope, thin = (part[0] for part in gradient_ridges(intensity.blurred[None], 0.0))
    ridge = (thin & (slope > _EDGE_SLOPE * np.median(slope))).astype(np.uint8)
    labels, areas = components(ridge, connectivity=8)
    long = areas >= _SHORTEST_EDGE_PX
    long[0] = False
    empty = np.ones(shape, np.uint8)
    local = pixels - intensity.origin
    empty[tuple(local[((local >= 0) & (local < shape)).all(axis=1)].T)] = 0
    away = distance_to_zero(empty)
    kept = _apart(np.where(long[labels] & (away > _TOUCHING_PX), slope, 0))
    places = np.argwhere(kept)
    most = int(_MOST_EDGES + _MOST_EDGES_PER_PIXEL * len(pixels))
    if len(places) > most:
        worth = slope[kept] * _HALF_AWAY_PX / (_HALF_AWAY_PX + away[kept])
        places = places[np.sort(np.argsort(-worth, kind="stable")[:most])]
    return places + intensity.origin


def _apart(strength: SingleArray) -> BoolArray:
    """Choose pixels (I, J) of positive strength of which none touches another, the strongest first."""
    # steps of a hash make neighbours differ, so that of each plateau one is the largest
    i, j = np.mgrid[: strength.shape[0], : strength.shape[1]]
    steps = 1 + 1e-3 / HASHES * pixel_hash(i, j)
    strength = (strength * steps).astype(np.float32)
    kept = np.zeros(strength.shape, bool)
    around = np.ones((3, 3), np.uint8)
    for _ in range(3):  # largest first; what touches one is out
        chosen = (strength > 0) & (strength == cv2.dilate(strength, around))
        kept |= chosen
        strength = np.where(cv2.dilate(chosen.astype(np.uint8), around) > 0, np.float32(0), strength)
    return kept
