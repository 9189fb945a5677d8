"""Training scans and scans to segment, whole: one cropped to its organ would tell where that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from cccd.cohort import complete_row
from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray
from cccd.segmentation.examples import LabelledScan
from cccd.settings.imports import ImportSettings
from cccd.settings.messages import choices
from cccd.volumes.grid import Volume, on_grid
from cccd.volumes.inputs import read_image, read_mask
from cccd.volumes.load import existing
from cccd.volumes.phantoms import make_phantom
from cccd.volumes.readers import read_volume

__all__ = ["read_labelled_scan", "read_scan", "scan_phantom"]

#: Background left around a phantom's organ, in mm; the organ's place in it varies by as much again.
_PHANTOM_MARGIN_MM = 45.0


def read_scan(row: Mapping[str, str], folder: Path, settings: ImportSettings, seed: int = 0) -> Volume:
    """Read the whole scan of a row, without its mask.

    Raises
    ------
    InputError
        The row has no image.
    """
    if row["source"] == "phantom":
        return scan_phantom(row["case"], row["organ"], settings, seed)[0]
    if not row["image"]:
        raise InputError(row["location"], "it has no image to segment", "give the scan in the column image")
    return read_image(
        existing(folder / row["image"], "image"), row["source"], settings.fill_gaps, settings.limits
    )


def read_labelled_scan(
    row: Mapping[str, str], folder: Path, settings: ImportSettings, labels: Sequence[int], seed: int = 0
) -> LabelledScan:
    """Read the whole scan of a row and its labels.

    Parameters
    ----------
    row : mapping
        Of the cohort sheet: an image with a mask, or a phantom.
    folder : path
        The sheet's.
    settings : ImportSettings
    labels : sequence of int
        Label values that become classes 1, 2, ...; empty: the row's organ is the one class.
    seed : int
        Of a phantom.

    Raises
    ------
    InputError
        No image or no mask, other grids, or a label that the mask lacks.
    """
    if row["source"] == "phantom":
        image, mask = scan_phantom(row["case"], row["organ"], settings, seed)
        return LabelledScan(row["case"], image, mask.astype(np.uint8), row["source"])
    image = read_scan(row, folder, settings)
    row, implied = complete_row(row, folder)
    if not row["mask"]:
        raise InputError(
            row["location"], "a training row without a mask", "give the labels in the column mask"
        )
    path = existing(folder / row["mask"], "mask")
    if labels:
        drawn = read_volume(path)
        classes = _classes(drawn.data, labels, path.name)
    else:
        drawn = read_mask(path, row, implied, image)
        classes = (drawn.data >= 0.5).astype(np.uint8)
    moved = on_grid(Volume(classes, drawn.affine, drawn.location), image.affine, image.shape, fill=0)
    if moved is None:
        raise InputError(path.name, f"its grid is not that of {image.location}", "give matching files")
    return LabelledScan(row["case"], image, moved.data, row["source"])


def _classes(values: AnyArray, labels: Sequence[int], location: str) -> AnyArray:
    """Numbers 1, 2, ... of the labels, 0 elsewhere."""
    values = np.rint(values).astype(np.int64)
    present = [int(value) for value in np.unique(values) if value > 0]
    lacking = [label for label in labels if label not in present]
    if lacking:
        named = " and ".join(map(str, lacking))
        raise InputError(location, f"the mask lacks label {named} of segmentation: labels", choices(present))
    classes = np.zeros(values.shape, np.uint8)
    for number, label in enumerate(labels, start=1):
        classes[values == label] = number
    return classes


def scan_phantom(case: str, organ: str, settings: ImportSettings, seed: int) -> tuple[Volume, AnyArray]:
    """Scan a phantom with what is around its organ: the image, and the mask (a, b, c) bool on its grid.

    The voxels are those of `cccd.volumes.phantoms.make_phantom`, but more of them, with noise of their own.
    """
    spacing = settings.phantom.spacing_mm
    most = np.ceil(np.divide(_PHANTOM_MARGIN_MM, spacing)).astype(int)
    phantom = make_phantom(
        case,
        organ,
        settings.phantom,
        seed=seed,
        margin_voxels=(int(most[0]), int(most[1]), int(most[2])),
        location=f"{case}/{organ}",
    )
    image, mask = phantom.image, phantom.mask
    assert image is not None
    assert mask is not None
    # cut unevenly, so that the organ's place in the scan tells nothing
    rng = np.random.default_rng([seed, *case.encode(), *organ.encode()])
    low, high = rng.integers(0, most // 2 + 1, (2, 3))
    inside = tuple(slice(a, n - b) for a, b, n in zip(low, high, image.shape, strict=True))
    affine = phantom.frame.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ (phantom.origin + low)
    return Volume(np.ascontiguousarray(image[inside]), affine, f"{case}/{organ}"), mask[inside]
