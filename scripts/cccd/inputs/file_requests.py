"""From a path, and what else a caller says, to a `Request`."""

from __future__ import annotations

from collections.abc import Iterable
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeAlias, cast

import numpy as np

from cccd.errors import InputError, nearest
from cccd.file_headers import dicom_modality, is_object, object_in
from cccd.inputs.annotation import AUTO, NONEMPTY, RULES
from cccd.inputs.labels import image_without_mask
from cccd.inputs.load import existing
from cccd.inputs.readers import reader_of, volume_suffix, without_suffix
from cccd.plugins import find, table
from cccd.request import Request

#: Value(s) of a label map, or a name.
Label: TypeAlias = str | int | Iterable[int]
#: Whether grey values find the organ, and which, None for no bound.
Threshold: TypeAlias = bool | tuple[float | None, float | None]

#: DICOM modalities that are no images.
_OBJECTS = ("SEG", "RTSTRUCT", "RTPLAN", "RTDOSE")


def request_for(
    path: str | Path,
    label: Label = "",
    *,
    image: str | Path | None = None,
    boundary: bool = False,
    annotated: str = AUTO,
    threshold: Threshold = False,
    seeds: tuple[str, ...] = (),
) -> Request:
    """Ask for one organ of a file or folder; parameters are those of `cccd.read`.

    Raises
    ------
    InputError
        The file is not there, is an image without a mask, or things are asked that exclude each other.
    """
    path = Path(path).absolute()
    existing(path, path.name)
    chosen = _chosen(label)
    alone = "seed" if seeds else "threshold" if threshold is not False else None
    if alone and (chosen or image is not None or boundary):
        problem = f"a {alone} cannot be combined with a label, an image or boundary maps"
        hint = "give only the image" + "; a threshold does not find organs" * (alone == "threshold")
        raise InputError(path.name, problem, hint)
    if seeds and threshold is not False:
        raise InputError(path.name, "a seed cannot be combined with a threshold", "give one of them")
    window = None if isinstance(threshold, bool) else _range(threshold)
    is_mask = not (boundary or alone)
    if is_mask:
        refuse_image(path, chosen)
    if annotated == NONEMPTY and not is_mask:
        raise InputError(path.name, "annotated: nonempty needs a mask", "leave annotated out")
    scan = path if alone else None if image is None else Path(image).absolute()
    if is_mask and scan is None and (_holds_images(path) if path.is_dir() else _lies_in_its_series(path)):
        scan = path if path.is_dir() else path.parent
    name = name_of(path)
    organ = name if not chosen or chosen.replace(",", "").isdecimal() else chosen
    if chosen.isdecimal():
        organ = ""  # the file may have a name for it
    if alone:
        organ = {"seed": "seeded", "threshold": "threshold"}[alone]
    return Request(
        case=name,
        organ=organ,
        location=path.name,
        image=scan,
        mask=path if is_mask else None,
        boundary=path if boundary else None,
        label=chosen,
        annotated=check_rule(annotated),
        seeds=seeds,
        window=window,
    )


def _chosen(label: Label) -> str:
    """Return labels as the cohort sheet writes them."""
    if isinstance(label, (str, Integral)):
        return str(label)
    if isinstance(label, Iterable):
        return ",".join(str(value) for value in label)
    raise InputError("label", f"{label!r} is not a label", "give its value, its name, or several values")


def _range(threshold: object) -> tuple[float | None, float | None]:
    """Return two bounds, of which one may be None and the lower one is the first."""
    pair = cast("tuple[Any, ...]", threshold) if isinstance(threshold, (tuple, list)) else ()
    bounds = [bound for bound in pair if bound is not None]
    real = all(isinstance(bound, Real) and not np.isnan(float(bound)) for bound in bounds)
    if len(pair) != 2 or not bounds or not real or (len(bounds) == 2 and not bounds[0] < bounds[1]):
        hint = "give (low, high), the lower one first, None for no bound (--threshold LOW:HIGH)"
        raise InputError("threshold", f"{threshold!r} is not a range", hint)
    return pair[0], pair[1]


def check_rule(annotated: str) -> str:
    """Return a rule by which slices count as annotated, provided that there is such a one."""
    if annotated not in RULES:
        raise InputError("annotated", f"{annotated!r} is not known", nearest(annotated, RULES))
    return annotated


def name_of(path: Path) -> str:
    """Return a file's name without the suffix of its format, a folder's as it is."""
    if path.is_dir() and reader_of(path) is None:
        return path.name
    plain = without_suffix(path.name)
    return path.stem if plain is None else plain


def refuse_image(path: Path, label: str = "") -> None:
    """Refuse a DICOM image or series in which a label is looked for."""
    if _is_image(path):
        raise image_without_mask(path.name, label)


def holds_series(folder: Path) -> bool:
    """Whether a folder is read as a DICOM series, or holds one beside a segmentation."""
    return _holds_images(folder) or _is_image(folder)


def _is_image(path: Path) -> bool:
    """Whether a path is a DICOM image or series without a mask."""
    if path.is_dir() and reader_of(path):
        return False
    if not path.is_dir():
        return dicom_modality(path) not in (None, "", *_OBJECTS)
    files = [file for file in path.rglob("*") if file.is_file()]
    if not files:
        raise InputError(path.name, "there is no file in this folder", "give a mask or a DICOM folder")
    masks = any(volume_suffix(file.name) for file in path.iterdir())
    return not masks and object_in(path) == path and any(dicom_modality(file) is not None for file in files)


def _holds_images(folder: Path) -> bool:
    """Whether a folder holds DICOM images beside a segmentation."""
    kinds = {dicom_modality(file) for file in folder.iterdir() if file.is_file()}
    return bool(kinds - {None, "", *_OBJECTS})


def _lies_in_its_series(path: Path) -> bool:
    """Whether a file is a SEG or RTSTRUCT that lies in one folder with the series that it was made on."""
    return is_object(path) and find(table("OPTIONS")["in_its_series"])(path)
