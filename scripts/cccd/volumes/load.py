"""From a row of the cohort sheet to a `Structure`."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path

import numpy as np

from cccd.cohort import complete_row
from cccd.containers import Curves, Frame, Structure
from cccd.dicom_objects import dicom_modality, object_in
from cccd.errors import InputError
from cccd.settings import ImportSettings, choices, nearest
from cccd.sidecar_files import voxel_files
from cccd.tolerances import LABEL_VALUE
from cccd.volumes.contours import assemble_contours, contour_frame
from cccd.volumes.dicom import choose_labels, read_rtstruct, read_seg, read_series
from cccd.volumes.grid import Volume, bounding_box, crop, find_slice_axis, interpolate_on_grid, on_grid
from cccd.volumes.phantoms import make_phantom
from cccd.volumes.readers import SUFFIXES, read_volume
from cccd.volumes.regions import find_region
from cccd.volumes.sources import brain_of_stripped, read_mni152, read_whole_body_ct

__all__ = ["MIN_SLICES", "load_structure"]

#: A surface needs this many slices with organ.
MIN_SLICES = 3

_READERS = ("h5py", "highdicom", "nibabel", "numpy", "pydicom", "simpleitk")


@dataclass
class _Scan:
    """What a row's source gave, on one grid, before it is cropped."""

    frame: Frame
    image: np.ndarray | None = None
    mask: np.ndarray | None = None
    boundary: np.ndarray | None = None
    contours: Curves | None = None
    provenance: dict = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)


def load_structure(
    row: Mapping[str, str], sheet_dir: str | Path, settings: ImportSettings, seed: int = 0
) -> Structure:
    """Read one structure, cropped to its organ with a margin.

    Parameters
    ----------
    row : mapping
        One row of `cccd.cohort.read_cohort`.
    sheet_dir : path
        Folder of the cohort sheet, from which the row's paths are relative.
    settings : ImportSettings
    seed : int
        Decides everything random in a phantom.

    Returns
    -------
    Structure
        With a margin of background on every side: where the organ touches the scan's face, the mask goes
        on as background, the grey values as they are on the face, and ``origin`` may be negative.

    Raises
    ------
    InputError
        Names the row, what is wrong, and the hint.
    """
    location = row["location"]
    try:
        if row["source"] == "phantom":
            return make_phantom(
                row["case"],
                row["organ"],
                settings.phantom,
                seed=seed,
                margin_voxels=settings.margin_voxels,
                location=location,
            )
        scan = _read_source(row, Path(sheet_dir), settings)
        return _crop(scan, row, settings.margin_voxels)
    except InputError as error:
        if error.location == location:
            raise
        raise InputError(location, f"{error.location}: {error.problem}", error.hint) from None
    except MemoryError:
        raise InputError(location, "the scan does not fit into memory", "give the job more memory") from None


# one grid -------------------------------------------------------------------------------------------


def _read_source(row: Mapping[str, str], folder: Path, settings: ImportSettings) -> _Scan:
    packaged = {"mni152": read_mni152, "whole_body_ct": read_whole_body_ct}
    if row["source"] in packaged:
        image, mask, facts = packaged[row["source"]](row["organ"], row["location"])
        return _Scan(
            _frame(mask, settings),
            np.asarray(image.data, np.float32),
            mask.data,
            provenance={"source": row["source"], **facts},
        )
    row, implied = complete_row(row, folder)
    paths = {name: _existing(folder / row[name], name) for name in ("image", "mask", "boundary") if row[name]}
    image = _read_image(paths["image"], row["source"], settings) if "image" in paths else None
    if "mask" in paths:
        paths["mask"] = object_in(paths["mask"])
    if "mask" in paths and paths["mask"].is_file() and dicom_modality(paths["mask"]) == "RTSTRUCT":
        if "boundary" in paths:
            raise InputError(
                row["location"], "an RTSTRUCT cannot stand beside boundary maps", "empty one of them"
            )
        scan = _scan_of_contours(paths["mask"], row, image, settings)
    else:
        scan = _scan_of_voxels(paths, row, implied, image, settings)
    if image is not None:
        scan.warnings = image.warnings + scan.warnings
    scan.provenance = {
        "source": row["source"],
        "label": row["label"],
        "files": _checksums(row, folder),
        "versions": {name: version(name) for name in _READERS},
        **scan.provenance,
    }
    return scan


