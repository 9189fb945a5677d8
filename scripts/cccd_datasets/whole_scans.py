"""Scans to segment, whole: one cropped to its organ would tell where that is."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray
from cccd.inputs.grid import Volume
from cccd.inputs.load import existing
from cccd.inputs.row_files import read_image
from cccd.settings.imports import ImportSettings
from cccd_datasets.phantoms import make_phantom

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
    return read_image(existing(folder / row["image"], "image"), row["source"], settings.fill_gaps)


def scan_phantom(case: str, organ: str, settings: ImportSettings, seed: int) -> tuple[Volume, AnyArray]:
    """Scan a phantom with what is around its organ: the image, and the mask (a, b, c) bool on its grid.

    The voxels are those of `cccd_datasets.phantoms.make_phantom`, but more of them, with noise of their own.
    """
    spacing = settings.phantom.spacing_mm
    most = np.ceil(np.divide(_PHANTOM_MARGIN_MM, spacing)).astype(int)
    location = f"{case}/{organ}"
    phantom = make_phantom(case, organ, spacing, seed=seed, margin_voxels=most, location=location)
    image, mask = phantom.image, phantom.mask
    assert image is not None
    assert mask is not None
    # cut unevenly, so that the organ's place in the scan tells nothing
    rng = np.random.default_rng([seed, *case.encode(), *organ.encode()])
    low, high = rng.integers(0, most // 2 + 1, (2, 3))
    inside = tuple(slice(a, n - b) for a, b, n in zip(low, high, image.shape, strict=True))
    affine = phantom.frame.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ (phantom.origin + low)
    return Volume(np.ascontiguousarray(image[inside]), affine, location), mask[inside]
