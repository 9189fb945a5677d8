"""What the layouts of named cohorts' downloads imply of a row of the sheet: mask and labels.

Imported at every parse of the workflow, so it imports nothing heavy.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

from cccd.errors import InputError, choices
from cccd.request import Request

TUMOUR = ("tumour", "tumor", "lesion")


def complete_lits(request: Request, image: Path) -> Request:
    """LiTS17: ``segmentation-N.nii`` next to ``volume-N.nii``, 1 liver, 2 tumour (a part of it)."""
    mask, labels = request.mask, ()
    if mask is None:
        match = re.fullmatch(r"volume-(\d+)(\.nii(?:\.gz)?)", image.name)
        if not match:
            raise InputError(request.location, f"{image.name} is not a LiTS17 volume", "give volume-N.nii")
        mask = image.with_name(f"segmentation-{match[1]}{match[2]}")
    if not request.label:
        implied = {"liver": (1, 2), **dict.fromkeys(TUMOUR, (2,))}
        if request.organ.lower() not in implied:
            problem = f"LiTS17 has no organ {request.organ!r}"
            raise InputError(request.location, problem, choices(["liver", "tumour"]))
        labels = implied[request.organ.lower()]
    return replace(request, mask=mask, implied=labels)


def complete_upenn(request: Request, image: Path) -> Request:
    """UPENN-GBM: ``images_segm/ID_segm.nii.gz`` next to ``images_structural/ID/``; skull-stripped."""
    if request.mask is not None or request.organ.lower() == "brain":
        return request
    if request.organ.lower() not in TUMOUR:
        problem = f"UPENN-GBM has no organ {request.organ!r}"
        raise InputError(request.location, problem, choices(["brain", "tumour"]))
    match = re.match(r"(UPENN-GBM-\d+_\d+)_", image.name)
    if not match:
        problem = f"{image.name} is not a UPENN-GBM volume"
        raise InputError(request.location, problem, "give UPENN-GBM-NNNNN_NN_T1.nii.gz")
    top = image.parent.parent.parent
    candidates = [
        top / "images_segm" / f"{match[1]}_segm.nii.gz",
        top / "automated_segm" / f"{match[1]}_automated_approx_segm.nii.gz",
    ]
    mask = next((file for file in candidates if (request.folder / file).exists()), candidates[0])
    return replace(request, mask=mask, implied=() if request.label else (1, 2, 4))


def complete_decathlon(request: Request, image: Path) -> Request:
    """Medical Segmentation Decathlon: ``labelsTr`` next to ``imagesTr``, names in ``dataset.json``."""
    mask = request.mask
    if mask is None:
        if image.parent.name != "imagesTr":
            problem = f"{image.name} is not in imagesTr"
            raise InputError(request.location, problem, "give imagesTr/NAME.nii.gz")
        mask = image.parent.with_name("labelsTr") / image.name
    listing = request.folder / image.parent.with_name("dataset.json")
    if request.label or not listing.is_file():
        return replace(request, mask=mask)
    try:
        named = json.loads(listing.read_text(encoding="utf-8"))["labels"]
        values = {str(name).lower(): int(value) for value, name in named.items() if int(value)}
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        raise InputError(
            str(listing), f"no list of labels ({type(error).__name__})", "restore the download's dataset.json"
        ) from None
    organ = values.get(request.organ.lower())
    labels = tuple(sorted(values.values())) if organ is None else (organ,)
    return replace(request, mask=mask, implied=labels)
