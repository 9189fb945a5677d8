"""Named sources: scans that come with a package, and cohorts whose download has a fixed layout."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

import numpy as np
from scipy import ndimage

from cccd.errors import InputError
from cccd.settings import choices, nearest
from cccd.volumes.grid import Volume, check_affine

__all__ = ["brain_of_stripped", "complete_row", "read_mni152", "read_whole_body_ct"]

_TUMOUR = ("tumour", "tumor", "lesion")


def read_mni152(organ: str, place: str) -> tuple[Volume, Volume, dict]:
    """Give the MNI ICBM 152 brain template at 1 mm, its brain mask and its provenance, from nilearn's wheel.

    Raises
    ------
    InputError
        ``organ`` is not ``brain``.
    """
    if organ != "brain":
        raise InputError(place, f"source mni152 has no organ {organ!r}", "set organ to brain")
    from nilearn import datasets  # slow to import, and only this source needs it

    image = datasets.load_mni152_template(resolution=1)
    mask = datasets.load_mni152_brain_mask(resolution=1)
    facts = {"nilearn": version("nilearn"), "template": "MNI ICBM 152 symmetric 2009a, 1 mm"}
    return (
        Volume(np.asarray(image.dataobj, np.float32), image.affine, "mni152"),
        Volume(np.asarray(mask.dataobj) > 0, mask.affine, "mni152"),
        facts,
    )


def read_whole_body_ct(organ: str, place: str) -> tuple[Volume, Volume, dict]:
    """Give the male whole-body CT of PyVista's examples (TotalSegmentator s1397, CC BY 4.0) and one organ.

    PyVista downloads it once into its own cache and tries three times. The first download's SHA-256 is kept
    beside it; every later read is held against it.

    Raises
    ------
    InputError
        No network at the first use, changed data, or no such organ (lists those there are).
    """
    from pyvista import examples  # slow to import, and only this source needs it

    try:
        file = Path(examples.download_whole_body_ct_male(load=False))
        dataset = examples.download_whole_body_ct_male()
    except (OSError, RuntimeError, ValueError) as error:  # requests' errors are OSErrors
        reason = type(error).__name__
        raise InputError(
            place,
            f"the whole-body CT cannot be downloaded ({reason})",
            "connect to the network once, or delete PyVista's cache when it is damaged",
        ) from None
    scan, organs = dataset["ct"], dataset["segmentations"]
    if organ not in organs.keys():  # noqa: SIM118 (a MultiBlock iterates over blocks)
        raise InputError(place, f"source whole_body_ct has no organ {organ!r}", nearest(organ, organs.keys()))
    affine = np.eye(4)
    affine[:3, :3] = np.asarray(scan.direction_matrix) * scan.spacing
    affine[:3, 3] = scan.origin
    affine = check_affine(affine, place)

    def volume(block) -> np.ndarray:
        return np.asarray(block.active_scalars).reshape(block.dimensions, order="F")

    digest = hashlib.sha256(np.ascontiguousarray(volume(scan))).hexdigest()
    _hold_checksum(file, digest, place)
    facts = {"pyvista": version("pyvista"), "files": {"whole_body_ct_male": digest}}
    return (
        Volume(volume(scan).astype(np.float32), affine, "whole_body_ct"),
        Volume(volume(organs[organ]) > 0, affine, "whole_body_ct"),
        facts,
    )


def _hold_checksum(file: Path, digest: str, place: str) -> None:
    kept = file.with_name(f"{file.name}.cccd.sha256")
    if kept.is_file():
        if kept.read_text().strip() != digest:
            raise InputError(
                place, "the downloaded whole-body CT has changed since its first use", f"delete {file.parent}"
            )
        return
    try:
        kept.write_text(f"{digest}\n")
    except OSError:  # a read-only cache is kept by someone else
        return


def complete_row(row: Mapping[str, str], folder: Path) -> tuple[dict[str, str], tuple[int, ...]]:
    """Fill in what the layout of a named cohort's download implies: mask and label.

    Gives the row and the implied label values, of which a scan need not hold all. What the sheet gives stays.
    LiTS17: ``segmentation-N.nii`` beside ``volume-N.nii``, 1 liver, 2 tumour
    (which is part of the liver). UPENN-GBM: ``images_segm/ID_segm.nii.gz`` beside ``images_structural/ID/``,
    labels 1, 2, 4; the brain is what skull stripping left.

    Raises
    ------
    InputError
        A name that does not follow the layout, or an organ that the cohort does not have.
    """
    row, labels = dict(row), ()
    path, organ = folder / row["image"], row["organ"].lower()
    if row["source"] == "lits17" and not row["mask"]:
        match = re.fullmatch(r"volume-(\d+)(\.nii(?:\.gz)?)", path.name)
        if not match:
            raise InputError(row["place"], f"{path.name} is no LiTS17 volume", "give volume-N.nii")
        row["mask"] = str(Path(row["image"]).with_name(f"segmentation-{match[1]}{match[2]}"))
    if row["source"] == "lits17" and not row["label"]:
        implied = {"liver": (1, 2), **dict.fromkeys(_TUMOUR, (2,))}
        if organ not in implied:
            raise InputError(
                row["place"], f"LiTS17 has no organ {row['organ']!r}", choices(["liver", "tumour"])
            )
        labels = implied[organ]
    if row["source"] == "upenn_gbm" and not row["mask"] and organ != "brain":
        match = re.match(r"(UPENN-GBM-\d+_\d+)_", path.name)
        if organ not in _TUMOUR:
            raise InputError(
                row["place"], f"UPENN-GBM has no organ {row['organ']!r}", choices(["brain", "tumour"])
            )
        if not match:
            raise InputError(
                row["place"], f"{path.name} is no UPENN-GBM volume", "give UPENN-GBM-NNNNN_NN_T1.nii.gz"
            )
        top = Path(row["image"]).parent.parent.parent
        candidates = [
            top / "images_segm" / f"{match[1]}_segm.nii.gz",
            top / "automated_segm" / f"{match[1]}_automated_approx_segm.nii.gz",
        ]
        row["mask"] = str(next((file for file in candidates if (folder / file).exists()), candidates[0]))
        labels = () if row["label"] else (1, 2, 4)
    return row, labels


def brain_of_stripped(image: Volume) -> Volume:
    """Give the brain of a skull-stripped scan: the largest piece of what is not zero, cavities filled."""
    labels, count = ndimage.label(image.data != 0)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    sizes[0] = 0
    mask = ndimage.binary_fill_holes(labels == sizes.argmax()) if count else labels > 0
    return Volume(mask, image.affine, image.place)
