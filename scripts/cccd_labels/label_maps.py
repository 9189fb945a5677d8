"""Whole label maps: which labels there are, what they are called, and a row of the cohort sheet for each."""

from __future__ import annotations

import colorsys
import csv
import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from cccd.errors import InputError
from cccd.file_headers import object_in
from cccd.geometry.arrays import AnyArray
from cccd.inputs.grid import Volume
from cccd.inputs.labels import freesurfer_labels, plain_name
from cccd.inputs.readers import reader_of
from cccd.inputs.row_files import label_values, list_labels, read_masks
from cccd.store import read_json, write_json

#: Hues of organs without a colour lie this share of the circle apart: no two of the first hundred are alike.
GOLDEN_SHARE = 0.61803398875

#: Labels with less voxels are left out: they have no shape.
LEAST_VOXELS = 12

_NUMBER = ("label", "value", "index", "id", "key", "number", "no.", "labelvalue")
_NAME = ("name", "organ", "structure", "segment", "label_name", "labelname")


@dataclass(frozen=True)
class MapLabel:
    """One label of a map.

    Attributes
    ----------
    label : str
        Its value, or the name of a segment's or region's file.
    name : str
        What it is called; empty where nothing says.
    organ : str
        The name as a folder's, distinct within the map.
    colour : str
        ``#rrggbb``; empty where nothing says.
    code : str
        Of a terminology, as the table has it; empty where nothing says.
    left_out : str
        Why no surface can be made of it; empty where one can.
    """

    label: str
    name: str = ""
    organ: str = ""
    colour: str = ""
    code: str = ""
    left_out: str = ""


def list_map(path: Path, table: Path | None = None) -> list[MapLabel]:
    """List the labels of a map, with names, colours and codes.

    Parameters
    ----------
    path : path
        A label map, a DICOM SEG or RTSTRUCT, or a folder of one-organ masks.
    table : path, optional
        Its names go first; see `read_label_table`. Otherwise those in the file count, those in the
        ``dataset.json`` beside it, and FreeSurfer's where the file or its numbers look like its own.

    Raises
    ------
    InputError
        Not readable, empty, or no label map.
    """
    path = object_in(path)
    parts = read_parts(path, table)
    return _named(path, list_labels(path), {}, table) if parts is None else [label for label, _ in parts]


def read_parts(path: Path, table: Path | None = None) -> list[tuple[MapLabel, Volume]] | None:
    """Read every label of a map, with its voxels.

    Parameters
    ----------
    path : path
        A label map, or a folder of one-organ masks.
    table : path, optional
        Its names go first, as of `list_map`.

    Returns
    -------
    list of (MapLabel, Volume) or None
        Boolean volumes, each no larger than its label; None of what is neither (DICOM, nnU-Net's
        probabilities).

    Raises
    ------
    InputError
        Not readable, empty, or no label map.
    """
    parts = _parts(path)
    if parts is None:
        return None
    found = {label: (name, part) for label, name, part in parts}
    why = {label: _too_little(part.data) for label, (_, part) in found.items()}
    named = _named(path, {label: name for label, (name, _) in found.items()}, why, table)
    return [(label, found[label.label][1]) for label in named]


def _named(
    path: Path, found: Mapping[str, str], why: Mapping[str, str], table: Path | None
) -> list[MapLabel]:
    """Name the labels of a map: ``found`` has the names in the file, ``why`` what is left out."""
    named = read_label_table(table) if table is not None else {}
    if not found:
        raise InputError(path.name, "it contains no label", "give a label map, a SEG or a folder of masks")
    known = freesurfer_labels(path.name, [int(label) for label in found if label.isdecimal()])
    labels: list[MapLabel] = []
    for label, name in found.items():
        row, guess = named.get(label, MapLabel(label)), known.get(int(label) if label.isdecimal() else 0)
        name = row.name or name or (guess[0] if guess else "")
        colour = row.colour or (guess[1] if guess and name == guess[0] else "")
        organ = plain_name(name) or f"label_{plain_name(label)}"
        labels.append(MapLabel(label, name, organ, colour, row.code, why.get(label, "")))
    twice = {organ for organ, count in Counter(label.organ.lower() for label in labels).items() if count > 1}
    return [
        replace(label, organ=f"{label.organ}_{plain_name(label.label)}")
        if label.organ.lower() in twice
        else label
        for label in labels
    ]


def _parts(path: Path) -> Iterator[tuple[str, str, Volume]] | None:
    """Labels of a volume or of a folder's masks: label, name, boolean voxels; None for DICOM."""
    if path.is_dir() and reader_of(path) is None:
        return ((name, name, _boxed(mask.data, mask)) for name, mask in read_masks(path))
    volume = label_values(path)
    return None if volume is None else _parts_of(volume)


def _parts_of(volume: Volume) -> Iterator[tuple[str, str, Volume]]:
    values, ranks = _ranked(volume.data)
    boxes = ndimage.find_objects(ranks)
    for rank, (value, box) in enumerate(zip(values.tolist(), boxes, strict=True), 1):
        yield str(value), volume.names.get(value, ""), _cut(ranks[box] == rank, box, volume)


