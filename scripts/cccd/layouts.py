"""What the layouts of named cohorts' downloads imply of a row: its mask and its label.

Imported at every parse of the workflow, so it imports nothing heavy.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path

from cccd.errors import InputError
from cccd.settings.messages import choices

__all__ = ["IMAGES_ALONE", "complete_row"]

#: Sources of an image alone, in which the organ is found; the mask that they bring is ground truth only.
IMAGES_ALONE = ("mni152_scan", "mni152_head", "phantom_scan")
_TUMOUR = ("tumour", "tumor", "lesion")


def complete_row(row: Mapping[str, str], folder: Path) -> tuple[dict[str, str], tuple[int, ...]]:
    """Fill in what the layout of a named cohort's download implies: mask and label.

    Returns the row and the implied label values, of which a scan need not hold all. The sheet goes first.
    LiTS17: ``segmentation-N.nii`` next to ``volume-N.nii``, 1 liver, 2 tumour
    (which is part of the liver). UPENN-GBM: ``images_segm/ID_segm.nii.gz`` next to ``images_structural/ID/``,
    labels 1, 2, 4; the brain is what skull stripping left. Medical Segmentation Decathlon: ``labelsTr``
    next to ``imagesTr``, the labels' names in ``dataset.json``.

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
            raise InputError(row["location"], f"{path.name} is not a LiTS17 volume", "give volume-N.nii")
        row["mask"] = str(Path(row["image"]).with_name(f"segmentation-{match[1]}{match[2]}"))
    if row["source"] == "lits17" and not row["label"]:
        implied = {"liver": (1, 2), **dict.fromkeys(_TUMOUR, (2,))}
        if organ not in implied:
            raise InputError(
                row["location"], f"LiTS17 has no organ {row['organ']!r}", choices(["liver", "tumour"])
            )
        labels = implied[organ]
    if row["source"] == "upenn_gbm" and not row["mask"] and organ != "brain":
        match = re.match(r"(UPENN-GBM-\d+_\d+)_", path.name)
        if organ not in _TUMOUR:
            raise InputError(
                row["location"], f"UPENN-GBM has no organ {row['organ']!r}", choices(["brain", "tumour"])
            )
        if not match:
            raise InputError(
                row["location"], f"{path.name} is not a UPENN-GBM volume", "give UPENN-GBM-NNNNN_NN_T1.nii.gz"
            )
        top = Path(row["image"]).parent.parent.parent
        candidates = [
            top / "images_segm" / f"{match[1]}_segm.nii.gz",
            top / "automated_segm" / f"{match[1]}_automated_approx_segm.nii.gz",
        ]
        row["mask"] = str(next((file for file in candidates if (folder / file).exists()), candidates[0]))
        labels = () if row["label"] else (1, 2, 4)
    if row["source"] == "msd":
        row, labels = _complete_decathlon(row, folder)
    return row, labels


def _complete_decathlon(row: dict[str, str], folder: Path) -> tuple[dict[str, str], tuple[int, ...]]:
    """Fill in what the Medical Segmentation Decathlon's folders imply: a row's mask, its organ's labels."""
    image = Path(row["image"])
    if not row["mask"]:
        if image.parent.name != "imagesTr":
            raise InputError(row["location"], f"{image.name} is not in imagesTr", "give imagesTr/NAME.nii.gz")
        row["mask"] = str(image.parent.with_name("labelsTr") / image.name)
    listing = folder / image.parent.with_name("dataset.json")
    if row["label"] or not listing.is_file():
        return row, ()
    try:
        named = json.loads(listing.read_text(encoding="utf-8"))["labels"]
        values = {str(name).lower(): int(value) for value, name in named.items() if int(value)}
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        raise InputError(
            str(listing), f"no list of labels ({type(error).__name__})", "restore the download's dataset.json"
        ) from None
    organ = values.get(row["organ"].lower())
    return row, tuple(sorted(values.values())) if organ is None else (organ,)
