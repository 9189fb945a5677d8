"""Which labels of a label map, segments of a SEG or regions of an RTSTRUCT are meant."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path

from cccd.errors import InputError, choices, nearest

#: A map is FreeSurfer's with so many labels, none of another number, and white matter on both sides.
_FEWEST, _WHITE_MATTER = 12, {2, 41}


def plain_name(name: str) -> str:
    """Turn a name into one that the cohort sheet allows."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_")


def choose_labels(names: dict[int, str], label: str, organ: str, location: str, kind: str) -> list[int]:
    """Choose labels by number or name.

    Parameters
    ----------
    names : dict of int to str
        The labels that exist.
    label : str
        Numbers, one name, or several names separated by commas; empty stands for the only one or the one
        that is called like the organ.
    organ : str
        The row's organ.
    location, kind : str
        For the message: the file and what its labels are called.

    Returns
    -------
    list of int
        Numbers of the labels chosen, ascending.

    Raises
    ------
    InputError
        No such label; lists those there are.

    Examples
    --------
    >>> choose_labels({5: "liver", 7: "spleen"}, "Spleen", "organ", "scan.nii", "label")
    [7]
    >>> choose_labels({5: "liver", 7: "spleen"}, "5, 7", "organ", "scan.nii", "label")
    [5, 7]
    """
    there = choices(f"{number} ({name})" if name else number for number, name in sorted(names.items()))
    if not label:
        if len(names) == 1:
            return list(names)
        called = [number for number, name in names.items() if name.lower() == organ.lower()]
        if len(called) == 1:
            return called
        raise InputError(location, f"it has {len(names)} {kind}s and no label says which", there)
    wanted = [part.strip() for part in label.split(",")]
    for parts in ([label], wanted):
        found = [_labels_called(names, part) for part in parts]
        if all(found):
            return sorted({number for numbers in found for number in numbers})
    absent = next(part for part, numbers in zip(wanted, found, strict=True) if not numbers)
    near = nearest(absent, filter(None, names.values()), otherwise=there)
    raise InputError(location, f"it has no {kind} {absent!r}", near)


def _labels_called(names: dict[int, str], wanted: str) -> list[int]:
    """Numbers that ``wanted`` means: an exact name, then a number, then a name in another case."""
    exact = [number for number, name in names.items() if name == wanted]
    if not exact and wanted.isdecimal():
        exact = [number for number in names if number == int(wanted)]
    if exact:
        return exact
    return [number for number, name in names.items() if name.strip().lower() == wanted.lower()]


def freesurfer_labels(location: str, present: Collection[int]) -> dict[int, tuple[str, str]]:
    """Names and colours by FreeSurfer's numbers (and SynthSeg's); none for a map that has others.

    Examples
    --------
    >>> freesurfer_labels("aparc+aseg.mgz", [17, 999, 2035])
    {17: ('Left-Hippocampus', '#dcd814'), 2035: ('ctx-rh-insula', '#ffc020')}
    >>> freesurfer_labels("liver.nii.gz", [17])
    {}
    """
    is_named = re.search(r"aseg|aparc|wmparc|synthseg|\.mg[zh]$", location.lower())
    if not is_named and (len(present) < _FEWEST or not {*present} >= _WHITE_MATTER):
        return {}
    known: dict[int, tuple[str, str]] = {}
    for line in Path(__file__).with_name("freesurfer.txt").read_text(encoding="utf-8").splitlines()[1:]:
        number, name, *rgb = line.split()
        known[int(number)] = name, "#" + bytes(map(int, rgb)).hex()
    found = {number: known[number] for number in present if number in known}
    return found if is_named or len(found) == len(present) else {}
