"""Read the cohort sheet: one row is one structure.

Imported at every parse of the workflow, so it imports nothing heavy and opens no scan: what the rows
point at is checked by the job that reads it, and one bad scan does not keep the others from running.
"""

from __future__ import annotations

import contextlib
import functools
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from cccd.errors import InputError, choices, nearest
from cccd.project import PROJECT
from cccd_segmentation.seeds import parse_seeds
from cccd_workflow.sheet import read_rows

#: The sheet's columns, their defaults and what they may hold.
SCHEMA = PROJECT / "workflow" / "schemas" / "cohort.schema.yaml"

#: Sources of an image alone, in which the organ is found; the mask that they bring is ground truth only.
IMAGES_ALONE = ("mni152_scan", "mni152_head", "phantom_scan")
_FROM_FILES = ("files", "lits17", "rider_lung", "upenn_gbm", "msd")
#: Sources whose boundary pixels need ordering.
_UNORDERED = (*IMAGES_ALONE, "damaged_phantom")
#: Sources with an image in which a seed can say where the organ is.
_SEEDED = ("files", "rider_lung", *IMAGES_ALONE)
#: The folder of `results/` that is no case's.
_TABLES = "tables"


@functools.cache
def _columns() -> dict[str, dict[str, Any]]:
    from jsonschema import Draft202012Validator  # slow to import, and only planning reads the sheet

    schema = yaml.safe_load(SCHEMA.read_text(encoding="utf-8"))
    Draft202012Validator.check_schema(schema)
    return schema["properties"]


def _check_header(location: str, header: list[str]) -> None:
    columns = _columns()
    if len(header) == 1 and re.search("[,;]", header[0]):
        raise InputError(location, "the columns are not separated by tabs", "save it as tab-separated text")
    for name in header:
        if name not in columns:
            raise InputError(location, f"unknown column {name!r}", nearest(name, columns))
        if header.count(name) > 1:
            raise InputError(location, f"column {name!r} is there twice", "keep one")
    for name in ("case", "organ"):
        if name not in header:
            hint = "begin the sheet with a line naming the columns"
            raise InputError(location, f"column {name!r} is missing", hint)


def _check_row(row: dict[str, str]) -> None:
    for name, rules in _columns().items():
        value, allowed = row[name], rules.get("enum")
        if name in ("case", "organ") and not value:
            raise InputError(row["location"], f"{name} is empty", "give every row a case and an organ")
        if allowed and value not in allowed:
            near = nearest(value, allowed)
            hint = f"{near} {choices(allowed)}" if near.startswith("did") else near
            raise InputError(row["location"], f"{name} {value!r} is not known", hint)
        # fullmatch: `$` alone would let a trailing line break through
        if "pattern" in rules and not re.fullmatch(
            rules["pattern"].removeprefix("^").removesuffix("$"), value
        ):
            hint = rules["description"].rstrip(".")
            raise InputError(row["location"], f"{name} {value!r} is not allowed", f"give this: {hint}")
    starred = row["organ"] == "*"
    if starred and (row["source"] != "files" or not row["mask"] or row["boundary"]):
        raise InputError(row["location"], "organ * has no label map", "name it in mask, and no boundary")
    if starred and row["label"]:
        raise InputError(row["location"], "organ * cannot be combined with a label", "empty one of them")
    if row["labels"] and not starred:
        raise InputError(
            row["location"], "a table of labels without organ *", "set organ to * or empty labels"
        )
    if row["source"] == "files" and not (row["image"] or row["mask"] or row["boundary"]):
        raise InputError(row["location"], "neither image nor mask nor boundary", "fill at least one of them")
    if row["source"] in _FROM_FILES[1:] and not row["image"]:
        raise InputError(
            row["location"], f"source {row['source']} needs an image", "give the path of the scan"
        )
    unused = not row["mask"] or row["boundary"] or row["role"] == "train"
    if row["annotated"] == "nonempty" and unused:
        problem = "annotated: nonempty needs a mask that is reconstructed"
        raise InputError(row["location"], problem, "leave annotated empty, or give the row a mask alone")
    if row["seed"]:
        _check_seed(row)
    if row["source"] not in _FROM_FILES:
        for name in ("image", "mask", "boundary", "label"):
            if row[name]:
                raise InputError(
                    row["location"],
                    f"{name} is given, but source {row['source']} has its own",
                    f"empty {name} or set source to files",
                )


