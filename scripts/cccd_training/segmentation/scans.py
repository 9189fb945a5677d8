"""Training scans, whole, with their labels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from cccd.errors import InputError, choices
from cccd.geometry.arrays import AnyArray
from cccd.inputs.grid import Volume, on_grid
from cccd.inputs.load import existing
from cccd.inputs.readers import read_volume
from cccd.inputs.row_files import read_mask, read_now
from cccd.request import Request, completed
from cccd.settings.imports import ImportSettings
from cccd_datasets.whole_scans import read_scan, scan_phantom
from cccd_training.segmentation.examples import LabelledScan


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
    request = completed(Request.of_row(row, folder))
    if request.mask is None:
        raise InputError(
            request.location, "a training row without a mask", "give the labels in the column mask"
        )
    path = existing(folder / request.mask, "mask")
    if labels:
        drawn = read_volume(path)
        classes = _classes(drawn.data, labels, path.name)
    else:
        drawn = read_mask(path, request, image, read_now)
        classes = (drawn.data >= 0.5).astype(np.uint8)
    moved = on_grid(Volume(classes, drawn.affine, drawn.location), image.affine, image.shape, fill=0)
    if moved is None:
        raise InputError(path.name, f"its grid is not that of {image.location}", "give matching files")
    return LabelledScan(row["case"], image, moved.data, row["source"])


def _classes(values: AnyArray, labels: Sequence[int], location: str) -> AnyArray:
    """Numbers 1, 2, ... of the labels, 0 elsewhere."""
    values = np.rint(values).astype(np.int64)
    present = [int(value) for value in np.unique(values) if value > 0]
    absent = " and ".join(str(label) for label in labels if label not in present)
    if absent:
        raise InputError(location, f"the mask lacks label {absent} of segmentation: labels", choices(present))
    classes = np.zeros(values.shape, np.uint8)
    for number, label in enumerate(labels, start=1):
        classes[values == label] = number
    return classes
