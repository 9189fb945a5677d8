"""An organ's mask in a grey image where nobody drew one: by a threshold, by seeds, or a stripped brain."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from scipy import ndimage

from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray, BoolArray, SingleArray
from cccd.inputs.grid import Volume
from cccd.inputs.load import slice_axis_of
from cccd.request import Request
from cccd.settings.imports import ImportSettings, RegionSettings
from cccd_segmentation.growing import grow_region
from cccd_segmentation.seeds import parse_seeds

#: A mask, and how it was found, for provenance.
Found: TypeAlias = tuple[Volume, dict[str, Any]]


def by_threshold(image: Volume, request: Request, settings: ImportSettings) -> Found:
    """Find the organ by its grey values, as the request's window and the settings' ``region`` say."""
    axis = slice_axis_of(image, settings)
    found, bounds = find_region(image.data, image.location, settings.region, request.window, slice_axis=axis)
    region = settings.region.as_config() | {"window": [None if np.isinf(one) else one for one in bounds]}
    note = f"{image.location}: no mask; the organ is found by a threshold: grey values {_range(*bounds)}"
    return Volume(found, image.affine, image.location, warnings=[note]), {"region": region}


def by_seed(image: Volume, request: Request, settings: ImportSettings) -> Found:
    """Grow the organ from where a seed says that it is: a rough mask, and what it was grown from."""
    seeds = [seed for text in request.seeds for seed in parse_seeds(text, image.location)]
    spacing = np.linalg.norm(image.affine[:3, :3], axis=0)
    grown = grow_region(image.data, spacing, seeds, slice_axis_of(image, settings), image.location)
    tissue = [round(end, 4) for end in (grown.low, grown.high)]
    note = (
        f"{image.location}: no mask; the organ is grown from seed {'; '.join(map(str, seeds))}: "
        f"grey values {_range(*tissue)} after smoothing"
    )
    doubts = [
        f"{image.location}: the image shows no clear border around seed {seed}, so the region may be wrong; "
        "cccd check draws it; another voxel, a box or a mask may help"
        for seed in grown.doubtful
    ]
    facts = {"region": {"seed": [str(one) for one in seeds], "tissue": tissue}}
    return Volume(grown.mask, image.affine, image.location, warnings=[note, *doubts]), facts


def _range(low: float, high: float) -> str:
    """Say a range of grey values of which either end may be infinite."""
    if np.isinf(high):
        return f"from {low:.4g} on"
    return f"up to {high:.4g}" if np.isinf(low) else f"from {low:.4g} to {high:.4g}"


def find_region(
    image: SingleArray,
    location: str,
    settings: RegionSettings,
    window: tuple[float | None, float | None] | None = None,
    *,
    slice_axis: int,
) -> tuple[BoolArray, tuple[float, float]]:
    """Find an organ by its grey values.

    Parameters
    ----------
    image : (a, b, c) float32
        Grey values (HU for CT).
    location : str
        What a message names.
    settings : RegionSettings
        Otsu's threshold is that of IEEE Trans. SMC 9:62, 1979; components are 6-connected. With
        ``drop_border``, an organ that is cut by the scan's first or last slice stays.
    window : (float or None, float or None), optional
        In place of the settings'.
    slice_axis : int
        Axis along which slices run.

    Returns
    -------
    mask : (a, b, c) bool
        The organ.
    bounds : (float, float)
        The window used, infinite where it has no bound.

    Raises
    ------
    InputError
        The image is of one grey value, or the window holds no voxel or all of them.
    """
    if image.min() == image.max():
        raise InputError(location, f"all its grey values are {image.min():g}", "give another scan, or a mask")
    wanted = window or settings.window
    if wanted == "otsu":
        from skimage.filters import threshold_otsu  # slow to import

        low, high = float(threshold_otsu(image)), None
    else:
        low, high = wanted
    low, high = (-np.inf if low is None else low), (np.inf if high is None else high)
    labels, count = ndimage.label((image >= low) & (image <= high))
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    sizes[0] = 0
    if settings.drop_border:
        sizes[_reaching_sides(labels, slice_axis)] = 0
    chosen = np.argsort(-sizes, kind="stable")[: settings.components]
    chosen = chosen[sizes[chosen] >= max(settings.smallest_share * sizes.max(), 1)]
    mask = np.isin(labels, chosen)
    if mask.all() or not mask.any():
        found = "the whole image lies" if mask.any() else "no region"
        raise InputError(
            location,
            f"{found} between {low:g} and {high:g} (grey values {image.min():g} to {image.max():g})",
            "give another range (--threshold LOW:HIGH; import: region: window)",
        )
    return (ndimage.binary_fill_holes(mask) if settings.fill_holes else mask), (low, high)


def _reaching_sides(labels: AnyArray, slice_axis: int) -> AnyArray:
    """Labels on the four sides of the slices."""
    sides = [labels.take(end, axis).ravel() for axis in range(3) if axis != slice_axis for end in (0, -1)]
    return np.unique(np.concatenate(sides))


def by_stripping(image: Volume, request: Request, settings: ImportSettings) -> Found:
    """Find the brain in a skull-stripped scan: the largest component of what is not zero, cavities filled.

    The mask is empty where the image is zero throughout.
    """
    labels, count = ndimage.label(image.data != 0)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    sizes[0] = 0
    mask = ndimage.binary_fill_holes(labels == sizes.argmax()) if count else labels > 0
    return Volume(mask, image.affine, image.location), {}
