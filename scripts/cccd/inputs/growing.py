"""An organ grown from a seed: where somebody points into a grey image, what is of the same tissue around.

The seed's tissue is a mode of the smoothed image's grey values, between the nearest valleys. What lies in
this range and hangs together with the seed by more than a neck is the organ; what is even and of other tissue
is not; a watershed of the gradient (Vincent and Soille 1991) draws the border in between, where voxels are of
both. The result is rough: the boundary is sought in the image's edges around it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np
from scipy import ndimage

from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray, IntArray, SingleArray
from cccd.seeds import Seed

__all__ = ["GrownRegion", "grow_region"]

#: Voxels that are looked at: finer scans are averaged over blocks first. Twice as many took twice as long on
#: phantoms, and the region's Dice gained 0.004.
_MOST_VOXELS = 800_000

#: Rounds, time step and conductance of the smoothing that keeps edges; the step is the largest stable one.
_ROUNDS, _STEP, _CONDUCTANCE = 10, 0.0625, 3.0

#: Around a voxel, the seed's tissue is looked at to this distance, mm: about what a person points at.
_SEED_MM = 6.0

#: A voxel is even where its slope is below this share of the noise; of 0.25, 0.5 and 1 as good as any.
_EVEN = 0.5

#: A box may show several tissues of the organ: their range begins and ends between these quantiles of it.
_BOX_SHARES = (0.001, 0.05, 0.95, 0.999)

#: Grey values are smoothed to this width, in noise, before their valleys are sought. On phantoms, 0.2 took in
#: the heart beside a liver, 15 HU brighter, and 0.08 lost the mode of some seeds.
_VALLEY_WIDTH = 0.14

#: A valley ends where the values rise to this multiple of its depth. Below this share of the mode it is
#: empty; tissue goes on this far into a wide empty one, where voxels are mostly of it. Of 0, 0.25 and 0.5,
#: the first is best for livers and the last for lungs.
_VALLEY_RISE, _VALLEY_FLOOR, _INTO_EMPTY = 1.5, 0.002, 0.25

#: Connections thinner than twice this share of the organ's depth are necks: of 0.08, 0.12, 0.16 and 0.2 on
#: phantoms, the first is best for lungs, the last for a liver beside muscle and for a brain in its head.
_NECK_SHARE = 0.2

#: Voxels within this distance of the organ's even tissue may be partly of it, mm.
_PARTIAL_MM = 8.0

#: Vessels, and other gaps within the organ, are closed to twice this width, mm.
_CLOSING_MM = 6.0

#: An organ has at least so many voxels.
_LEAST_VOXELS = 27

#: What is darker than Otsu's threshold, and lies in a corner of this share of the slices, is background.
_BACKGROUND_CORNERS = 0.25


class GrownRegion(NamedTuple):
    """What was grown from seeds.

    Attributes
    ----------
    mask : (a, b, c) bool
        Roughly the organ.
    low, high : float
        Grey values of its tissue, of the smoothed image.
    """

    mask: BoolArray
    low: float
    high: float


def grow_region(
    image: SingleArray, spacing: FloatArray, seeds: Sequence[Seed], slice_axis: int, location: str
) -> GrownRegion:
    """Grow an organ from where somebody pointed at it.

    Parameters
    ----------
    image : (a, b, c) float32
        Grey values.
    spacing : (3,) float
        Distance between voxels, mm.
    seeds : sequence of Seed
        Each within the same organ, of the same tissue; two for two lungs.
    slice_axis : int
        Axis along which slices run.
    location : str
        What messages name.

    Raises
    ------
    InputError
        A seed lies outside the image, in the background, or where nothing is even around it.
    """
    from skimage.segmentation import watershed  # slow to import

    for seed in seeds:
        _check_inside(seed, image.shape, location)
    every = _blocks(image.shape, spacing)
    coarse, size = _averaged(image, every), spacing * every
    parts = [_seeded(seed, every, coarse.shape, size) for seed in seeds]
    chosen = np.logical_or.reduce(parts)
    middles = (np.array([np.add(seed.first, seed.end) - 1 for seed in seeds]) // (2 * every)).astype(int)
    smooth = _smoothed(coarse)
    slope = np.sqrt(sum(np.square(ndimage.sobel(smooth, axis, mode="nearest") / 32) for axis in range(3)))
    boxes = [part for part, seed in zip(parts, seeds, strict=True) if not _is_voxel(seed)]
    low, high, even = _tissue(coarse, smooth, slope, chosen)
    if boxes:
        shown = np.quantile(smooth[np.logical_or.reduce(boxes)], _BOX_SHARES)
        low, high = float(np.clip(low, *shown[:2])), float(np.clip(high, *shown[2:]))
    alike = (smooth >= low) & (smooth <= high)
    own, others, neck = _own_tissue(alike, parts, middles, size)
    away = _distance_to(own, size) - neck
    markers = np.zeros(coarse.shape, np.int32)
    markers[np.where(alike, away > size.min(), even | (away > _PARTIAL_MM)) | others] = 2
    markers[own | (chosen & alike)] = 1
    grown = watershed(slope, markers) == 1
    if np.count_nonzero(grown) < _LEAST_VOXELS:
        problem = f"almost nothing around seed {'; '.join(map(str, seeds))} is of one tissue"
        raise InputError(location, problem, "point at the organ's even tissue, away from vessels and edges")
    if _is_background(grown, coarse, slice_axis):
        problem = f"seed {'; '.join(map(str, seeds))} lies in the background (grey values near {low:.4g})"
        raise InputError(location, problem, "give a voxel within the organ")
    grown = ndimage.binary_fill_holes(grown | _closed(grown, size))
    return GrownRegion(_refined(grown, every, image.shape), low, high)


def _check_inside(seed: Seed, shape: tuple[int, ...], location: str) -> None:
    if any(end > size for end, size in zip(seed.end, shape, strict=True)):
        last = ",".join(str(size - 1) for size in shape)
        raise InputError(
            location, f"seed {seed} lies outside the scan, whose last voxel is {last}", "correct the seed"
        )


# The grid ---------------------------------------------------------------------------------------------


def _blocks(shape: tuple[int, ...], spacing: FloatArray) -> AnyArray:
    """Voxels (3,) of a block, about cubic, so that few enough blocks are left."""
    every = np.ones(3, int)
    while np.prod(np.asarray(shape) / every) > _MOST_VOXELS:
        every[np.argmin(spacing * every)] += 1
    return every


def _averaged(image: SingleArray, every: AnyArray) -> SingleArray:
    """Average blocks of voxels; the last ones, where incomplete, repeat the image's last voxels."""
    room = [(0, int(-size % step)) for size, step in zip(image.shape, every, strict=True)]
    padded = np.pad(image, room, mode="edge")
    (a, b, c), (p, q, r) = np.array(padded.shape) // every, every
    return padded.reshape(a, p, b, q, c, r).mean(axis=(1, 3, 5), dtype=np.float32)


