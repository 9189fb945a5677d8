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

#: Sequences, each in the one before where there is one, that lead to the series of a SEG or an RTSTRUCT.
_REFERENCES = (
    "ReferencedSeriesSequence",
    "ReferencedFrameOfReferenceSequence",
    "RTReferencedStudySequence",
    "RTReferencedSeriesSequence",
)


def dicom_modality(path: Path) -> str | None:
    """Read the modality of a DICOM file (``CT``, ``SEG``, ``RTSTRUCT``, ...), None for any other file.

    A damaged header has the modality ``""``, as has a file that cannot be opened: its reader will say what is
    wrong with it.

    Raises
    ------
    InputError
        It is DICOM, and pydicom is not installed.
    """
    return (_header(path, "Modality") or {}).get("Modality")


def _header(path: Path, *keywords: str) -> dict[str, str] | None:
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


def object_in(path: Path) -> Path:
    """Find the one SEG or RTSTRUCT in a folder; any other path stays as it is.

    Raises
    ------
    InputError
        The folder holds several.
    """
    if not path.is_dir():
        return path
    files = sorted(file for file in path.iterdir() if file.is_file())
    objects = [file for file in files if dicom_modality(file) in ("SEG", "RTSTRUCT")]
    if len(objects) > 1:
        raise InputError(
            path.name, f"it contains {len(objects)} SEG or RTSTRUCT objects", choices(f.name for f in objects)
        )
    return objects[0] if objects else path


def referenced_series(path: Path) -> str:
    """Read the UID of the series that a SEG or RTSTRUCT was made on; empty where there is none."""
    if dicom_modality(path) not in ("SEG", "RTSTRUCT"):
        return ""
    import pydicom

    try:
        header = pydicom.dcmread(path, stop_before_pixels=True, specific_tags=list(_REFERENCES))
        found = [header]
        for keyword in _REFERENCES:
            found = [inner for item in found for inner in item.get(keyword, [])] or found
        return str(found[0].get("SeriesInstanceUID", "")) if found[0] is not header else ""
    except Exception:  # pydicom raises whatever its parser meets
        return ""


def lies_in_its_series(path: Path) -> bool:
    """Whether a file is a SEG or RTSTRUCT that lies in one folder with the series that it was made on."""
    header = _header(path, "Modality", "FrameOfReferenceUID")
    if header is None or header["Modality"] not in ("SEG", "RTSTRUCT"):
        return False
    own = {referenced_series(path), header["FrameOfReferenceUID"]} - {""}
    return bool(own) and any(_series_of(file) in own for file in path.parent.iterdir() if file != path)


def _series_of(path: Path) -> str:
    """UID of an image's series, or of its frame of reference where anonymising has taken that."""
    uids = "SeriesInstanceUID", "FrameOfReferenceUID"
    header = _header(path, "Modality", *uids) if path.is_file() else None
    if header is None or header["Modality"] in ("", "SEG", "RTSTRUCT"):
        return ""
    return header[uids[0]] or header[uids[1]]


def holds_contours(path: Path) -> bool:
    """Whether what the sheet names as a mask is drawn contours: an RTSTRUCT, or a folder with one.

    Of a path that cannot be read the answer is no; the job that imports it says what is wrong.
    """
    try:
        found = object_in(path)
        return found.is_file() and dicom_modality(found) == "RTSTRUCT"
    except (InputError, OSError):
        return False
