"""What a row of the cohort sheet, a command or a function asks for, and what a named cohort implies of it.

Imported at every parse of the workflow, so it imports nothing heavy.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from cccd.errors import InputError, choices

#: Sources of an image alone, in which the organ is found; the mask that they bring is ground truth only.
IMAGES_ALONE = ("mni152_scan", "mni152_head", "phantom_scan")
_TUMOUR = ("tumour", "tumor", "lesion")


@dataclass(frozen=True)
class Request:
    """One organ that is asked for.

    Attributes
    ----------
    case, organ : str
        An empty organ gets the name of its label in the file.
    location : str
        What messages name: a row of the sheet, or a file.
    source : str
        ``files``, or a scan that is made or brought (a row of the table ``SOURCES``).
    folder : Path
        Paths are relative to it.
    image, mask, boundary : Path or None
        Files or folders, as they were named.
    label : str
        Value(s) of a label map, or the name of an organ, segment or ROI.
    implied : tuple of int
        Labels that a named cohort's layout implies, of which some may be missing.
    annotated : str
        Which slices are annotated, see `cccd.inputs.annotation.RULES`.
    seeds : tuple of str
        Voxels or boxes within the organ, of an image without a mask (`cccd_segmentation.seeds`).
    window : (float or None, float or None) or None
        Grey values of the organ, of an image without a mask; None for the settings' own.
    """

    case: str
    organ: str
    location: str
    source: str = "files"
    folder: Path = Path()
    image: Path | None = None
    mask: Path | None = None
    boundary: Path | None = None
    label: str = ""
    implied: tuple[int, ...] = ()
    annotated: str = "auto"
    seeds: tuple[str, ...] = ()
    window: tuple[float | None, float | None] | None = None

    @classmethod
    def of_row(cls, row: Mapping[str, str], folder: Path) -> Request:
        """Take a row of the cohort sheet in ``folder``; columns that are left out are empty.

        Examples
        --------
        >>> row = {"case": "a", "organ": "liver", "location": "sheet.tsv row 2", "mask": "a.nii", "image": ""}
        >>> Request.of_row(row, Path("/data")).files
        {'mask': PosixPath('/data/a.nii')}
        """

        def path(column: str) -> Path | None:
            return Path(row[column]) if row.get(column) else None

        return cls(
            row["case"],
            row["organ"],
            row["location"],
            row.get("source") or "files",
            folder,
            path("image"),
            path("mask"),
            path("boundary"),
            label=row.get("label", ""),
            annotated=row.get("annotated") or "auto",
            seeds=(row["seed"],) if row.get("seed") else (),
        )

    @property
    def files(self) -> dict[str, Path]:
        """Where the files that are named lie, by what they are."""
        named = {"image": self.image, "mask": self.mask, "boundary": self.boundary}
        return {name: self.folder / path for name, path in named.items() if path is not None}


def completed(request: Request) -> Request:
    """Fill in what the layout of a named cohort's download implies: mask and label. The sheet goes first.

    LiTS17: ``segmentation-N.nii`` next to ``volume-N.nii``, 1 liver, 2 tumour
    (which is part of the liver). UPENN-GBM: ``images_segm/ID_segm.nii.gz`` next to ``images_structural/ID/``,
    labels 1, 2, 4; the brain is what skull stripping left. Medical Segmentation Decathlon: ``labelsTr``
    next to ``imagesTr``, the labels' names in ``dataset.json``.

    Raises
    ------
    InputError
        A name that does not follow the layout, or an organ that the cohort does not have.
    """
    complete = {"lits17": _complete_lits, "upenn_gbm": _complete_upenn, "msd": _complete_decathlon}
    way = complete.get(request.source)
    return request if way is None or request.image is None else way(request, request.image)


def _complete_lits(request: Request, image: Path) -> Request:
    mask, labels = request.mask, ()
    if mask is None:
        match = re.fullmatch(r"volume-(\d+)(\.nii(?:\.gz)?)", image.name)
        if not match:
            raise InputError(request.location, f"{image.name} is not a LiTS17 volume", "give volume-N.nii")
        mask = image.with_name(f"segmentation-{match[1]}{match[2]}")
    if not request.label:
        implied = {"liver": (1, 2), **dict.fromkeys(_TUMOUR, (2,))}
        if request.organ.lower() not in implied:
            problem = f"LiTS17 has no organ {request.organ!r}"
            raise InputError(request.location, problem, choices(["liver", "tumour"]))
        labels = implied[request.organ.lower()]
    return replace(request, mask=mask, implied=labels)


def _complete_upenn(request: Request, image: Path) -> Request:
    if request.mask is not None or request.organ.lower() == "brain":
        return request
    if request.organ.lower() not in _TUMOUR:
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


def _complete_decathlon(request: Request, image: Path) -> Request:
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
