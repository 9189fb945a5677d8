"""The structures of a run: rows of the cohort sheet, their files, and the ways that lead to contours."""

from __future__ import annotations

import contextlib
import functools
import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol

from cccd.errors import InputError, nearest
from cccd.file_headers import dicom_modality, object_in, voxel_files
from cccd.request import Request, completed
from cccd_workflow.cohort import brings_maps, read_cohort
from cccd_workflow.remote import RemoteFile, is_remote, read_address

#: The kinds of input that a row may name, and the functions that lead to the contours of each.
Kind = Literal["boundary maps", "drawn contours", "mask"]
ContourWay = Literal["order_contours", "take_contours", "trace_contours"]
_WAYS: dict[Kind, ContourWay] = {
    "boundary maps": "order_contours",
    "drawn contours": "take_contours",
    "mask": "trace_contours",
}

#: Where the labels that maps hold are remembered, from the folder of the run.
_LABELS = Path(".snakemake") / "labels"


class OfCase(Protocol):
    """Wildcards of a file of a whole case."""

    @property
    def case(self) -> str:
        """The sheet's column ``case``."""
        ...


class OfStructure(OfCase, Protocol):
    """Wildcards of a structure's file."""

    @property
    def organ(self) -> str:
        """The sheet's column ``organ``."""
        ...


class StructureName(NamedTuple):
    """The two columns of the sheet that name a structure."""

    case: str
    organ: str


def near(path: str | Path) -> str:
    """Name a path relative to here when it is below, so that a moved project reruns nothing."""
    path = Path(path).resolve()
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)


def holds_contours(path: Path) -> bool:
    """Whether what the sheet names as a mask is drawn contours: an RTSTRUCT, or a folder with one.

    Of a path that cannot be read the answer is no; the job that imports it says what is wrong.
    """
    try:
        found = object_in(path)
        return found.is_file() and dicom_modality(found) == "RTSTRUCT"
    except (InputError, OSError):
        return False


_is_drawn = functools.cache(holds_contours)  # a file's first bytes are read once per plan


