"""What the headers of files say: which DICOM object it is, and where a MetaImage's or a NRRD's voxels are.

Imported at every parse of the workflow, so it imports nothing heavy (pydicom for DICOM files only), and reads
no more than headers.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import NamedTuple

from cccd.errors import InputError, choices
from cccd.extras import missing_extra

#: Every DICOM file begins with so many bytes of anything, and then these (PS3.10, section 7.1).
_PREAMBLE, _MAGIC = 128, b"DICM"


def dicom_modality(path: Path) -> str | None:
    """Read the modality of a DICOM file (``CT``, ``SEG``, ``RTSTRUCT``, ...), None for any other file.

    A damaged header has the modality ``""``, as has a file that cannot be opened: its reader will say what is
    wrong with it.

    Raises
    ------
    InputError
        It is DICOM, and pydicom is not installed.
    """
    return (header_of(path, "Modality") or {}).get("Modality")


def header_of(path: Path, *keywords: str) -> dict[str, str] | None:
    """Read values of a DICOM file's header, empty where it has none; None for any other file."""
    try:
        with path.open("rb") as file:
            if file.read(_PREAMBLE + len(_MAGIC))[_PREAMBLE:] != _MAGIC:
                return None
        import pydicom

        header = pydicom.dcmread(path, stop_before_pixels=True, specific_tags=list(keywords))
        return {keyword: str(header.get(keyword, "")) for keyword in keywords}
    except ModuleNotFoundError as error:
        raise missing_extra(error, path.name) from None
    except Exception:  # pydicom raises whatever its parser meets
        return dict.fromkeys(keywords, "")


def is_object(path: Path) -> bool:
    """Whether a file is a SEG or an RTSTRUCT."""
    return path.is_file() and dicom_modality(path) in ("SEG", "RTSTRUCT")


def object_in(path: Path) -> Path:
    """Find the one SEG or RTSTRUCT in a folder; any other path stays as it is.

    Raises
    ------
    InputError
        The folder holds several.
    """
    if not path.is_dir():
        return path
    objects = [file for file in sorted(path.iterdir()) if is_object(file)]
    if len(objects) > 1:
        raise InputError(
            path.name, f"it contains {len(objects)} SEG or RTSTRUCT objects", choices(f.name for f in objects)
        )
    return objects[0] if objects else path


# The field that says where the voxels are; its values for "in this file" and "in several files".
_VOXEL_FIELD = re.compile(rb"^(?:ElementDataFile *=|data ?file:) *(.*?)\s*$", re.MULTILINE | re.IGNORECASE)
_IN_ITSELF = re.compile(rb"local", re.IGNORECASE)
_SEVERAL_FILES = re.compile(rb"list( \d)?|[^%\s]+%0?\d?d[^%\s]*( \d+ \d+( [1-9]\d*( \d)?)?)?", re.IGNORECASE)

# Headers are no longer.
_HEADER_BYTES = 1 << 20

_PAIRS = {".hdr": (".img", ".img.gz"), ".img": (".hdr",), ".npz": (".pkl",)}


class VoxelHeader(NamedTuple):
    """The header of a MetaImage or NRRD.

    Attributes
    ----------
    fields : bytes
        Its lines: of a MetaImage down to the one that says where the voxels are, of a NRRD down to the first
        blank line.
    voxels : bytes or None
        What it says of where the voxels are; None where they are in the file itself.
    listed : bytes
        Lines that follow the field of ``voxels``: the file names of a list.
    """

    fields: bytes
    voxels: bytes | None
    listed: bytes

    @property
    def in_several_files(self) -> bool:
        """Whether the voxels are in files that are listed or numbered."""
        return self.voxels is not None and _SEVERAL_FILES.fullmatch(self.voxels) is not None


def read_voxel_header(path: Path) -> VoxelHeader:
    """Read the header of a MetaImage (``.mha``, ``.mhd``) or NRRD (``.nrrd``, ``.nhdr``), damaged or not.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    with path.open("rb") as file:
        start = file.read(_HEADER_BYTES)
    is_meta = path.name.lower().endswith((".mha", ".mhd"))
    header = start if is_meta else re.split(rb"\r?\n\r?\n", start)[0]
    found = _VOXEL_FIELD.search(header)
    if found is None:
        return VoxelHeader(header, None, b"")
    voxels = None if _IN_ITSELF.fullmatch(found[1]) else found[1]
    return VoxelHeader(header[: found.end()] if is_meta else header, voxels, header[found.end() :])


def voxel_files(path: Path) -> list[Path]:
    """List the further files that a volume consists of, those that exist.

    Parameters
    ----------
    path : Path
        A file that the sheet names; one that cannot be read has none, its reader says why.
    """
    suffix = path.suffix.lower()
    found = [path.with_suffix(other) for other in _PAIRS.get(suffix, ())]
    if suffix in (".mhd", ".nhdr"):
        found = _named(path)
    # os.path accepts names that no file can have, as damaged headers hold; Path raises
    return sorted({file for file in found if os.path.isfile(file)} - {path})


def _named(path: Path) -> list[Path]:
    """Files that a header names, whether they exist or not."""
    try:
        header = read_voxel_header(path)
    except OSError:
        return []
    if header.voxels is None:
        return []
    value = header.voxels.decode(errors="replace")
    if not header.in_several_files:
        return [path.parent / value]
    if "%" not in value:  # a list: a line each
        lines = header.listed.decode(errors="replace").splitlines()
        return [path.parent / line.strip() for line in lines]
    pattern = path.parent / value.split()[0]
    form = r"\d+".join(map(re.escape, re.split(r"%0?\d?d", pattern.name)))
    beside = pattern.parent.glob("*") if os.path.isdir(pattern.parent) else ()
    return [file for file in beside if re.fullmatch(form, file.name)]