def _refined(mask: BoolArray, every: AnyArray, shape: tuple[int, ...]) -> BoolArray:
    """Voxels (shape) of blocks' mask, its border linear between the blocks' centres."""
    values = mask.astype(np.float32)
    for axis, (step, size) in enumerate(zip(every, shape, strict=True)):
        at = np.clip((np.arange(size) - (step - 1) / 2) / step, 0, values.shape[axis] - 1)
        before = np.floor(at).astype(int)
        share = (at - before).astype(np.float32).reshape([-1 if along == axis else 1 for along in range(3)])
        after = np.minimum(before + 1, values.shape[axis] - 1)
        values = values.take(before, axis) * (1 - share) + values.take(after, axis) * share
    return values >= 0.5


def _seeded(seed: Seed, every: AnyArray, shape: tuple[int, ...], size: FloatArray) -> BoolArray:
    """Blocks that a box holds, or those around a voxel."""
    first, end = np.array(seed.first) // every, -(-np.array(seed.end) // every)
    box = np.zeros(shape, bool)
    box[tuple(slice(a, b) for a, b in zip(first, end, strict=True))] = True
    return _distance_to(box, size) <= _SEED_MM if _is_voxel(seed) else box


def _is_voxel(seed: Seed) -> bool:
    return all(b == a + 1 for a, b in zip(seed.first, seed.end, strict=True))


# Tissue -----------------------------------------------------------------------------------------------


def _smoothed(image: SingleArray) -> SingleArray:
    """Smooth even tissue and keep edges (modified curvature diffusion, Whitaker and Xue 2001)."""
    import SimpleITK as sitk  # noqa: N813  # slow to import

    if image.min() == image.max():
        return image
    given = sitk.GetImageFromArray(image)
    smooth = sitk.CurvatureAnisotropicDiffusion(given, _STEP, _CONDUCTANCE, 1, _ROUNDS)
    return cast(SingleArray, sitk.GetArrayFromImage(smooth))


def _tissue(
    image: SingleArray, smooth: SingleArray, slope: SingleArray, chosen: BoolArray
) -> tuple[float, float, BoolArray]:
    """Range of the smoothed grey values of the seed's tissue, and which voxels are even."""
    rest = (image - smooth)[chosen]
    noise = 1.4826 * float(np.median(np.abs(rest - np.median(rest))))
    noise = max(noise, 1e-3 * float(np.ptp(smooth)), 1e-6)
    even = slope <= _EVEN * noise
    middle = float(np.median(smooth[chosen]))
    low, mode, high = _mode(smooth[even | chosen], middle, _VALLEY_WIDTH * noise)
    return min(low, mode - noise / 2), max(high, mode + noise / 2), even


