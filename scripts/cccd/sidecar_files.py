"""Headers whose voxels are in files of their own: MetaImage, NRRD, Analyze and NIfTI pairs.

Imported at every parse of the workflow, so it imports nothing heavy and reads headers only.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

__all__ = ["IN_ITSELF", "SEVERAL_FILES", "VOXEL_FILE", "voxel_files"]

#: Where a header says that its voxels are: in itself, in several files, or in the file of this name.
VOXEL_FILE = re.compile(rb"^(?:ElementDataFile *=|data ?file:) *(.*?)\s*$", re.MULTILINE | re.IGNORECASE)
IN_ITSELF = re.compile(rb"local", re.IGNORECASE)
SEVERAL_FILES = re.compile(rb"list( \d)?|[^%\s]+%0?\d?d[^%\s]*( \d+ \d+( [1-9]\d*( \d)?)?)?", re.IGNORECASE)

# Headers are no longer.
_HEADER_BYTES = 1 << 20

_PAIRS = {".hdr": (".img", ".img.gz"), ".img": (".hdr",)}


def voxel_files(path: Path) -> list[Path]:
    """Give the further files that a volume consists of, those that exist.

    Parameters
    ----------
    path : Path
        What the sheet names. Of a file that cannot be read nothing is given; its reader says why.
    """
    suffix = path.suffix.lower()
    found = [path.with_suffix(other) for other in _PAIRS.get(suffix, ())]
    if suffix in (".mhd", ".nhdr"):
        found = _named(path)
    # os.path takes names that no file can have, as damaged headers hold; Path raises
    return sorted({file for file in found if os.path.isfile(file)} - {path})


def _named(path: Path) -> list[Path]:
    try:
        with path.open("rb") as file:
            header = file.read(_HEADER_BYTES)
    except OSError:
        return []
    found = VOXEL_FILE.search(header)
    if found is None or IN_ITSELF.fullmatch(found[1]):
        return []
    value = found[1].decode(errors="replace")
    if not SEVERAL_FILES.fullmatch(found[1]):
        return [path.parent / value]
    if "%" not in value:  # a list: a line each
        lines = header[found.end() :].decode(errors="replace").splitlines()
        return [path.parent / line.strip() for line in lines]
    pattern = path.parent / value.split()[0]
    form = r"\d+".join(map(re.escape, re.split(r"%0?\d?d", pattern.name)))
    beside = pattern.parent.glob("*") if os.path.isdir(pattern.parent) else ()
    return [file for file in beside if re.fullmatch(form, file.name)]
