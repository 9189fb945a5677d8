"""What the headers of files say: which DICOM object it is, and where a MetaImage's or a NRRD's voxels are.

Imported at every parse of the workflow, so it imports nothing heavy (pydicom for DICOM files only), and reads
no more than headers.
"""

from __future__ import annotations

import contextlib
import glob
import re
from pathlib import Path
from typing import Any, cast

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

        header = cast(Any, pydicom).dcmread(path, stop_before_pixels=True, specific_tags=list(keywords))
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


# Headers are no longer.
_HEADER_BYTES = 1 << 20

_PAIRS = {".hdr": (".img", ".img.gz"), ".img": (".hdr",), ".npz": (".pkl",)}

# A number in the names of files that a header counts: any digits.
_NUMBER = re.compile(r"%0?\d?d")


def read_header(path: Path) -> bytes:
    """Read the header of a MetaImage or NRRD, and what follows it."""
    with path.open("rb") as file:
        return file.read(_HEADER_BYTES)


def voxel_files(path: Path) -> list[Path]:
    """List the further files that a volume consists of, those that exist.

    Parameters
    ----------
    path : Path
        A file that the sheet names; one that cannot be read has none, its reader says why.
    """
    suffix = path.suffix.lower()
    if suffix in (".mhd", ".nhdr"):
        with contextlib.suppress(OSError):
            return named_files(path)
    return sorted(file for other in _PAIRS.get(suffix, ()) if (file := path.with_suffix(other)).is_file())


def named_files(path: Path) -> list[Path]:
    """List the files that the header of a MetaImage or NRRD names: one, a list, or numbered ones."""
    lines = read_header(path).decode(errors="replace").splitlines()
    values = [re.split("[:=]", line, maxsplit=1)[-1].strip() for line in lines]
    names = [value.split()[0] if _NUMBER.search(value) else value for value in values if value]
    forms = [_NUMBER.sub("[0-9]*", glob.escape(name)) for name in names]
    # glob accepts names that no file can have, as damaged headers hold; Path raises
    found = {path.parent / file for form in forms for file in glob.glob(form, root_dir=path.parent)}
    return sorted(file for file in found - {path} if file.is_file())