def _frame(volume: Volume, settings: ImportSettings) -> Frame:
    shape = tuple(int(n) for n in volume.data.shape)
    return Frame(volume.affine, find_slice_axis(volume.affine, settings.slice_axis), shape)


def _scan_of_contours(
    path: Path, row: Mapping[str, str], image: Volume | None, settings: ImportSettings
) -> _Scan:
    rois, reference = read_rtstruct(path, row["label"], row["organ"])
    drawn = [contour for roi in rois for contour in roi]
    if not drawn:
        raise InputError(path.name, "its ROI holds points only", "choose another ROI")
    frame, keep, warnings = contour_frame(drawn, image, path.name, settings.contour_pixel_mm)
    if settings.slice_axis not in ("auto", frame.slice_axis):
        raise InputError(
            path.name,
            f"its contours lie across axis {frame.slice_axis}, not {settings.slice_axis}",
            "set import: slice_axis: auto",
        )
    if image is not None and image.frame_of_reference not in ("", reference):
        warnings.append(f"{path.name}: its frame of reference is not that of {image.location}")
    contours, notes = assemble_contours(rois, frame, path.name)
    grey = None
    if image is not None and keep is not None:
        grey = image.data[tuple(keep if axis == frame.slice_axis else slice(None) for axis in range(3))]
    return _Scan(frame, grey, contours=contours, warnings=warnings + notes)


def _scan_of_voxels(
    paths: Mapping[str, Path],
    row: Mapping[str, str],
    implied: tuple[int, ...],
    image: Volume | None,
    settings: ImportSettings,
) -> _Scan:
    mask = boundary = None
    provenance: dict = {}
    if "mask" in paths:
        mask = _read_mask(paths["mask"], row, implied, image)
    if "boundary" in paths:
        boundary = _read_boundary(paths["boundary"])
    if mask is None and boundary is None:
        assert image is not None  # the sheet's check
        if row["source"] == "upenn_gbm":
            mask = brain_of_stripped(image)
        else:
            region = settings.region
            axis = find_slice_axis(image.affine, settings.slice_axis)
            found, bounds = find_region(image.data, image.location, region, slice_axis=axis)
            mask = Volume(found, image.affine, image.location)
            window = [None if np.isinf(bound) else bound for bound in bounds]
            provenance["region"] = region.as_config() | {"window": window}
    notes = [note for volume in (mask, boundary) if volume is not None for note in volume.warnings]
    drawn = boundary if boundary is not None else mask
    if image is not None and on_grid(drawn, image.affine, image.data.shape, fill=False) is not None:
        grid = image
    else:
        grid = drawn
    mask, boundary, grey = (
        None if volume is None else _bring(volume, grid, settings.resample, notes)
        for volume in (mask, boundary, image)
    )
    return _Scan(_frame(grid, settings), grey, mask, boundary, provenance=provenance, warnings=notes)


def _bring(volume: Volume, grid: Volume, allowed: bool, notes: list[str]) -> np.ndarray:
    """Voxels of ``volume`` on the grid of another; by interpolation only if that is allowed."""
    binary = volume.data.dtype == bool
    moved = on_grid(volume, grid.affine, grid.data.shape, fill=False if binary else None)
    if moved is not None:
        return moved.data
    if not allowed:
        raise InputError(
            volume.location,
            f"its grid ({_describe(volume)}) is not that of {grid.location} ({_describe(grid)})",
            "give matching files, or set import: resample: true to interpolate",
        )
    notes.append(f"{volume.location}: interpolated on the grid of {grid.location}")
    return interpolate_on_grid(volume, grid.affine, grid.data.shape, order=0 if binary else 1).data


def _describe(volume: Volume) -> str:
    shape = " x ".join(str(n) for n in volume.data.shape)
    spacing = " x ".join(f"{size:.4g}" for size in np.linalg.norm(volume.affine[:3, :3], axis=0))
    corner = ", ".join(f"{x:.4g}" for x in volume.affine[:3, 3])
    return f"{shape} voxels of {spacing} mm from {corner}"


# reading --------------------------------------------------------------------------------------------