@dataclass(frozen=True)
class PlannedCohort:
    """The rows of a cohort sheet, ready to plan with.

    Attributes
    ----------
    sheet : path
        The cohort sheet.
    rows : dict
        By name, as `cccd_workflow.cohort.read_cohort` returns them, with a row for each label in the place of
        organ ``*`` and local paths in the place of addresses.
    masks_are_ordered : bool
        Whether the junction network traces masks too (``curves: ordering: gnn``).
    remote : dict
        What the sheet names by an address, by where it goes.
    labels : dict
        Names, colours and codes of the labels of whole maps, by case and organ.
    shared : dict
        Organs that share their walls, by case.
    notes : tuple of str
        What is worth a line about labels that are left out or renamed.
    missing : dict
        Why rows are left out whose files are not there, by name.
    """

    sheet: Path
    rows: dict[StructureName, dict[str, str]]
    masks_are_ordered: bool
    remote: dict[str, RemoteFile]
    labels: dict[str, dict[str, dict[str, str]]]
    shared: dict[str, list[str]]
    notes: tuple[str, ...]
    missing: dict[StructureName, InputError]

    @classmethod
    def read(
        cls,
        sheet: Path,
        shared_walls: bool | Literal["auto"],
        masks_are_ordered: bool,
        omit_missing: bool = False,
    ) -> PlannedCohort:
        """Read a sheet; scans are opened only to list the labels of whole maps.

        Parameters
        ----------
        sheet : path
            The cohort sheet.
        shared_walls : bool or "auto"
            Whether organs of a case share their walls.
        masks_are_ordered : bool
            Whether the junction network traces masks too.
        omit_missing : bool
            Leave rows out whose files are not there, unless they were imported before.

        Raises
        ------
        InputError
            Names the row, what is wrong with it, and a hint.
        """
        remote: dict[str, RemoteFile] = {}
        rows = [_with_local_paths(row, sheet.parent, remote) for row in read_cohort(sheet)]
        missing: dict[StructureName, InputError] = {}
        if omit_missing:
            missing = _missing(rows, sheet.parent, remote)
            if len(missing) == len(rows):
                raise next(iter(missing.values()))
            rows = [row for row in rows if StructureName(row["case"], row["organ"]) not in missing]
        labels: dict[str, dict[str, dict[str, str]]] = {}
        shared: dict[str, list[str]] = {}
        notes: list[str] = []
        if shared_walls is True or any(row["organ"] == "*" for row in rows):
            from cccd_labels.label_maps import expand_rows, shared_groups  # reads scans: slow to import

            rows, labels, notes = expand_rows(rows, sheet.parent, _LABELS)
            shared = shared_groups(rows, labels, shared_walls)
        named = {StructureName(row["case"], row["organ"]): row for row in rows}
        return cls(sheet, named, masks_are_ordered, remote, labels, shared, tuple(notes), missing)

    @property
    def reconstructed(self) -> list[StructureName]:
        """The structures that are reconstructed, measured and reported on: all but those of role train."""
        return [name for name, row in self.rows.items() if row["role"] != "train"]

    @property
    def training(self) -> list[StructureName]:
        """The structures that train segmentation networks."""
        return [name for name, row in self.rows.items() if row["role"] == "train"]

    @property
    def needs_network(self) -> bool:
        """Whether contours of any structure that is reconstructed are ordered by the junction network."""
        return any(self.contour_way(name) == "order_contours" for name in self.reconstructed)

    def is_asked(self, answer: bool | Literal["auto"], root: Path) -> bool:
        """Whether a setting asks for something; ``auto`` does for the default cohort of a project."""
        if answer != "auto":
            return answer
        return self.sheet.resolve() == (root / "config" / "cohort.tsv").resolve()

    def row(self, wildcards: OfStructure) -> dict[str, str]:
        """Return the row of a structure.

        Raises
        ------
        InputError
            ``results/CASE/ORGAN/...`` was asked for, and the sheet has no such structure.
        """
        name = StructureName(wildcards.case, wildcards.organ)
        if name in self.missing:
            raise self.missing[name]
        if name not in self.rows:
            known = nearest("/".join(name), ["/".join(one) for one in self.rows])
            raise InputError(self.sheet.name, f"no structure {'/'.join(name)}", known)
        return self.rows[name]

    def of_case(self, case: str) -> list[StructureName]:
        """Return every structure of a case that is reconstructed.

        Raises
        ------
        InputError
            There is none.
        """
        names = [name for name in self.reconstructed if name.case == case]
        if not names:
            known = nearest(case, list(dict.fromkeys(name.case for name in self.reconstructed)))
            raise InputError(self.sheet.name, f"no case {case}", known)
        return names

    def kind(self, wildcards: OfStructure) -> Kind:
        """Return what a structure is reconstructed from; a mask may be one that a threshold finds."""
        row = self.row(wildcards)
        if brings_maps(row):
            return "boundary maps"
        drawn = bool(row["mask"]) and _is_drawn(self.sheet.parent / row["mask"])
        return "drawn contours" if drawn else "mask"

    def contour_way(self, wildcards: OfStructure) -> ContourWay:
        """Choose the way to a structure's contours, before any job, by what the data are."""
        kind = self.kind(wildcards)
        return "order_contours" if kind == "mask" and self.masks_are_ordered else _WAYS[kind]

    def source_files(self, wildcards: OfStructure) -> list[str]:
        """Return a row's own files, the voxels beside their headers, and what its cohort's layout implies.

        They are inputs, so that a changed scan is imported again. Left out is what the job itself reports, a
        missing file or a name against the layout, and what is dated in the future (a clock ran ahead
        somewhere), than which every output would be older, an error to Snakemake.
        """
        request = Request.of_row(self.row(wildcards), self.sheet.parent)
        with contextlib.suppress(InputError):
            request = completed(request)
        named = list(request.files.values())
        paths = named + [voxels for path in named for voxels in voxel_files(path)]
        there = {near(path) for path in paths if path.exists() and path.stat().st_mtime <= time.time()}
        return sorted(there | ({near(path) for path in named} & self.remote.keys()))

    def remote_file(self, wildcards: Any) -> RemoteFile:
        """Return what a download's path is fetched from.

        Raises
        ------
        InputError
            The sheet does not name it any more.
        """
        path = f"downloads/{wildcards.key}/{wildcards.file}"
        if path not in self.remote:
            raise InputError(self.sheet.name, f"no address of {path}", "ask for a structure's files instead")
        return self.remote[path]

    def training_files(self, wildcards: object = None) -> list[str]:
        """Return scans and masks of the rows that train.

        Raises
        ------
        InputError
            The sheet has no such rows.
        """
        if not self.training:
            problem = "no row of role train to train a segmenter on"
            raise InputError(self.sheet.name, problem, "add rows with an image, a mask and role train")
        return sorted({file for name in self.training for file in self.source_files(name)})


def _missing(
    rows: list[dict[str, str]], folder: Path, remote: dict[str, RemoteFile]
) -> dict[StructureName, InputError]:
    """Name the rows whose files are not what they should be, and which were not imported before."""
    found: dict[StructureName, InputError] = {}
    for row in rows:
        if row["role"] == "train" or any(Path("results", row["case"]).glob(f"{row['organ']}/structure.h5")):
            continue
        try:
            for column in ("image", "mask", "boundary"):
                if row[column] and near(folder / row[column]) not in remote:
                    _check_file(folder / row[column], column, row)
        except InputError as error:
            found[StructureName(row["case"], row["organ"])] = error.at(row["location"])
    return found


def _check_file(path: Path, column: str, row: dict[str, str]) -> None:
    """Refuse what is not there or must not be read, and a folder in a mask's place that has no such mask."""
    if not os.access(path, os.R_OK):
        from cccd.inputs.load import existing  # slow to import, and most sheets miss nothing

        existing(path, column)
    if column == "mask" and path.is_dir():
        from cccd.inputs.row_files import check_folder

        check_folder(object_in(path), "" if row["organ"] == "*" else row["label"] or row["organ"])


def _with_local_paths(row: dict[str, str], folder: Path, remote: dict[str, RemoteFile]) -> dict[str, str]:
    """Put local paths in the place of a row's addresses, and add these to ``remote``."""
    row = dict(row)
    for column in ("image", "mask", "boundary"):
        if not is_remote(row[column]):
            continue
        if row["source"] != "files" or row["organ"] == "*":
            what = "organ *" if row["organ"] == "*" else f"source {row['source']}"
            problem = f"{what} cannot be combined with an address"
            raise InputError(row["location"], problem, "download the files and name their folder")
        file = read_address(row[column], row["location"])
        remote[str(file.local)] = file
        row[column] = os.path.relpath(file.local, folder)
    return row
