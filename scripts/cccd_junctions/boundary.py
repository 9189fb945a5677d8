"""From a slice to its boundary pixels: Gaussian blur, 5x5 dilation XOR, edges (section 4.3, Algorithm 1).

On a mask the exclusive-or of the mask and its dilation is the band of background that touches the organ,
and the boundary is the mask's own pixels that share an edge with that band: the outline that border
following visits, so that polygons through these pixel centres are exact. Blurring is for grey images; a
mask has no noise and blurring would only round it off. On a grey image the dilation and the erosion of
the rough region differ by the band in which the boundary is sought, and the edges are Canny's. Where the
image shows none, the region's own border stands in.
"""

from __future__ import annotations

import cv2
import numpy as np
import scipy

from cccd.containers import Boundaries, Curves, Frame, Structure
from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray, offsets_of, ranks_of
from cccd.geometry.opencv import distance_to_zero
from cccd.settings.junctions import BoundarySettings

#: Side of the square dilation kernel in pixels (section 4.3).
KERNEL = 5

#: Slices that are filtered together: enough to vectorise, few enough to stay small in memory.
BLOCK = 32

# Canny's lower threshold, as a share of the upper one: Canny (1986) recommends two or three to one.
_HYSTERESIS = 0.4

# The steepest slope, in the whole numbers that OpenCV takes.
_STEEPEST = 2**14

# Where no edge is within so many pixels of a rough region's border, the border stands in its place: of 2.5, 4
# and 6 as good as any on phantoms.
_NO_EDGE_PX = 4.0

# The grey window reaches so many of the organ's own grey ranges beyond them on either side: bone and air
# beside an organ would outshine its border.
_GREY_RANGES = 3.0


def extract_boundaries(structure: Structure, settings: BoundarySettings) -> Boundaries:
    """Find the boundary pixels of every slice.

    Parameters
    ----------
    structure : Structure
        A boundary stack is passed on as it is. Ordered contours (RTSTRUCT) need no boundary; their
        pixels are given for display. Around a region it is sought in the image, and a mask beside it is not
        looked at. A mask's is its outline, or with ``source: image`` the image's edges around it.
    settings : BoundarySettings

    Returns
    -------
    Boundaries
        Integer pixels (i, j) of the source volume; slices without any are left out.

    Raises
    ------
    InputError
        When the wanted source is not there or no slice has a boundary.
    """
    if structure.contours is not None:
        return _draw(structure.contours, structure.frame)
    match structure.input:
        case "region":
            image, region = structure.required_stack("image"), structure.required_stack("region")
            maps = edge_map(image, region, settings)
        case "mask":
            maps = _boundary_of_mask(structure, settings)
        case other:
            maps = structure.required_stack(other)
    if not maps.any():
        location = f"{structure.case}/{structure.organ}"
        raise InputError(location, "no slice has a boundary", "check the label, the threshold or the image")
    return _ragged(maps, structure.stack_origin, structure.frame)


def _boundary_of_mask(structure: Structure, settings: BoundarySettings) -> np.ndarray:
    """Boundary pixels (S, I, J) of a mask, or of the image around it where the settings ask for that."""
    mask = structure.required_stack("mask")
    if settings.source != "image":
        return outline(mask)
    image = structure.stack("image")
    if image is None:
        hint = "set boundaries.source to auto or name the image in the sheet"
        raise InputError(f"{structure.case}/{structure.organ}", "there is no image", hint)
    return edge_map(image, mask, settings)


def dilation_band(region: np.ndarray) -> np.ndarray:
    """Exclusive-or of each slice of a stack (S, I, J) with its dilation by the 5x5 kernel."""
    return _dilate(region) ^ region


def outline(mask: np.ndarray) -> np.ndarray:
    """Border pixels of each slice of a mask (S, I, J): those that share an edge with the background.

    Outer borders and borders of holes alike; what lies outside the array is background.
    """
    padded = np.pad(mask, ((0, 0), (1, 1), (1, 1)))
    band = dilation_band(padded)
    beside = band[:, :-2, 1:-1] | band[:, 2:, 1:-1] | band[:, 1:-1, :-2] | band[:, 1:-1, 2:]
    return mask & beside