def _existing(path: Path, column: str) -> Path:
    if path.exists():
        return path
    folder = path.parent
    if not folder.is_dir():
        raise InputError(
            column, f"{path.name} is not there, nor its folder {folder}", "correct the path in the sheet"
        )
    names = sorted(entry.name for entry in folder.iterdir() if not entry.name.startswith("."))
    raise InputError(column, f"there is no {path.name} in {folder}", nearest(path.name, names))


def _is_dicom(path: Path) -> bool:
    return not path.name.lower().endswith(SUFFIXES) and dicom_modality(path) is not None


def _read_image(path: Path, source: str, settings: ImportSettings) -> Volume:
    if path.is_dir():
        # RIDER keeps a patient's CT and PET together
        modality = "CT" if source == "rider_lung" else None
        volume = read_series(path, settings.fill_gaps, modality)
    elif _is_dicom(path):
        volume = read_series(path, settings.fill_gaps)
    else:
        volume = read_volume(path)
    bad = volume.data.size - int(np.isfinite(volume.data).sum())
    if bad:
        raise InputError(
            volume.location, f"{bad} of its voxels are not finite", "replace NaN and infinity by numbers"
        )
    volume.data = np.asarray(volume.data, np.float32)
    return volume


def _read_mask(path: Path, row: Mapping[str, str], implied: tuple[int, ...], image: Volume | None) -> Volume:
    label, organ = row["label"], row["organ"]
    if path.is_dir():
        return _read_mask_folder(path, label or organ)
    if _is_dicom(path):
        modality = dicom_modality(path)
        if modality != "SEG":
            raise InputError(path.name, f"DICOM {modality or 'object'}, not a mask", "give a SEG or RTSTRUCT")
        return read_seg(path, label, organ, image)
    return _choose_labels(read_volume(path), label, organ, implied)


def _read_mask_folder(folder: Path, label: str) -> Volume:
    """Unite single-organ masks of a folder, named as TotalSegmentator names them: ``liver.nii.gz``."""
    files: dict[str, Path] = {}
    for file in sorted(folder.iterdir()):
        suffix = next((suffix for suffix in SUFFIXES if file.name.lower().endswith(suffix)), None)
        if suffix:
            files[file.name[: -len(suffix)]] = file
    if not files:
        raise InputError(folder.name, "no masks in this folder", "give a label volume, or a folder of masks")
    united: Volume | None = None
    for name in (part.strip() for part in label.split(",")):
        if name not in files:
            raise InputError(folder.name, f"no mask of {name!r} in this folder", nearest(name, files))
        volume = _choose_labels(read_volume(files[name]), "", name)
        if united is not None:
            aligned = on_grid(volume, united.affine, united.data.shape, fill=False)
            if aligned is None:
                raise InputError(
                    volume.location, f"its grid is not that of {united.location}", "give one scan's masks"
                )
            volume.data = united.data | aligned.data
        united = volume
    assert united is not None
    return united


def _choose_labels(volume: Volume, label: str, organ: str, implied: tuple[int, ...] = ()) -> Volume:
    """Make a label map, a binary mask or a probability map boolean; of ``implied`` labels some may lack."""
    data, location = volume.data, volume.location
    if data.dtype == bool:
        data = data.astype(np.uint8)
    if np.issubdtype(data.dtype, np.floating):
        if not np.isfinite(data).all():
            raise InputError(
                location, "the mask holds voxels that are not finite", "replace NaN and infinity by 0"
            )
        whole = np.rint(data)
        if np.abs(data - whole).max(initial=0) > LABEL_VALUE:
            if data.min() < 0 or data.max() > 1 or label:
                raise InputError(
                    location, "its values are neither labels nor probabilities", "give a label map"
                )
            volume.warnings.append(f"{location}: probabilities, cut at 0.5")
            whole = data >= 0.5
        data = whole.astype(np.int32)
    present = [int(value) for value in np.unique(data) if value > 0]
    if not present:
        raise InputError(location, "the mask is empty", "check that it belongs to this organ")
    names = {value: volume.names.get(value, "") for value in present}
    called = [value for value, name in names.items() if name.lower() == organ.lower()]
    if implied:
        chosen = [value for value in present if value in implied]
        if not chosen:
            raise InputError(
                location, f"it has none of the labels {', '.join(map(str, implied))}", choices(present)
            )
    elif label or len(called) == 1:
        chosen = choose_labels(names, label, organ, location, "label")
    else:
        chosen = present
        if len(present) > 1:
            volume.warnings.append(f"{location}: no label given, all of {', '.join(map(str, present))} taken")
    volume.data = np.isin(data, chosen)
    return volume


