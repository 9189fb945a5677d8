"""An organ grown from a seed: where somebody points into a grey image, what is of the same tissue around.

The seed's tissue is a range of the smoothed image's grey values around its own. What lies in this range and
hangs together with the seed by more than a neck is the organ; what is even and of other tissue is not; a
watershed of the gradient (Vincent and Soille 1991) draws the border in between, where voxels are of both. A
seed does not say how wide the range is. So several are tried, and the region is taken whose border lies on
edges and is short for its volume. It is rough: the boundary is sought in the image's edges around it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np
from scipy import ndimage

from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray, SingleArray
from cccd_segmentation.seeds import Seed

#: Voxels that are looked at: finer scans are averaged over blocks first. Twice as many took twice as long on
#: phantoms, and the region's Dice gained 0.004.
_MOST_VOXELS = 800_000

#: Rounds, time step and conductance of the smoothing that keeps edges; the step is the largest stable one.
_ROUNDS, _STEP, _CONDUCTANCE = 10, 0.0625, 3.0

#: Around a voxel, the seed's tissue is looked at to this distance, mm: about what a person points at.
_SEED_MM = 6.0

#: A voxel is even where its slope is below this share of the noise; of 0.25, 0.5 and 1 as good as any.
_EVEN = 0.5

#: A box may show several tissues of the organ: their range goes from one to the other of its quantiles.
_BOX_SHARES = (0.25, 0.75)

#: Ranges reach so many times the noise beyond the seed's own grey values, a geometric row; the last one only
#: shows whether the region of the last but one leaks.
_BEYOND = (0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 9.0)

#: A border lies on an edge where grey values across it differ by more than about this multiple of the noise.
_EDGE = 3.0

#: A region gains 1 where all of its border lies on edges, and loses this times its area by its volume to 2/3
#: (a ball has 4.8). Of 0, 0.05, 0.1 and 0.2, the last two are best on three CT, four phantoms and two heads.
_SHORT = 0.1

#: It loses as much as the logarithm of its volume grows with the next wider range, but no more than this: of
#: 0.5, 0.7 and 1 the best on the same images. Without it, whole heads are taken for brains.
_LEAK = 0.5

#: Connections thinner than twice this share of the organ's depth are necks: of 0.08, 0.12, 0.16 and 0.2 on
#: phantoms, the first is best for lungs, the last for a liver beside muscle and for a brain in its head.
_NECK_SHARE = 0.2

#: Voxels within this distance of the organ's even tissue may be partly of it, mm.
_PARTIAL_MM = 8.0

#: Vessels, and other gaps within the organ, are closed to twice this width, mm.
_CLOSING_MM = 6.0

#: An organ has at least so many voxels.
_LEAST_VOXELS = 27

#: An organ fills at most this share of a scan.
_MOST_OF_SCAN = 0.9

#: A region is doubtful whose score is below this, or that fills more than half of the scan. Of 54 regions of
#: CT, MR and phantoms, 17 are: their mean Dice is 0.55, and 8 have less than 0.7; no other has under 0.78.
_DOUBTFUL, _HALF = -0.5, 0.5

#: What is darker than Otsu's threshold, and lies in a corner of this share of the slices, is background.
_BACKGROUND_CORNERS = 0.25


class _Tissue(NamedTuple):
    """Blocks (a, b, c) of an image, smoothed ones, their slope, their size (3,) in mm, the slices' axis."""

    image: SingleArray
    smooth: SingleArray
    slope: SingleArray
    size: FloatArray
    slice_axis: int