def _ranked(data: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Return the values above 0, ascending, and the voxels' ranks among them, from 1; 0 elsewhere."""
    values = np.maximum(data, 0)
    high = int(values.max(initial=0))
    if high >= 1 << 24:
        present, inverse = np.unique(values, return_inverse=True)
        background = int(present[0] == 0)
        return present[background:], inverse.reshape(data.shape).astype(np.int32) + (1 - background)
    rank_of = np.zeros(high + 1, np.int32)  # ten times as fast as sorting
    rank_of[values] = 1
    rank_of[0] = 0
    present = np.flatnonzero(rank_of)
    rank_of[present] = np.arange(1, len(present) + 1)
    return present, rank_of[values]


def _boxed(mask: AnyArray, volume: Volume) -> Volume:
    """Cut a mask that is not empty to its own size."""
    (box,) = ndimage.find_objects(mask.astype(np.uint8))
    return _cut(mask[box], box, volume)


def _cut(part: AnyArray, box: tuple[slice, ...], volume: Volume) -> Volume:
    """Return a part of a volume's grid as a volume of its own."""
    affine = volume.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ [side.start for side in box]
    return Volume(part, affine, volume.location)


def _too_little(part: AnyArray) -> str:
    """Why a label of these voxels is left out; empty where they are enough."""
    count = int(np.count_nonzero(part))
    if count >= LEAST_VOXELS:
        return ""
    return "a single voxel" if count == 1 else f"{count} voxels"


def colour_of(number: int) -> str:
    """Colour, ``#rrggbb``, of the organ of a number, where nothing gives one."""
    # hues that nearly agree are a Fibonacci number apart (21, 34, 55): saturation or value tells them
    rgb = colorsys.hsv_to_rgb(
        GOLDEN_SHARE * number % 1, 0.5 + 0.25 * (number % 2), (0.85, 0.62, 0.98)[number % 3]
    )
    return "#" + "".join(f"{round(255 * part):02x}" for part in rgb)


def read_label_table(path: Path) -> dict[str, MapLabel]:
    """Read names, colours and codes of labels.

    Parameters
    ----------
    path : path
        Comma- or tab-separated text with a header (``label``, ``name``; if wanted, ``color`` and ``code``), a
        FreeSurfer or ITK-SNAP colour table (number, name, red, green, blue), or a ``dataset.json``.

    Raises
    ------
    InputError
        Not there, or no such table.
    """
    hint = "give lines of label and name, separated by commas or tabs, below a header"
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError):
        raise InputError(str(path), "the table of labels cannot be read", hint) from None
    if path.suffix == ".json":
        return _json_table(text, path)
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if lines and re.match(r"\s*\d+\s+\S+(\s+\d+){3}", lines[0]):
        parts = [line.split() for line in lines]
        return {
            part[0]: MapLabel(part[0], part[1], colour=_colour(" ".join(part[2:5])))
            for part in parts
            if part[0].isdecimal() and int(part[0])
        }
    if not lines:
        raise InputError(path.name, "the table of labels is empty", hint)
    separator = "\t" if "\t" in lines[0] else ";" if ";" in lines[0] else ","
    reader = csv.DictReader(lines, delimiter=separator)
    header = {str(column).strip().lower(): column for column in reader.fieldnames or ()}
    number = next((header[column] for column in _NUMBER if column in header), None)
    name = next((header[column] for column in _NAME if column in header), None)
    if number is None or name is None:
        raise InputError(path.name, "its header has no columns label and name", hint)
    colour = next((header[column] for column in ("color", "colour", "rgb") if column in header), "")
    code = next((header[column] for column in ("code", "terminology") if column in header), "")
    table: dict[str, MapLabel] = {}
    for row in reader:
        label = str(row[number] or "").strip()
        if not label:
            continue
        if label in table:
            raise InputError(
                f"{path.name} row {reader.line_num}", f"label {label} is there twice", "keep one"
            )
        parts = [str(row.get(column) or "").strip() for column in (name, colour, code)]
        table[label] = MapLabel(label, parts[0], colour=_colour(parts[1]), code=parts[2])
    return table


def _json_table(text: str, path: Path) -> dict[str, MapLabel]:
    """Names of nnU-Net's ``dataset.json``, whichever way round it has them."""
    try:
        pairs = json.loads(text)["labels"].items()
    except (AttributeError, KeyError, TypeError, ValueError):
        raise InputError(path.name, "it contains no labels", "give nnU-Net's dataset.json") from None
    both = [(key, value) if str(key).isdecimal() else (value, key) for key, value in pairs]
    return {str(value): MapLabel(str(value), str(name)) for value, name in both if str(value).isdecimal()}


def _colour(text: str) -> str:
    """Turn ``#rrggbb`` or three numbers, up to 1 or up to 255, into ``#rrggbb``; empty where it is none."""
    if re.fullmatch(r"#?[0-9A-Fa-f]{6}", text):
        return "#" + text.lstrip("#").lower()
    numbers = [float(part) for part in re.findall(r"\d+(?:\.\d+)?", text)][:3]
    if len(numbers) < 3 or max(numbers) > 255:
        return ""
    scale = 255 if max(numbers) <= 1 and "." in text else 1
    return "#" + "".join(f"{round(scale * number):02x}" for number in numbers)