def edge_map(image: np.ndarray, region: np.ndarray | None, settings: BoundarySettings) -> np.ndarray:
    """Find Canny edges of each slice of a grey stack within a band around a rough region.

    Parameters
    ----------
    image : (S, I, J) float array
        Grey values; NaN counts as the lowest value.
    region : (S, I, J) bool array or None
        Where the organ roughly is; None searches the whole slices.
    settings : BoundarySettings
        The band is ``2 * dilations`` pixels wide on each side of the region's border; Canny's upper
        threshold is the ``edge_quantile`` of its gradient magnitudes, over all slices.

    Returns
    -------
    (S, I, J) bool array
        Where the image shows no edge near the region's border, with the pixels of that border.
    """
    image = np.nan_to_num(image, nan=float(np.nanmin(image)) if np.isfinite(image).any() else 0.0)
    band = np.ones(image.shape, bool) if region is None else _band_around(region, settings.dilations)
    if region is not None and region.any():
        # a window round the organ's own grey values: bone and air beside it would outshine its border
        low, high = np.percentile(image[region], (1, 99))
        beyond = _GREY_RANGES * (high - low)
        image = np.clip(image, low - beyond, high + beyond)
    ridge = np.zeros(image.shape, np.float32)
    sample: list[AnyArray] = []
    for first in range(0, len(image), BLOCK):
        block = slice(first, first + BLOCK)
        magnitude, thin = gradient_ridges(image[block], settings.blur_px)
        sample.append(magnitude[band[block]])
        ridge[block] = np.where(thin & band[block], magnitude, 0)
    gradients = np.concatenate(sample)
    if gradients.size == 0:
        return np.zeros(image.shape, bool)
    upper = np.quantile(gradients, settings.edge_quantile)
    candidates = ridge > _HYSTERESIS * upper
    in_plane = [[[0] * 3] * 3, [[1] * 3] * 3, [[0] * 3] * 3]
    labels, count = scipy.ndimage.label(candidates, structure=in_plane)
    strong = np.zeros(count + 1, bool)
    strong[labels[ridge > upper]] = True
    strong[0] = False
    edges = strong[labels]
    return edges if region is None else edges | _border_without_edges(region, edges)


def _border_without_edges(region: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Border pixels of each slice of a region (S, I, J) that have no edge near by."""
    border = outline(region)
    for layer, seen in zip(border, edges, strict=True):
        if layer.any() and seen.any():
            layer &= distance_to_zero(~seen) > _NO_EDGE_PX
    return border


def _band_around(region: np.ndarray, dilations: int) -> np.ndarray:
    """Dilated region XOR eroded region, the kernel applied several times."""
    grown = shrunk = region
    for _ in range(dilations):
        grown, shrunk = _dilate(grown), ~_dilate(~shrunk)
    return grown ^ shrunk


def _dilate(stack: np.ndarray) -> np.ndarray:
    """Dilate each slice by the square kernel."""
    grown = [cv2.dilate(layer, np.ones((KERNEL, KERNEL), np.uint8)) for layer in stack.view(np.uint8)]
    return np.reshape(grown, stack.shape).astype(bool)


def gradient_ridges(image: np.ndarray, blur_px: float) -> tuple[np.ndarray, np.ndarray]:
    """Gradient magnitude of the blurred slices, and where it is a maximum along its own direction.

    Parameters
    ----------
    image : (S, I, J) array
    blur_px : float
        Standard deviation of the Gaussian, in pixels.

    Returns
    -------
    magnitude : (S, I, J) float32 array
        By Sobel's kernels, eight times the slope per pixel.
    thin : (S, I, J) bool array
    """
    blurred = scipy.ndimage.gaussian_filter(image.astype(np.float32), (0, blur_px, blur_px), mode="nearest")
    along_i, along_j = (scipy.ndimage.sobel(blurred, axis=axis, mode="nearest") for axis in (1, 2))
    magnitude = np.hypot(along_i, along_j)
    scale = np.float32(_STEEPEST / (float(magnitude.max(initial=0)) or 1))
    slopes = (np.rint(scale * slope).astype(np.int16) for slope in (along_j, along_i))
    thin: list[AnyArray] = [cv2.Canny(x, y, 0, 0, L2gradient=True) > 0 for x, y in zip(*slopes, strict=True)]
    return magnitude, np.reshape(thin, magnitude.shape)


def _ragged(maps: np.ndarray, origin: np.ndarray, frame: Frame) -> Boundaries:
    layer, i, j = np.nonzero(maps)
    points = np.column_stack([i + origin[1], j + origin[2]]).astype(np.int32)
    slices, counts = np.unique(layer, return_counts=True)
    return Boundaries(points, offsets_of(counts), (slices + origin[0]).astype(np.int32), frame)


def _draw(contours: Curves, frame: Frame) -> Boundaries:
    """Pixels that closed polygons pass through, sampled every half pixel."""
    start, step = contours.points, contours.polygons.steps
    pieces = np.maximum(np.ceil(2 * np.abs(step).max(axis=1, initial=0)), 1).astype(np.int64)
    edge = np.repeat(np.arange(len(start)), pieces)
    share = ranks_of(pieces) / pieces[edge]
    pixels = np.rint(start[edge] + share[:, None] * step[edge]).astype(np.int64)
    k = np.asarray(contours.slice, np.int64)[contours.polygons.owners][edge]
    unique = np.unique(np.column_stack([k, pixels]), axis=0)
    slices, counts = np.unique(unique[:, 0], return_counts=True)
    return Boundaries(unique[:, 1:].astype(np.int32), offsets_of(counts), slices.astype(np.int32), frame)