class GrownRegion(NamedTuple):
    """What was grown from seeds.

    Attributes
    ----------
    mask : (a, b, c) bool
        Roughly the organ.
    low, high : float
        Grey values of its tissue, of the smoothed image.
    doubtful : tuple of Seed
        Those around which the region's border lies on few edges or moves with the range of grey values, or
        fills half of the scan.
    """

    mask: BoolArray
    low: float
    high: float
    doubtful: tuple[Seed, ...]


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
        Each within the same organ, whose parts are grown one by one; two for two lungs.
    slice_axis : int
        Axis along which slices run.
    location : str
        What messages name.

    Raises
    ------
    InputError
        A seed lies outside the image, in the background, or where nothing is even around it; or what grows
        from it fills the scan.
    """
    for seed in seeds:
        _check_inside(seed, image.shape, location)
    every = _blocks(image.shape, spacing)
    coarse, size = _averaged(image, every), spacing * every
    smooth = _smoothed(coarse)
    slope = np.sqrt(sum(np.square(ndimage.sobel(smooth, axis, mode="nearest") / 32) for axis in range(3)))
    tissue = _Tissue(coarse, smooth, slope, size, slice_axis)
    found = [_grown_from(seed, tissue, every) for seed in seeds]
    for seed, one in zip(seeds, found, strict=True):
        _check_grown(one, seed, tissue, location)
    grown = np.logical_or.reduce([one.mask for one in found])
    low, high = min(one.low for one in found), max(one.high for one in found)
    doubtful = tuple(seed for one in found for seed in one.doubtful)
    return GrownRegion(_refined(grown, every, image.shape), low, high, doubtful)


def _check_inside(seed: Seed, shape: tuple[int, ...], location: str) -> None:
    if any(end > size for end, size in zip(seed.end, shape, strict=True)):
        last = ",".join(str(size - 1) for size in shape)
        raise InputError(
            location, f"seed {seed} lies outside the scan, whose last voxel is {last}", "correct the seed"
        )


def _check_grown(grown: GrownRegion, seed: Seed, tissue: _Tissue, location: str) -> None:
    """Refuse what is no organ: next to nothing, the whole scan, or the background."""
    cure = "point at the organ's even tissue, away from vessels and edges"
    if np.count_nonzero(grown.mask) < _LEAST_VOXELS:
        raise InputError(location, f"almost nothing around seed {seed} is of one tissue", cure)
    # dark alone: a background whose holes, the body, were filled
    if grown.mask.mean() > _MOST_OF_SCAN and grown.high > _otsu(tissue.image):
        problem = f"around seed {seed}, grey values vary as much as in the whole scan"
        raise InputError(location, problem, cure)
    if _is_background(grown.mask, tissue.image, tissue.slice_axis):
        problem = f"seed {seed} lies in the background (grey values near {grown.low:.4g})"
        raise InputError(location, problem, "give a voxel within the organ")


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


def _smoothed(image: SingleArray) -> SingleArray:
    """Smooth even tissue and keep edges (modified curvature diffusion, Whitaker and Xue 2001)."""
    import SimpleITK as sitk  # noqa: N813  # slow to import

    if image.min() == image.max():
        return image
    given = sitk.GetImageFromArray(image)
    smooth = sitk.CurvatureAnisotropicDiffusion(given, _STEP, _CONDUCTANCE, 1, _ROUNDS)
    return cast(SingleArray, sitk.GetArrayFromImage(smooth))


def _grown_from(seed: Seed, tissue: _Tissue, every: AnyArray) -> GrownRegion:
    """Grow the part of the organ in which one seed lies; its blocks."""
    smooth = tissue.smooth
    chosen = _seeded(seed, every, smooth.shape, tissue.size)
    middle = (np.add(seed.first, seed.end) - 1) // (2 * every)
    noise = _noise(tissue, chosen)
    even = tissue.slope <= _EVEN * noise
    own = np.quantile(smooth[chosen], (0.5, 0.5) if _is_voxel(seed) else _BOX_SHARES)
    tried = []
    for beyond in _BEYOND:
        low, high = float(own[0] - beyond * noise), float(own[1] + beyond * noise)
        grown = _region(tissue, (smooth >= low) & (smooth <= high), even, chosen, middle)
        tried.append((grown, low, high))
    volumes = np.array([max(np.count_nonzero(grown), 1) for grown, _, _ in tried])
    leaks = np.minimum(np.abs(np.diff(np.log(volumes))), _LEAK)
    scores = [_on_edges(grown, tissue, noise) for grown, _, _ in tried[:-1]] - leaks
    best = int(np.argmax(scores))
    grown, low, high = tried[best]
    doubtful = scores[best] < _DOUBTFUL or grown.mean() > _HALF
    return GrownRegion(grown, low, high, (seed,) if doubtful else ())


def _noise(tissue: _Tissue, chosen: BoolArray) -> float:
    """Return the standard deviation of what the smoothing takes off where the seed is."""
    rest = (tissue.image - tissue.smooth)[chosen]
    noise = 1.4826 * float(np.median(np.abs(rest - np.median(rest))))
    return max(noise, 1e-3 * float(np.ptp(tissue.smooth)), 1e-6)


def _region(
    tissue: _Tissue, alike: BoolArray, even: BoolArray, chosen: BoolArray, middle: AnyArray
) -> BoolArray:
    """Grow the organ from what is alike."""
    from skimage.segmentation import watershed  # slow to import

    size = tissue.size
    own, others, neck = _own_tissue(alike, chosen, middle, size)
    away = _distance_to(own, size) - neck
    markers = np.zeros(alike.shape, np.int32)
    markers[np.where(alike, away > size.min(), even | (away > _PARTIAL_MM)) | others] = 2
    markers[own | (chosen & alike)] = 1
    grown = watershed(tissue.slope, markers) == 1
    return cast(BoolArray, ndimage.binary_fill_holes(grown | _closed(grown, size)))


def _on_edges(grown: BoolArray, tissue: _Tissue, noise: float) -> float:
    """Return the share of a region's border that lies on edges, less what is lost for its area."""
    if np.count_nonzero(grown) < _LEAST_VOXELS or grown.all():
        return -np.inf
    on_edges = area = 0.0
    size = tissue.size
    for axis in range(3):
        inside, grey = np.moveaxis(grown, axis, 0), np.moveaxis(tissue.smooth, axis, 0)
        # at a slice's rim a border lies on no edge; but the slices may end within the organ
        rim = "edge" if axis == tissue.slice_axis else "constant"
        inside = np.pad(inside, ((1, 1), (0, 0), (0, 0)), mode=rim)
        grey = np.pad(grey, ((2, 2), (0, 0), (0, 0)), mode="edge")
        border = inside[1:] != inside[:-1]
        across = (grey[3:] - grey[:-3])[border] / (_EDGE * noise)  # a border's voxels are partly of both
        face = float(size.prod() / size[axis])
        on_edges += face * float((1 - np.exp(-(across**2))).sum())
        area += face * np.count_nonzero(border)
    volume = np.count_nonzero(grown) * float(size.prod())
    return on_edges / area - _SHORT * area / volume ** (2 / 3)


