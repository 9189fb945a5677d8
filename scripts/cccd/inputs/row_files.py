"""The files of a request as volumes: image, mask and boundary maps."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from cccd.errors import EarlyWarning, InputError, choices, nearest
from cccd.extras import needing
from cccd.file_headers import dicom_modality
from cccd.geometry.arrays import AnyArray
from cccd.inputs.coarser_grid import CoarserGrid, find_coarser_grid
from cccd.inputs.grid import Volume, on_grid
from cccd.inputs.labels import (
    HOW_TO_GIVE_AN_IMAGE,
    choose_labels,
    freesurfer_labels,
    refuse_grey_probabilities,
    refuse_grey_values,
)
from cccd.inputs.readers import read_volume, reader_of, volume_suffix, without_suffix
from cccd.plugins import find, table
from cccd.request import Request

_Read = TypeVar("_Read")
#: Voxels that are compared with whole numbers at once: they stay in the processor's cache.
_PIECE = 2**16
#: Values of a floating-point label map may differ by this from whole numbers.
_LABEL_VALUE = 1e-3
#: Probabilities may lie so far below 0 or above 1, by rounding.
_PROBABILITY = 1e-3
_GIVE_MASKS = "give a label volume, or a folder of masks"


def _is_folder_of_masks(path: Path) -> bool:
    return path.is_dir() and reader_of(path) is None


def _is_dicom(path: Path) -> bool:
    return path.is_file() and not volume_suffix(path.name) and dicom_modality(path) is not None


def read_image(path: Path, source: str, fill_gaps: bool, referenced: str = "") -> Volume:
    """Read grey values.

    Parameters
    ----------
    path : path
        A volume, a DICOM file or a folder of a DICOM series.
    source : str
        The row's source.
    fill_gaps : bool
        Interpolate missing slices of a series, see `read_series`.
    referenced : str
        UID of the series to take where a folder has several.

    Returns
    -------
    Volume
        Finite, float32.

    Raises
    ------
    InputError
        Not readable, or with voxels that are not finite.
    """
    if path.is_dir() or _is_dicom(path):
        with needing(path.name, "dicom"):
            read_series = find(table("READERS")["series"].read)

        # RIDER keeps a patient's CT and PET together
        modality = "CT" if path.is_dir() and source == "rider_lung" else None
        volume = read_series(path, fill_gaps, modality, referenced)
    else:
        volume = read_volume(path)
    bad = volume.data.size - int(np.isfinite(volume.data).sum())
    if bad:
        raise InputError(
            volume.location, f"{bad} of its voxels are not finite", "replace NaN and infinity by numbers"
        )
    return replace(volume, data=np.asarray(volume.data, np.float32))


def read_boundary_maps(path: Path) -> Volume:
    """Read a stack of binary boundary maps.

    Returns
    -------
    Volume
        Boolean, not empty.

    Raises
    ------
    InputError
        Not readable, not binary, or empty.
    """
    volume = read_volume(path)
    if not np.isfinite(volume.data).all():
        raise InputError(
            volume.location, "it contains voxels that are not finite", "give binary boundary maps"
        )
    values = np.unique(volume.data)
    if len(values) > 2:
        raise InputError(
            volume.location, f"its maps have {len(values)} different values", "give binary boundary maps"
        )
    maps = volume.data > 0
    if not maps.any():
        raise InputError(
            volume.location, "its boundary maps are empty", "check that it belongs to this organ"
        )
    return replace(volume, data=maps)


def read_mask(path: Path, request: Request, image: Volume | None, files: Callable[..., Any]) -> Volume:
    """Read an organ's mask.

    Parameters
    ----------
    path : path
        A label map, a binary or a probability map, nnU-Net's probabilities, a DICOM SEG, or a folder of
        one-organ masks.
    request : Request
        Its ``label`` and ``organ`` say which labels are the organ.
    image : Volume, optional
        The image, to which a SEG has to refer.
    files : callable
        How files are read: `read_now`, or `reading_once()`.

    Returns
    -------
    Volume
        Boolean; float32 where the file holds probabilities, which are one half on the organ's border.

    Raises
    ------
    InputError
        Not readable, neither labels nor probabilities, no such label, or empty.
    """
    label, organ = request.label, request.organ
    if _is_folder_of_masks(path):
        return _read_mask_folder(path, label or organ)
    if _is_dicom(path):
        modality = dicom_modality(path)
        if modality != "SEG":
            raise InputError(path.name, f"DICOM {modality or 'object'}, not a mask", "give a SEG or RTSTRUCT")
        mask = files(find(table("READERS")["SEG"].read), path).mask(label, organ, image)
        return _with_coarser_grid(mask)
    if _is_nnunet(path):
        classes = files(find(table("READERS")["nnU-Net"].read), path)
        return _field_or_mask(classes.of_organ(label, organ))
    return files(read_label_map, path).organ(label, organ, request.implied)


def list_labels(path: Path) -> dict[str, str]:
    """List what a mask's file or folder holds: what ``label`` may be, and the name of each where it has one.

    Parameters
    ----------
    path : path
        A label map, a DICOM SEG or RTSTRUCT, or a folder of one-organ masks (empty ones aside).

    Raises
    ------
    InputError
        Not readable, or no mask.
    """
    if _is_folder_of_masks(path):
        return {name: name for name, _ in read_masks(path)}
    if _is_dicom(path):
        kind = "RTSTRUCT" if dicom_modality(path) == "RTSTRUCT" else "SEG"
        names = find(table("READERS")[kind].names)(path)
        return {str(number): name for number, name in sorted(names.items())}
    if _is_nnunet(path):
        return find(table("READERS")["nnU-Net"].read)(path).present()
    return {str(value): name for value, name in read_label_map(path).names.items()}


def label_values(path: Path) -> Volume | None:
    """Read a label map's values, whole numbers, and their names; None where it is no one volume."""
    return None if _is_folder_of_masks(path) or _is_nnunet(path) or _is_dicom(path) else _label_map(path)


