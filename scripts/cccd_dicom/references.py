"""Which series a SEG or an RTSTRUCT was made on."""

from __future__ import annotations

from pathlib import Path

from cccd.file_headers import header_of

#: Sequences, each in the one before where there is one, that lead to the series of a SEG or an RTSTRUCT.
_REFERENCES = (
    "ReferencedSeriesSequence",
    "ReferencedFrameOfReferenceSequence",
    "RTReferencedStudySequence",
    "RTReferencedSeriesSequence",
)


def referenced_series(path: Path) -> str:
    """Read the UID of the series that a SEG or RTSTRUCT was made on; empty where there is none."""
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
    header = header_of(path, "Modality", "FrameOfReferenceUID")
    if header is None or header["Modality"] not in ("SEG", "RTSTRUCT"):
        return False
    own = {referenced_series(path), header["FrameOfReferenceUID"]} - {""}
    return bool(own) and any(_series_of(file) in own for file in path.parent.iterdir() if file != path)


def _series_of(path: Path) -> str:
    """UID of an image's series, or of its frame of reference where anonymising has taken that."""
    uids = "SeriesInstanceUID", "FrameOfReferenceUID"
    header = header_of(path, "Modality", *uids) if path.is_file() else None
    if header is None or header["Modality"] in ("", "SEG", "RTSTRUCT"):
        return ""
    return header[uids[0]] or header[uids[1]]