def _mode(values: SingleArray, middle: float, width: float) -> tuple[float, float, float]:
    """Mode of values next to one of them, and the valleys to either side: (low, mode, high)."""
    step, reach = width / 4, 240
    edges = middle + step * np.arange(-reach, reach + 1)
    density = ndimage.gaussian_filter1d(np.histogram(values, edges)[0].astype(float), 4)
    top = reach
    while True:
        around = range(max(top - 1, 0), min(top + 2, len(density)))
        higher = max(around, key=lambda n: (density[n], n == top))
        if higher == top:
            break
        top = higher
    low, high = (_valley(density, top, way) for way in (-1, 1))
    centres = (edges[1:] + edges[:-1]) / 2
    return float(centres[low]), float(centres[top]), float(centres[high])


def _valley(density: FloatArray, top: int, way: int) -> int:
    """Find the nearest valley of a density from a mode on, to one side."""
    floor = _VALLEY_FLOOR * density[top]
    along = np.maximum(density[top::way], floor)  # below that it is empty
    lowest = np.minimum.accumulate(along)
    rising = np.flatnonzero(along > _VALLEY_RISE * lowest + 5 * floor)
    along = along[: rising[0] if len(rising) else None]
    bottom = np.flatnonzero(along == along.min())
    return top + way * int(bottom[0] + _INTO_EMPTY * (bottom[-1] - bottom[0]))


def _own_tissue(
    alike: BoolArray, parts: Sequence[BoolArray], middles: IntArray, size: FloatArray
) -> tuple[BoolArray, BoolArray, float]:
    """Parts of the tissue that hang together with seeds otherwise than by a neck, other parts, the neck, mm.

    Both without their outer layer, half as wide as a neck.
    """
    inner = ndimage.distance_transform_edt(np.pad(alike, 1, mode="edge"), sampling=size)
    inner = cast(FloatArray, inner)[1:-1, 1:-1, 1:-1]
    neck = min(_neck(inner, alike, part) for part in parts)
    chosen = np.logical_or.reduce(parts)
    labels, count = ndimage.label(inner > neck)
    held = np.zeros(count + 1, bool)
    held[labels[chosen & alike]] = True
    if count:  # a voxel in a vessel means the tissue around it
        nearest = ndimage.distance_transform_edt(
            labels == 0, size, return_distances=False, return_indices=True
        )
        held[labels[tuple(np.asarray(nearest)[:, *np.transpose(middles)])]] = True
    held[0] = False
    own = held[labels]
    return own, (labels > 0) & ~own, neck


def _neck(inner: FloatArray, alike: BoolArray, chosen: BoolArray) -> float:
    """Half width in mm below which a connection is a neck, of the tissue in which a seed lies.

    The seed's own place is no neck.
    """
    labels, count = ndimage.label(alike)
    there = np.bincount(labels[chosen & alike], minlength=count + 1)
    depth = inner[labels == there.argmax()].max() if there.any() else 0.0
    return float(min(_NECK_SHARE * depth, inner[chosen & alike].max(initial=0.0) / 2))


# Shape ------------------------------------------------------------------------------------------------


def _distance_to(mask: BoolArray, size: FloatArray) -> FloatArray:
    """Distance of every voxel to a mask, mm; infinite where that is empty."""
    if not mask.any():
        return np.full(mask.shape, np.inf)
    return cast(FloatArray, ndimage.distance_transform_edt(~mask, sampling=size))


def _closed(mask: BoolArray, size: FloatArray) -> BoolArray:
    """Close gaps of a mask by a ball."""
    room = np.ceil(_CLOSING_MM / size).astype(int) + 1
    wide = np.pad(mask, [(n, n) for n in room])
    wide = _distance_to(wide, size) <= _CLOSING_MM
    wide = _distance_to(~wide, size) > _CLOSING_MM
    return wide[tuple(slice(n, n + m) for n, m in zip(room, mask.shape, strict=True))]


def _is_background(grown: BoolArray, image: SingleArray, slice_axis: int) -> bool:
    """Whether a region is dark and lies in a corner of many slices."""
    from skimage.filters import threshold_otsu  # slow to import

    slices = np.moveaxis(grown, slice_axis, 0)
    corners = slices[:, :: slices.shape[1] - 1 or 1, :: slices.shape[2] - 1 or 1]
    in_corner = corners.mean(axis=0).max() > _BACKGROUND_CORNERS
    return bool(in_corner and np.median(image[grown]) <= threshold_otsu(image))