def _label_map(path: Path) -> Volume:
    volume = read_volume(path)
    return replace(volume, data=_whole_numbers(volume.data, volume.location)[0])


def read_masks(folder: Path) -> Iterator[tuple[str, Volume]]:
    """Read the masks of a folder one after another: names and boolean volumes, empty masks left out.

    TotalSegmentator writes a mask for every organ that it knows; of those that are not there it is empty.

    Raises
    ------
    InputError
        Not readable, or nothing in any of them.
    """
    found = 0
    for name, file in _named_masks(folder).items():
        labels = _label_map(file)
        mask = replace(labels, data=labels.data > 0)
        if mask.data.any():
            found += 1
            yield name, mask
    if not found:
        raise InputError(folder.name, "every mask in this folder is empty", _GIVE_MASKS)


def check_folder(path: Path, label: str) -> None:
    """Refuse a folder in a mask's place that has no mask of the name; any other path is not looked at."""
    if _is_folder_of_masks(path):
        _named_masks(path, label)


def _named_masks(folder: Path, label: str = "") -> dict[str, Path]:
    """Find the one-organ masks in a folder that a label names, with commas between; without one, all."""
    stems = ((without_suffix(file.name), file) for file in sorted(folder.iterdir()))
    files = {name: file for name, file in stems if name is not None}
    if not files:
        raise InputError(folder.name, "no masks in this folder", _GIVE_MASKS)
    names = [part.strip() for part in label.split(",")] if label else list(files)
    for name in names:
        if name not in files:
            raise InputError(folder.name, f"no mask of {name!r} in this folder", nearest(name, files))
    return {name: files[name] for name in names}


def _read_mask_folder(folder: Path, label: str) -> Volume:
    """Unite one-organ masks of a folder, named as TotalSegmentator names them: ``liver.nii.gz``."""
    files = _named_masks(folder, label)
    volumes = (read_label_map(file).organ("", name) for name, file in files.items())
    united = next(volumes)
    for volume in volumes:
        aligned = on_grid(volume, united.affine, united.shape, fill=False)
        if aligned is None:
            raise InputError(
                volume.location, f"its grid is not that of {united.location}", "give one scan's masks"
            )
        warnings = united.warnings + volume.warnings
        united = replace(aligned, data=np.maximum(united.data, aligned.data), warnings=warnings)
    return united if len(files) == 1 else _with_coarser_grid(united)


@dataclass(frozen=True, eq=False)
class LabelMap:
    """A label map or a mask as its file has it, looked through once for all its labels.

    Attributes
    ----------
    volume : Volume
        As it was read.
    data : (a, b, c) int
        Labels; of probabilities where they are one half and above.
    probable : bool
        Whether the volume holds probabilities.
    names : dict of int to str
        Labels above 0, and their names where something says them.
    """

    volume: Volume
    data: AnyArray
    probable: bool
    names: dict[int, str]

    @classmethod
    def of(cls, volume: Volume) -> LabelMap:
        """Check that a volume holds labels or probabilities, and any at all."""
        data, probable = _whole_numbers(volume.data, volume.location)
        present = [int(value) for value in np.unique(data.ravel(order="K")) if value > 0]
        if not present:
            least = int(data.min())
            below = f" but for negative values (down to {least}), and labels are above 0" if least < 0 else ""
            hint = "check that it belongs to this organ"
            raise InputError(volume.location, f"the mask is empty{below}", hint)
        known = freesurfer_labels(volume.location, present)
        names = {value: volume.names.get(value) or known.get(value, ("",))[0] for value in present}
        return cls(volume, data, probable, names)

    @cached_property
    def coarser(self) -> CoarserGrid | None:
        """The grid that all labels were copied from."""
        return find_coarser_grid(self.data, np.linalg.norm(self.volume.affine[:3, :3], axis=0))

    def organ(self, label: str, organ: str, implied: tuple[int, ...] = ()) -> Volume:
        """Take an organ's boolean mask; probabilities stay what they are."""
        volume, location, present = self.volume, self.volume.location, list(self.names)
        if self.probable:
            if label:
                raise InputError(
                    location, "it contains probabilities of one organ, not labels", "leave the label out"
                )
            return _field_or_mask(replace(volume, data=np.clip(volume.data, 0, 1).astype(np.float32)))
        warnings: list[str] = []
        called = [value for value, name in self.names.items() if name.lower() == organ.lower()]
        if implied:
            chosen = [value for value in present if value in implied]
            if not chosen:
                raise InputError(
                    location, f"it has none of the labels {', '.join(map(str, implied))}", choices(present)
                )
        elif label or len(called) == 1:
            chosen = choose_labels(self.names, label, organ, location, "label")
        else:
            chosen = present
            if len(present) > 1:
                warnings = [EarlyWarning(f"{location}: no label given, so all {_as_one_organ(self.names)}")]
        # one label is found in a fifth of the time of several
        data = self.data == chosen[0] if len(chosen) == 1 else np.isin(self.data, chosen)
        notes = volume.warnings + warnings
        return replace(volume, data=data, names=self.names, coarser=self.coarser, warnings=notes)