def _read_boundary(path: Path) -> Volume:
    volume = read_volume(path)
    if not np.isfinite(volume.data).all():
        raise InputError(volume.location, "it holds voxels that are not finite", "give binary boundary maps")
    values = np.unique(volume.data)
    if len(values) > 2:
        raise InputError(
            volume.location, f"its maps have {len(values)} different values", "give binary boundary maps"
        )
    volume.data = volume.data > 0
    if not volume.data.any():
        raise InputError(
            volume.location, "its boundary maps are empty", "check that it belongs to this organ"
        )
    return volume


# cropping -------------------------------------------------------------------------------------------


def _extent(scan: _Scan) -> tuple[np.ndarray, np.ndarray, int]:
    """First and last index (3,) of the organ in the frame, and the number of its slices."""
    axis = scan.frame.slice_axis
    if scan.contours is not None:
        curves = scan.contours
        first, last = np.zeros(3, int), np.zeros(3, int)
        plane = list(scan.frame.in_plane_axes)
        first[plane] = np.floor(curves.points.min(axis=0)).astype(int)
        last[plane] = np.ceil(curves.points.max(axis=0)).astype(int)
        first[axis], last[axis] = curves.slice.min(), curves.slice.max()
        return first, last, len(np.unique(curves.slice))
    drawn = scan.mask if scan.boundary is None else scan.boundary
    first, last = bounding_box(drawn)
    slices = int(drawn.any(axis=tuple({0, 1, 2} - {axis})).sum())
    if scan.boundary is not None and scan.mask is not None and scan.mask.any():
        low, high = bounding_box(scan.mask)
        first, last = np.minimum(first, low), np.maximum(last, high)
    return first, last, slices


def _crop(scan: _Scan, row: Mapping[str, str], margin: int) -> Structure:
    frame = scan.frame
    first, last, slices = _extent(scan)
    if slices < MIN_SLICES:
        raise InputError(
            row["location"],
            f"{row['organ']} lies in {slices} slice{'s'[: slices > 1]} along axis {frame.slice_axis}",
            f"give an organ of {MIN_SLICES} slices or more, or set import: slice_axis",
        )
    warnings = list(scan.warnings)
    if scan.contours is None:
        warnings += _cut_notes(frame, first, last)
    first, last = first - margin, last + margin
    image, mask, boundary = (
        None if array is None else crop(array, first, last)
        for array in (scan.image, scan.mask, scan.boundary)
    )
    return Structure(
        case=row["case"],
        organ=row["organ"],
        frame=frame,
        origin=first.astype(np.int64),
        image=None if image is None else np.ascontiguousarray(image, np.float32),
        mask=mask,
        boundary=boundary,
        contours=scan.contours,
        provenance=scan.provenance,
        warnings=warnings,
    )


def _cut_notes(frame: Frame, first: np.ndarray, last: np.ndarray) -> list[str]:
    """Say at which faces of the scan the organ may be cut."""
    low, high = first <= 0, last >= np.array(frame.shape) - 1
    ends = [name for name, cut in zip(("first", "last"), (low, high), strict=True) if cut[frame.slice_axis]]
    sides = (low | high)[list(frame.in_plane_axes)].any()
    places = [f"the scan's {name} slice" for name in ends] + ["the sides of its slices"] * bool(sides)
    return [f"the organ touches {' and '.join(places)}: it may be cut there"] if places else []


def _checksums(row: Mapping, folder: Path) -> dict[str, str]:
    """Checksums of what a row names, and of the voxels that stand beside headers, by their names."""
    found = {}
    for name in filter(None, (row[column] for column in ("image", "mask", "boundary"))):
        path = folder / name
        found[name] = _checksum(path)
        for voxels in voxel_files(path):
            found[str(Path(name).parent / os.path.relpath(voxels, path.parent))] = _checksum(voxels)
    return found


def _checksum(path: Path) -> str:
    """SHA-256 of a file, or of the names and checksums of all files in a folder."""
    if path.is_file():
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    lines = [
        f"{_checksum(file)} {file.relative_to(path)}" for file in sorted(path.rglob("*")) if file.is_file()
    ]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()
