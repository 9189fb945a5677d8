"""What a row of the cohort sheet, a command or a function asks for, and what a named cohort implies of it.

Imported at every parse of the workflow, so it imports nothing heavy.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from cccd.plugins import find, table

#: The source of a row that names its files, as no cohort's layout and nothing made.
FILES = "files"


@dataclass(frozen=True)
class Request:
    """One organ that is asked for.

    Attributes
    ----------
    case, organ : str
        An empty organ gets the name of its label in the file.
    location : str
        What messages name: a row of the sheet, or a file.
    source : str
        ``files``, or a scan that is made or brought (a row of the table ``SOURCES``).
    folder : Path
        Paths are relative to it.
    image, mask, boundary : Path or None
        Files or folders, as they were named.
    label : str
        Value(s) of a label map, or the name of an organ, segment or ROI.
    implied : tuple of int
        Labels that a named cohort's layout implies, of which some may be missing.
    annotated : str
        Which slices are annotated, see `cccd.inputs.annotation.RULES`.
    seeds : tuple of str
        Voxels or boxes within the organ, of an image without a mask (`cccd_segmentation.seeds`).
    window : (float or None, float or None) or None
        Grey values of the organ, of an image without a mask; None for the settings' own.
    """

    case: str
    organ: str
    location: str
    source: str = FILES
    folder: Path = Path()
    image: Path | None = None
    mask: Path | None = None
    boundary: Path | None = None
    label: str = ""
    implied: tuple[int, ...] = ()
    annotated: str = "auto"
    seeds: tuple[str, ...] = ()
    window: tuple[float | None, float | None] | None = None

    @classmethod
    def of_row(cls, row: Mapping[str, str], folder: Path) -> Request:
        """Take a row of the cohort sheet in ``folder``; columns that are left out are empty.

        Examples
        --------
        >>> row = {"case": "a", "organ": "liver", "location": "sheet.tsv row 2", "mask": "a.nii", "image": ""}
        >>> Request.of_row(row, Path("/data")).files
        {'mask': PosixPath('/data/a.nii')}
        """

        def path(column: str) -> Path | None:
            return Path(row[column]) if row.get(column) else None

        return cls(
            row["case"],
            row["organ"],
            row["location"],
            row.get("source") or FILES,
            folder,
            path("image"),
            path("mask"),
            path("boundary"),
            label=row.get("label", ""),
            annotated=row.get("annotated") or "auto",
            seeds=(row["seed"],) if row.get("seed") else (),
        )

    @property
    def files(self) -> dict[str, Path]:
        """Where the files that are named lie, by what they are."""
        named = {"image": self.image, "mask": self.mask, "boundary": self.boundary}
        return {name: self.folder / path for name, path in named.items() if path is not None}


def completed(request: Request) -> Request:
    """Fill in what the layout of a named cohort's download implies: mask and label. The sheet goes first.

    Raises
    ------
    InputError
        A name that does not follow the layout, or an organ that the cohort does not have.
    """
    if request.source == FILES or request.image is None:
        return request
    layout = table("LAYOUTS").get(request.source)
    return request if layout is None else find(layout)(request, request.image)
