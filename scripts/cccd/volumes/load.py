"""From a row of the cohort sheet to a `Structure`."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cccd.containers import Structure
from cccd.errors import InputError
from cccd.volumes.grid import Volume, bounding_box, crop, frame_of, on_grid
from cccd.volumes.phantoms import make_phantom
from cccd.volumes.readers import NIFTI_SUFFIXES, read_itk, read_nifti
from cccd.volumes.sources import read_mni152

__all__ = ["load_structure"]


def load_structure(row: Mapping[str, str], sheet_dir: str | Path, settings: Mapping) -> Structure:
    """Read one structure, cropped to its organ with a margin.

    Parameters
    ----------
    row : mapping
        One row of `cccd.cohort.read_cohort`.
    sheet_dir : path
        Folder of the cohort sheet, from which the row's paths are relative.
    settings : mapping
        The configuration's ``import`` section and ``seed``.

    Returns
    -------
    Structure
        With a margin of background on every side: where the organ touches the scan's face, the mask goes
        on as background, the grey values as they are on the face, and ``origin`` may be negative.

    Raises
    ------
    InputError
        Names the row, what is wrong, and the cure.
    """
    place, case, organ = row["place"], row["case"], row["organ"]
    if row["source"] == "phantom":
        return make_phantom(
            case,
            organ,
            seed=settings["seed"],
            margin_voxels=settings["margin_voxels"],
            place=place,
            **settings["phantom"],
        )
    if row["source"] == "mni152":
        image, mask, provenance = read_mni152(organ, place)
    else:
        image, mask, provenance = _read_files(row, Path(sheet_dir))
    frame = frame_of(mask, settings["slice_axis"])
    if not mask.data.any():
        raise InputError(place, f"the mask {mask.place} is empty", "check label and mask")
    first, last = bounding_box(mask.data)
    first, last = first - settings["margin_voxels"], last + settings["margin_voxels"]
    return Structure(
        case=case,
        organ=organ,
        frame=frame,
        origin=first,
        image=None if image is None else crop(np.asarray(image.data, np.float32), first, last),
        mask=crop(mask.data, first, last),
        provenance={"source": row["source"], **provenance},
    )


def _read_volume(path: Path) -> Volume:
    return read_nifti(path) if path.name.lower().endswith(NIFTI_SUFFIXES) else read_itk(path)


def _read_files(row: Mapping[str, str], folder: Path) -> tuple[Volume | None, Volume, dict]:
    files = {}
    image = None
    mask = _read_volume(folder / row["mask"])
    files[row["mask"]] = _checksum(folder / row["mask"])
    labels = [int(value) for value in row["label"].split(",") if value]
    mask.data = np.isin(mask.data, labels) if labels else mask.data > 0
    if row["image"]:
        image = _read_volume(folder / row["image"])
        files[row["image"]] = _checksum(folder / row["image"])
        image = on_grid(image, mask.affine, mask.data.shape)
    return image, mask, {"files": files}


def _checksum(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
