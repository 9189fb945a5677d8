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
            "set import: region: window",
        )
    return (ndimage.binary_fill_holes(mask) if settings.fill_holes else mask), (low, high)


def _reaching_sides(labels: AnyArray, slice_axis: int) -> AnyArray:
    """Labels on the four sides of the slices."""
    sides = [labels.take(end, axis).ravel() for axis in range(3) if axis != slice_axis for end in (0, -1)]
    return np.unique(np.concatenate(sides))


def draw_region(structure: Structure, path: str | Path) -> None:
    """Draw the region that became the organ: three slices along each axis with the mask's outline, as PNG.

    Parameters
    ----------
    structure : Structure
        With an image, and the region or the mask that it gave.
    path : path
        Where the picture goes.

    Raises
    ------
    ValueError
        The structure lacks its image, or what was found in it.
    """
    from matplotlib.figure import Figure

    image, spacing = structure.image, structure.frame.spacing
    mask = structure.mask if structure.region is None else structure.region
    if image is None or mask is None:
        raise ValueError("a region is drawn of an image and its mask")
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
    figure.suptitle(f"{structure.case} / {structure.organ}: the region found")
    figure.savefig(path, dpi=100)