def _own_tissue(
    alike: BoolArray, chosen: BoolArray, middle: AnyArray, size: FloatArray
) -> tuple[BoolArray, BoolArray, float]:
    """Find what hangs together with a seed by more than a neck, other parts of its tissue, the neck in mm.

    Both without their outer layer, half as wide as a neck.
    """
    inner = ndimage.distance_transform_edt(np.pad(alike, 1, mode="edge"), sampling=size)
    inner = cast(FloatArray, inner)[1:-1, 1:-1, 1:-1]
    neck = _neck(inner, alike, chosen)
    labels, count = ndimage.label(inner > neck)
    held = np.zeros(count + 1, bool)
    held[labels[chosen & alike]] = True
    if count:  # a voxel in a vessel means the tissue around it
        nearest = ndimage.distance_transform_edt(
            labels == 0, size, return_distances=False, return_indices=True
        )
        held[labels[tuple(np.asarray(nearest)[:, *middle])]] = True
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
    slices = np.moveaxis(grown, slice_axis, 0)
    corners = slices[:, :: slices.shape[1] - 1 or 1, :: slices.shape[2] - 1 or 1]
    in_corner = corners.mean(axis=0).max() > _BACKGROUND_CORNERS
    return bool(in_corner and np.median(image[grown]) <= _otsu(image))


def _otsu(image: SingleArray) -> float:
    from skimage.filters import threshold_otsu  # slow to import

    return float(threshold_otsu(image))
