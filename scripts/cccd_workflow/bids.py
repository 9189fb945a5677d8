"""Masks and label maps of a BIDS data set, as rows of a cohort sheet."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from cccd.errors import InputError, choices
from cccd.inputs.labels import plain_name

#: Suffixes of BIDS derivatives that are masks, and of label maps.
_MASK, _LABELS = "mask", "dseg"

_FILE = re.compile(r"(?P<entities>sub-[A-Za-z0-9]+(?:_[a-z]+-[A-Za-z0-9]+)*)_(?P<kind>mask|dseg)\.nii(\.gz)?")


def find_structures(
    folder: Path, labels: Callable[[Path], Mapping[str, str]], participants: Iterable[str] = ()
) -> list[dict[str, str]]:
    """Find what can be reconstructed below a data set's ``derivatives``: a row for each mask and each label.

    Parameters
    ----------
    folder : path
        The BIDS data set, or one of its derivatives.
    labels : callable
        Lists a label map's labels and their names (`cccd.labels`); names in the table beside it go first.
    participants : iterable of str
        Names of participants, with or without ``sub-``; all of them by default.

    Returns
    -------
    list of dict
        ``case``, ``organ``, ``mask`` (absolute) and ``label``, sorted.

    Raises
    ------
    InputError
        No such folder, no mask in it, or a participant that is not there.
    """
    if not folder.is_dir():
        raise InputError(str(folder), "no such folder", "give the folder of a BIDS data set")
    top = folder / "derivatives" if (folder / "derivatives").is_dir() else folder
    found = [
        (path, match) for path in sorted(top.rglob("sub-*.nii*")) if (match := _FILE.fullmatch(path.name))
    ]
    if not found:
        raise InputError(
            str(top), "no sub-*_mask.nii.gz and no sub-*_dseg.nii.gz below it", "segment it first"
        )
    wanted = {f"sub-{name.removeprefix('sub-')}" for name in participants}
    there = {match["entities"].split("_")[0] for _, match in found}
    if wanted - there:
        absent = ", ".join(sorted(wanted - there))
        raise InputError(str(top), f"no masks of {absent}", choices(sorted(there)))
    rows: list[dict[str, str]] = []
    for path, match in found:
        entities = match["entities"].split("_")
        if wanted and entities[0] not in wanted:
            continue
        case = _case(entities, path, top)
        if match["kind"] == _MASK:
            rows.append({"case": case, "organ": _organ(entities), "mask": str(path.resolve()), "label": ""})
            continue
        named = dict(labels(path)) | _table_beside(path)
        for label in dict(labels(path)):
            organ = plain_name(named.get(label, "")) or f"label_{label}"
            rows.append({"case": case, "organ": organ, "mask": str(path.resolve()), "label": label})
    return _distinct(rows)


def _case(entities: list[str], path: Path, top: Path) -> str:
    """Participant and session, behind the pipeline where several made derivatives."""
    names = [part for part in entities if part.split("-")[0] in ("sub", "ses")]
    pipeline = path.relative_to(top).parts[0]
    return "_".join(names if pipeline.startswith("sub-") else [*names, plain_name(pipeline)])


def _organ(entities: list[str]) -> str:
    """Name what a mask is of: its entity ``label``, or else ``desc``, or else ``mask``."""
    parts = dict(part.split("-", 1) for part in entities)
    return plain_name(parts.get("label") or parts.get("desc") or "mask")


def _table_beside(path: Path) -> dict[str, str]:
    """Names of labels from the ``_dseg.tsv`` beside a label map, or the one at the pipeline's root."""
    own = path.with_name(path.name.split(".nii")[0] + ".tsv")
    shared = [table for parent in path.parents[:4] for table in sorted(parent.glob("desc-*_dseg.tsv"))]
    for table in [own, *shared]:
        if table.is_file():
            with table.open(encoding="utf-8-sig", newline="") as file:
                rows = list(csv.DictReader(file, delimiter="\t"))
            return {str(row["index"]): row["name"] for row in rows if row.get("index") and row.get("name")}
    return {}


def _distinct(rows: list[dict[str, str]]) -> list[dict[str, str]]:
    """Give numbers to what would stand twice: two masks of one organ, two labels of one name."""
    seen: dict[tuple[str, str], int] = {}
    for row in rows:
        key = row["case"], row["organ"]
        seen[key] = seen.get(key, 0) + 1
        if seen[key] > 1:
            row["organ"] += f"_{seen[key]}"
    return rows


def write_sheet(path: Path, rows: list[dict[str, str]]) -> None:
    """Write rows as a cohort sheet."""
    columns = ("case", "organ", "mask", "label")
    lines = ["\t".join(columns), *("\t".join(row[name] for name in columns) for row in rows)]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