def _check_seed(row: Mapping[str, str]) -> None:
    """Refuse a seed that says nothing, or that stands beside what already says where the organ is."""
    location = row["location"]
    parse_seeds(row["seed"], location)
    given = next((name for name in ("mask", "boundary", "label") if row[name]), None)
    if given:
        problem = f"a seed cannot be combined with a {given}"
        raise InputError(location, problem, f"empty seed or {given}: a seed is for an image alone")
    if row["source"] not in _SEEDED:
        problem = f"a seed is given, but source {row['source']} has a mask"
        raise InputError(location, problem, "empty seed, or set source to files and name an image")
    if row["role"] == "train":
        raise InputError(
            location, "a row that trains needs a mask, not a seed", "give the mask or another role"
        )


def read_cohort(path: str | Path) -> list[dict[str, str]]:
    """Read and check the cohort sheet.

    Parameters
    ----------
    path : path
        Tab-separated text with a header line; columns as in ``workflow/schemas/cohort.schema.yaml``.

    Returns
    -------
    list of dict
        One per row, in the sheet's order: every column of the schema (``''`` or the default when empty)
        and ``location``, e.g. ``"cohort.tsv row 3"``, with the line number that an editor shows.

    Raises
    ------
    InputError
        Names file and row, with a hint.
    """
    path = Path(path)
    where, header, lines = read_rows(path, "cohort sheet", "set the config key cohort to your sheet")
    _check_header(where, header)
    rows: list[dict[str, str]] = []
    seen: dict[str, tuple[str, str]] = {}
    for location, given in lines:
        row = {name: given.get(name) or rules.get("default", "") for name, rules in _columns().items()}
        row["location"] = location
        _check_row(row)
        _check_name(row, seen)
        rows.append(row)
    if not rows:
        raise InputError(path.name, "the sheet has no rows", "add one row per structure")
    return rows


def _check_name(row: Mapping[str, str], seen: dict[str, tuple[str, str]]) -> None:
    """Refuse a structure whose folder is another's, and note its folders in ``seen`` in lower case."""
    case, structure = row["case"], f"{row['case']}/{row['organ']}"
    location = row["location"]
    if case.lower() == _TABLES:
        raise InputError(location, f"results/{_TABLES} holds the tables of all cases", "rename the case")
    for name in (case, structure):
        first, where = seen.setdefault(name.lower(), (name, location))
        if first != name:
            problem = f"{name} and {first} of {where} differ only in capitals; many disks mix them up"
            raise InputError(location, problem, "rename one of them")
    if where != location:
        raise InputError(location, f"{structure} is already in {where}", "rename or delete one of them")


def brings_maps(row: Mapping[str, str]) -> bool:
    """Whether a row's boundary pixels need ordering: boundary maps, and edges of an image.

    Those of an image are sought where a seed says that the organ is, or in sources that show that.

    Examples
    --------
    >>> brings_maps({"source": "files", "boundary": "maps.nii.gz", "seed": ""})
    True
    >>> brings_maps({"source": "files", "boundary": "", "seed": "120,88,40"})
    True
    >>> brings_maps({"source": "phantom", "boundary": "", "seed": ""})
    False
    """
    return bool(row["boundary"] or row["seed"]) or row["source"] in _UNORDERED


@contextlib.contextmanager
def naming_row(sheet: str | Path, name: str) -> Iterator[None]:
    """Say which row of the sheet is meant by what goes wrong with a structure.

    Only then is the sheet read: a job that knows its row's number would run again when the row moves.

    Parameters
    ----------
    sheet : path
        The cohort sheet.
    name : str
        ``case/organ``, which stands as the location of the errors that are to be turned.

    Raises
    ------
    InputError
        The one of the block, with the row as its location.
    """
    try:
        yield
    except InputError as error:
        if error.location != name:
            raise
        rows = {f"{row['case']}/{row['organ']}": row["location"] for row in read_cohort(sheet)}
        whole = rows.get(f"{name.split('/')[0]}/*", name)  # a label of a whole map
        raise InputError(rows.get(name, whole), error.problem, error.hint) from None
