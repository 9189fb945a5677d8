"""Which DICOM object a file holds: drawn contours (RTSTRUCT) or a mask (SEG and volumes).

Imported at every parse of the workflow, so pydicom is imported for DICOM files only, and of those the header
alone is read.
"""

from __future__ import annotations

from pathlib import Path

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
