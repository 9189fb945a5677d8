"""A region found in a grey image where nobody drew a mask: window or Otsu, largest components."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy import ndimage
from skimage.filters import threshold_otsu

from cccd.containers import Structure
from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray, BoolArray, SingleArray
from cccd.settings.imports import RegionSettings

__all__ = ["draw_region", "find_region"]


def find_region(
    image: SingleArray,
    location: str,
    settings: RegionSettings,
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
    low, high = (float(threshold_otsu(image)), None) if settings.window == "otsu" else settings.window
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


def draw_region(structure: Structure, path: str | Path) -> None:
    """Draw what is taken for the organ: three slices along each axis, its outline over the image, as PNG.

    Parameters
    ----------
    structure : Structure
        With a region, a mask, boundary maps or drawn contours; and its image, where there is one.
    path : path
        Where the picture goes.

    Raises
    ------
    ValueError
        The structure brings nothing to draw.
    """
    from matplotlib.figure import Figure

    spacing, mask = structure.frame.spacing, _drawn(structure)
    image = mask.astype(np.float32) if structure.image is None else structure.image
    figure = Figure(figsize=(9, 9), layout="constrained")
    axes = figure.subplots(3, 3)
    low, high = np.percentile(image, (1, 99))
    for axis in range(3):
        filled = np.flatnonzero(mask.any(axis=tuple({0, 1, 2} - {axis})))
        first, second = (other for other in range(3) if other != axis)
        for panel, share in zip(axes[axis], (0.25, 0.5, 0.75), strict=True):
            index = int(filled[int(share * (len(filled) - 1))])
            panel.imshow(
                image.take(index, axis).T,
                cmap="gray",
                vmin=low,
                vmax=max(high, low + 1e-6),
                aspect=spacing[second] / spacing[first],
                origin="lower",
                interpolation="nearest",
            )
            panel.contour(mask.take(index, axis).T, [0.5], colors="tab:red", linewidths=1)
            panel.set_title(f"axis {axis}, index {index + int(structure.origin[axis])}", fontsize=8)
            panel.set_axis_off()
    figure.suptitle(f"{structure.case} / {structure.organ}")
    figure.savefig(path, dpi=100, format="png")


def _drawn(structure: Structure) -> np.ndarray:
    """Return what stands for the organ, on the grid of the structure's arrays (a, b, c)."""
    for found in (structure.region, structure.boundary, structure.mask):
        if found is not None:
            return found
    if structure.contours is None:
        raise ValueError("the structure brings nothing to draw")
    contours, origin = structure.contours, structure.stack_origin
    image = structure.stack("image")
    if image is not None:
        shape = image.shape
    else:  # what the image would be cropped to: as much beyond the contours as before them
        margin = int(contours.slice.min() - origin[0])
        last = [int(contours.slice.max()), *np.ceil(contours.points.max(axis=0)).astype(int).tolist()]
        shape = tuple(int(end - begin) + 1 + margin for begin, end in zip(origin, last, strict=True))
    filled = contours.rasterise(origin, (shape[0], shape[1], shape[2]))
    return np.moveaxis(filled, 0, structure.frame.slice_axis)
