"""The slices a structure is compared on, and what every planar comparison needs of each.

Every method is judged on the slice's longest outer curve: the paper's ground truth is one closed
boundary. Slices are spread evenly over those whose longest curve is long enough to be worth a curve
method; the choice depends on nothing else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from cccd.containers import Boundaries, Curves, Frame, Structure
from cccd.geometry.arrays import concatenate_ragged, offsets_of
from cccd.geometry.raster import dice, rasterise
from cccd_junctions.boundary import outline

_Stack = TypeVar("_Stack", Boundaries, Curves)

#: Pixels of background around the curve, so that what leaks out of it is seen.
MARGIN = 8


@dataclass(frozen=True)
class SliceSample:
    """One slice with its ground truth.

    Attributes
    ----------
    k : int
        Source index of the slice.
    curve : (n, 2) float64
        Longest outer curve, ordered, in source (i, j).
    boundary : (p, 2) float64
        Points of all curves of the slice.
    origin : (2,) int64
        Source index (i, j) of the window's first pixel.
    region : (I, J) bool
        Pixels within `curve`: what a method should enclose.
    images : dict of str to (I, J) uint8
        ``mask``: all curves of the slice filled, 0 or 255; ``outline``: its boundary pixels, the image that
        line 10 of Algorithm 1 leaves; ``grey``: the grey slice when there is one.
    """

    k: int
    curve: np.ndarray
    boundary: np.ndarray
    origin: np.ndarray
    region: np.ndarray
    images: dict[str, np.ndarray]

    @property
    def picture(self) -> str:
        """Which of the images a figure shows: the grey slice where there is one."""
        return "grey" if "grey" in self.images else "mask"

    @property
    def window(self) -> np.ndarray:
        """First and last pixel (2, 2) of the images."""
        return np.array([self.origin, self.origin + self.region.shape - 1])

    def dice_percent(self, curve: np.ndarray) -> float:
        """Dice score in percent of what a curve (n, 2) in source (i, j) encloses."""
        enclosed = rasterise([curve] if len(curve) else [], self.origin, self.region.shape)
        return 100 * float(dice(self.region, enclosed))


#: Slices with shorter contours are not taken: a curve needs room for the longest k of the sweep.
MIN_CONTOUR_PX = 60.0


def choose_slices(
    structure: Structure, curves: Curves, n_slices: int, min_contour_px: float = MIN_CONTOUR_PX
) -> list[SliceSample]:
    """Take ``n_slices`` slices, spread evenly over those with a curve of ``min_contour_px`` points or more.

    A structure with fewer such slices gives them all; one with none gives its longest curve's slice.

    Parameters
    ----------
    structure : Structure
        Its grey image, if any, is windowed to 8 bit (see `to_bytes`).
    curves : Curves
        The ordered curves, taken as the truth.
    """
    length = np.where(curves.hole, 0, np.diff(curves.offsets))
    slices, number = np.unique(curves.slice, return_inverse=True)
    if not len(slices):
        return []
    longest = np.zeros(len(slices), np.int64)
    np.maximum.at(longest, number, length)
    fit = np.flatnonzero(longest >= min(min_contour_px, longest.max()))
    count = min(n_slices, len(fit))
    places = ((np.arange(count) + 0.5) * len(fit) / count).astype(np.int64)
    stack = structure.stack("image")
    grey = None if stack is None else to_bytes(stack, structure.stack("mask"))
    return [_sample(structure, curves, length, int(slices[place]), grey) for place in fit[places]]


def middle_slice(structure: Structure, curves: Curves, n_slices: int) -> SliceSample | None:
    """Take the slice that figures show: the middle one of those compared; None without any curve."""
    samples = choose_slices(structure, curves, n_slices)
    return samples[len(samples) // 2] if samples else None


def _sample(
    structure: Structure, curves: Curves, length: np.ndarray, k: int, grey: np.ndarray | None
) -> SliceSample:
    members = np.flatnonzero(curves.slice == k)
    polygons = [curves.points[curves.offsets[c] : curves.offsets[c + 1]] for c in members]
    main = polygons[int(np.argmax(length[members]))]
    boundary = np.concatenate(polygons)
    origin = np.floor(boundary.min(0)).astype(np.int64) - MARGIN
    shape = tuple(np.ceil(boundary.max(0)).astype(np.int64) + MARGIN + 1 - origin)
    filled = rasterise(polygons, origin, shape)
    images = {"mask": _black_and_white(filled), "outline": _black_and_white(outline(filled[None])[0])}
    if grey is not None:
        k0, *corner = structure.stack_origin
        images["grey"] = _window(grey[k - k0], origin - corner, shape)
    region = rasterise([main], origin, shape)
    return SliceSample(k, main, boundary, origin, region, images)


def _black_and_white(pixels: np.ndarray) -> np.ndarray:
    """Pixels that are set (I, J) as an image of 0 and 255."""
    return np.where(pixels, np.uint8(255), np.uint8(0))


def _window(image: np.ndarray, first: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Cut a window out of an image, its edge pixels repeated beyond the edge."""
    rows, columns = (
        np.clip(np.arange(start, start + size), 0, limit - 1)
        for start, size, limit in zip(first, shape, image.shape, strict=True)
    )
    return np.ascontiguousarray(image[np.ix_(rows, columns)])