def read_label_map(path: Path) -> LabelMap:
    """Read a label map or a mask from a file that is neither DICOM's nor nnU-Net's.

    Raises
    ------
    InputError
        Not readable, neither labels nor probabilities, or empty.
    """
    return LabelMap.of(read_volume(path))


def _is_nnunet(path: Path) -> bool:
    return path.name.lower().endswith(".npz")


def checksum(path: Path) -> str:
    """Compute the SHA-256 of a file, or of the names and checksums of all files in a folder."""
    if path.is_file():
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    inside = (file for file in sorted(path.rglob("*")) if file.is_file())
    lines = [f"{checksum(file)} {file.relative_to(path)}" for file in inside]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def read_now(reader: Callable[..., _Read], *given: object) -> _Read:
    """Return what a reader returns of its arguments."""
    return reader(*given)


def reading_once() -> Callable[..., Any]:
    """Make a `read_now` that keeps what it reads: requests of the same files share it."""
    return cache(read_now)


def _with_coarser_grid(mask: Volume) -> Volume:
    if mask.data.dtype != bool:
        return mask
    spacing = np.linalg.norm(mask.affine[:3, :3], axis=0)
    return replace(mask, coarser=find_coarser_grid(mask.data, spacing))


#: So many labels are named in a message.
_FEW_LABELS = 20


def _as_one_organ(names: Mapping[int, str]) -> str:
    """Name the labels that become one organ, and the two ways on."""
    named = [f"{label} {name}".strip() for label, name in names.items()]
    more = f" ... ({len(named)} in all)" if len(named) > _FEW_LABELS else ""
    return (
        f"{len(named)} labels are taken as one organ: {', '.join(named[:_FEW_LABELS])}{more}; --label NAME "
        "takes one (label in Python and in a sheet), --all-labels makes each (reconstruct_labels, organ *)"
    )


#: What a probability at least loses over the organ's border, from a pixel to the next, where the map is but a
#: cut mask: half of the border's pixels do.
_CUT_STEP = 0.85


def _is_graded(probability: AnyArray) -> bool:
    """Whether probabilities say more of where the border runs than the mask of those above one half."""
    steps: list[AnyArray] = []
    for axis in range(3):
        inside = np.moveaxis(probability, axis, 0) >= 0.5
        across = inside[1:] != inside[:-1]
        steps.append(np.abs(np.diff(np.moveaxis(probability, axis, 0), axis=0))[across])
    found = np.concatenate(steps)
    return bool(len(found)) and float(np.median(found)) < _CUT_STEP


def _field_or_mask(volume: Volume) -> Volume:
    """Leave probabilities as they are where they say more than the mask of those above one half."""
    if _is_graded(volume.data):
        return volume
    note = f"{volume.location}: probabilities as sharp as a mask are used as one (0.5 and above)"
    return replace(volume, data=volume.data >= 0.5, warnings=[*volume.warnings, note])


def _whole_numbers(data: AnyArray, location: str) -> tuple[AnyArray, bool]:
    """Labels as integers, and whether they are probabilities, then cut."""
    if data.dtype == bool:
        refuse_grey_values(data, location)
        return data.astype(np.uint8), False
    if not np.issubdtype(data.dtype, np.floating):
        refuse_grey_values(data, location)
        return data, False
    if not np.isfinite(data).all():
        raise InputError(
            location, "the mask contains voxels that are not finite", "replace NaN and infinity by 0"
        )
    # as it lies in memory, piece by piece: copies of a whole volume take longer than reading it
    pieces = np.array_split(data.ravel(order="K"), 1 + data.size // _PIECE)
    if max(np.abs(piece - np.rint(piece)).max(initial=0) for piece in pieces) <= _LABEL_VALUE:
        whole = np.rint(data, out=np.empty_like(data, np.int32), casting="unsafe")
        refuse_grey_values(whole, location)
        return whole, False
    if data.min() < -_PROBABILITY or data.max() > 1 + _PROBABILITY:
        raise InputError(
            location,
            f"its values, {data.min():.4g} to {data.max():.4g}, are neither labels nor probabilities",
            f"give a label map, or probabilities from 0 to 1; of a grey image: {HOW_TO_GIVE_AN_IMAGE}",
        )
    refuse_grey_probabilities(data, location)
    return (data >= 0.5).astype(np.int32), True
