"""Whether a disk has room for what a run is going to write, asked before its first job."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path

from cccd.errors import InputError

#: Bytes of each result of the smallest structure that was measured, the phantom sphere (98 x 98 x 23 voxels);
#: a clinical organ's are five to twenty times that.
_LEAST = {
    "structure.h5": 250_000,
    "boundaries.h5": 11_000,
    "contours.h5": 11_000,
    "curves.h5": 32_000,
    "surface.h5": 14_000,
    "surface.ply": 440_000,
    "view.h5": 270_000,
    "picture.png": 190_000,
    "report.html": 1_200_000,
}

#: A file takes a block at least; so do its job's log and benchmark, and what Snakemake notes of it.
_BLOCK = 4096
_BESIDE = 3 * _BLOCK


def least_bytes(files: Iterable[str | Path]) -> int:
    """Bytes that results take at least, beyond those that lie there already and are going to be replaced.

    Parameters
    ----------
    files : iterable of path
        What is going to be written.

    Examples
    --------
    >>> least_bytes(["results/anna/liver/surface.ply"])
    452288
    """
    total = 0
    for path in map(Path, files):
        there = path.stat().st_size if path.is_file() else 0
        total += max(_LEAST.get(path.name, _BLOCK) - there, 0) + _BESIDE
    return total


def check_room(folder: Path, files: Iterable[str | Path]) -> None:
    """Refuse a run whose results cannot fit on the disk.

    Parameters
    ----------
    folder : path
        Where the results go; it or a folder above it exists.
    files : iterable of path
        What the run is going to write.

    Raises
    ------
    InputError
        Less room than even the smallest structures' results take.
    """
    there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    needed, free = least_bytes(files), shutil.disk_usage(there).free
    if needed > free:
        problem = f"{_in_words(free)} free, and this run writes at least {_in_words(needed)}"
        raise InputError(str(folder), problem, "free some space, or write to another disk with --directory")


def _in_words(size: int) -> str:
    """Bytes in the largest unit that leaves a whole number.

    >>> _in_words(2_500_000)
    '2.5 MB'
    """
    for unit, name in ((10**12, "TB"), (10**9, "GB"), (10**6, "MB")):
        if size >= unit:
            return f"{size / unit:.1f} {name}"
    return f"{size / 1000:.0f} kB"