def to_bytes(stack: np.ndarray, organ: np.ndarray | None = None) -> np.ndarray:
    """Grey values as 8 bit, windowed as a reader would set it for the organ.

    The window is the organ's median plus and minus twice the width of its middle nine tenths, so that its
    edge is not lost between air and bone; without a mask it is the stack's 1st to 99th percentile.

    Parameters
    ----------
    stack : (S, I, J)
        Grey values; what is not finite becomes the window's lower end.
    organ : (S, I, J) bool, optional
    """
    finite = np.isfinite(stack)
    values = stack[finite & organ] if organ is not None else stack[finite]
    if not values.size:
        return np.zeros(stack.shape, np.uint8)
    if organ is None:
        low, high = np.percentile(values, (1, 99))
    else:
        few, middle, most = np.percentile(values, (5, 50, 95))
        low, high = middle - 2 * (most - few), middle + 2 * (most - few)
    scaled = np.where(finite, stack - low, 0) * (255 / max(high - low, np.finfo(np.float32).tiny))
    return np.clip(np.rint(scaled), 0, 255).astype(np.uint8)


def middle_slab(structure: Structure, curves: Curves, most_slices: int) -> tuple[Structure, Curves, range]:
    """Cut a slab of adjacent slices out of the organ's middle, as a scan of its own; all where it fits.

    Returns
    -------
    structure, curves
        Of the slab, whose slices are counted from its first.
    slices : range
        Which slices of the scan they are.
    """
    used = np.unique(curves.slice)
    if len(used) <= most_slices:
        return structure, curves, range(structure.frame.shape[structure.frame.slice_axis])
    first, *_, last = (int(k) for k in used[(len(used) - most_slices) // 2 :][:most_slices])
    frame, axis = structure.frame, structure.frame.slice_axis
    affine = frame.affine.copy()
    affine[:3, 3] += first * affine[:3, axis]
    a, b, c = (last - first + 1 if along == axis else size for along, size in enumerate(frame.shape))
    slab = Frame(affine, axis, (a, b, c))
    begin = first - int(structure.origin[axis])
    mask = np.moveaxis(structure.required_stack("mask")[begin : begin + last - first + 1], 0, axis)
    origin = np.array(structure.origin)
    origin[axis] = 0
    cut = replace(structure, frame=slab, origin=origin, mask=mask, image=None, truth=None, contours=None)
    slices = range(first, last + 1)
    return cut, between(curves, slices, slab), slices


def between(stack: _Stack, slices: range, frame: Frame) -> _Stack:
    """Take what lies on adjacent slices, counted from the first of them."""
    chosen = np.isin(stack.slice, slices)
    size = np.diff(stack.offsets)
    kept = {
        "points": stack.points[np.repeat(chosen, size)],
        "offsets": offsets_of(size[chosen]),
        "slice": (stack.slice[chosen] - slices.start).astype(stack.slice.dtype),
        "frame": frame,
    }
    return replace(stack, **kept, **({"hole": stack.hole[chosen]} if isinstance(stack, Curves) else {}))


def outer_curves(polygons: Sequence[np.ndarray], slices: Sequence[int] | np.ndarray, frame: Frame) -> Curves:
    """Make outer curves of polygons (n, 2), and of the slices (C,) that each lies on."""
    points, offsets = concatenate_ragged(polygons)
    return Curves(points, offsets, np.asarray(slices, np.int32), np.zeros(len(polygons), bool), frame)


def middle_curve(curves: Curves) -> Curves | None:
    """Take the longest outer curve of the middle slice; None when there is none."""
    outer = np.flatnonzero(~curves.hole)
    if len(outer) == 0:
        return None
    slices = np.unique(curves.slice[outer])
    here = outer[curves.slice[outer] == slices[len(slices) // 2]]
    sizes = np.diff(curves.offsets)[here]
    chosen = here[np.argmax(sizes)]
    part = slice(curves.offsets[chosen], curves.offsets[chosen + 1])
    return outer_curves([curves.points[part]], curves.slice[[chosen]], curves.frame)