# rows of the cohort sheet -----------------------------------------------------------------------------


def expand_rows(
    rows: Sequence[Mapping[str, str]], folder: Path, cache: Path
) -> tuple[list[dict[str, str]], dict[str, dict[str, dict[str, str]]], list[str]]:
    """Put a row for every label in the place of each row whose organ is ``*``.

    Parameters
    ----------
    rows : sequence of mapping
        What `cccd_workflow.cohort.read_cohort` returned.
    folder : path
        The sheet's, from which paths are relative.
    cache : path
        Folder that remembers what the maps hold: each is read once, and again when it has changed.

    Returns
    -------
    rows : list of dict
    labels : dict
        By case and organ, what the map says of it: `MapLabel`'s attributes.
    notes : list of str
        Lines about labels that are left out or renamed, of maps that were read anew.

    Raises
    ------
    InputError
        Names the row, what is wrong with its map or table, and a hint.
    """
    expanded: list[dict[str, str]] = []
    labels: dict[str, dict[str, dict[str, str]]] = {}
    notes: list[str] = []
    seen = {(row["case"], row["organ"]): row["location"] for row in rows}
    for row in rows:
        plain = {key: value for key, value in row.items() if key != "labels"}
        if row["organ"] != "*":
            expanded.append(plain)
            continue
        try:
            found, fresh = _remembered(folder, row, cache)
        except InputError as error:
            raise error.at(row["location"]) from None
        kept = [label for label in found if not label.left_out]
        if not kept:
            raise InputError(row["location"], "no label is large enough for a surface", "check the map")
        for label in kept:
            key = (row["case"], label.organ)
            if key in seen:
                raise InputError(
                    row["location"], f"{'/'.join(key)} is already in {seen[key]}", "rename one of them"
                )
            seen[key] = row["location"]
            expanded.append({**plain, "organ": label.organ, "label": label.label})
            labels.setdefault(row["case"], {})[label.organ] = {**asdict(label), "mask": row["mask"]}
        if fresh:
            notes += _notes(row, found)
    return expanded, labels, notes


def _remembered(folder: Path, row: Mapping[str, str], cache: Path) -> tuple[list[MapLabel], bool]:
    """List what a row's map holds, and say whether it was read anew."""
    path = folder / row["mask"]
    table = folder / row["labels"] if row["labels"] else None
    if not path.exists():
        raise InputError("mask", f"there is no {path.name}", "correct the path")
    beside = [path.parent / "dataset.json", path.parent.parent / "dataset.json"]
    files = [path, *(sorted(path.iterdir()) if path.is_dir() else ()), *beside, *([table] if table else [])]
    stamps = [(str(file), file.stat().st_mtime_ns, file.stat().st_size) for file in files if file.exists()]
    key = hashlib.sha256(json.dumps([4, str(table), stamps]).encode()).hexdigest()[:24]
    known = cache / f"{key}.json"
    try:
        return [MapLabel(**label) for label in read_json(known)["labels"]], False
    except (OSError, KeyError, TypeError, ValueError):
        found = list_map(path, table)
    write_json(known, {"labels": [asdict(label) for label in found]})
    return found, True


def _notes(row: Mapping[str, str], found: Sequence[MapLabel]) -> list[str]:
    """Lines about what is not as the map has it."""
    where = f"{row['location']}: {Path(row['mask']).name}"
    lines = [
        f"{where}: label {label.label} ({label.name or 'no name'}) is left out: {label.left_out}"
        for label in found
        if label.left_out
    ]
    names: dict[str, list[str]] = {}
    for label in found:
        names.setdefault(plain_name(label.name).lower(), []).append(label.organ)
    lines += [
        f"{where}: {len(organs)} labels are called {name}; they become {', '.join(organs)}"
        for name, organs in names.items()
        if name and len(organs) > 1
    ]
    return lines


def shared_groups(
    rows: Sequence[Mapping[str, str]], labels: Mapping[str, Any], wanted: bool | str
) -> dict[str, list[str]]:
    """Which organs of each case share their walls.

    Parameters
    ----------
    rows : sequence of mapping
        Expanded rows.
    labels : mapping
        Cases with a row ``*``.
    wanted : bool or "auto"
        ``surface.shared_walls``: never, wherever a case has several organs of one mask, or those of ``*``.

    Returns
    -------
    dict of str to list of str
        Organs by case.
    """
    groups: dict[str, list[str]] = {}
    for row in rows:
        starred = row["organ"] in labels.get(row["case"], {})
        masked = row["source"] == "files" and row["mask"] and not row["boundary"]
        if masked and row["role"] != "train" and (wanted is True or (wanted == "auto" and starred)):
            groups.setdefault(row["case"], []).append(row["organ"])
    return {case: organs for case, organs in groups.items() if len(organs) > 1}
