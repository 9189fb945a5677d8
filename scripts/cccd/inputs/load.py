"""From a request, or a row of the cohort sheet, to a `Structure`."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from cccd.containers import Annotation, Curves, Frame, Grid, Structure
from cccd.errors import InputError, nearest
from cccd.file_headers import dicom_modality, is_object, object_in, voxel_files
from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray, IntArray, SingleArray
from cccd.geometry.mesh import Mesh
from cccd.inputs.annotation import AUTO, EVERY_SLICE, NONEMPTY, annotation_note, find_annotation
from cccd.inputs.coarser_grid import CoarserGrid, find_coarser_grid
from cccd.inputs.grid import (
    Volume,
    bounding_box,
    check_affine,
    crop,
    find_slice_axis,
    interpolate_on_grid,
    on_grid,
    same_grid,
)
from cccd.inputs.labels import image_without_mask
from cccd.inputs.readers import without_suffix
from cccd.inputs.row_files import (
    LabelMap,
    checksum,
    read_boundary_maps,
    read_image,
    read_mask,
    read_now,
)
from cccd.plugins import find, table
from cccd.request import FILES, Request, completed
from cccd.settings.imports import ImportSettings

#: An organ on fewer slices has no slice between two others: its ends are most of it.
FEW_SLICES = 3

#: Background left around the organ: blurs and dilations near it stay inside the crop.
MARGIN_VOXELS = 3

# And around a rough region, on either side of whose border edges are sought.
_REGION_MARGIN_VOXELS = 8

# Longer than any organ: a header in micrometres asks for a mesh that fills every memory.
_MOST_MM = 10_000

#: An organ shorter than this is more often one whose header has metres.
SMALL_MM = 1.0

#: Distributions whose versions provenance records.
_READERS = ("h5py", "highdicom", "nibabel", "numpy", "pydicom", "simpleitk")


@dataclass(frozen=True)
class Scan:
    """What a row stands for, on one grid, before it is cropped to its organ (3D arrays of one shape)."""

    frame: Frame
    image: SingleArray | None = None
    mask: BoolArray | None = None
    probability: SingleArray | None = None
    region: BoolArray | None = None
    boundary: BoolArray | None = None
    contours: Curves | None = None
    truth: Mesh | None = None
    coarser: CoarserGrid | None = None
    annotated: str = EVERY_SLICE
    names: Mapping[int, str] = field(default_factory=dict[int, str])
    provenance: dict[str, Any] = field(default_factory=dict[str, Any])
    warnings: list[str] = field(default_factory=list[str])


def read_request(
    request: Request, settings: ImportSettings, seed: int = 0, files: Callable[..., Any] = read_now
) -> Structure:
    """Read one structure, cropped to its organ with a margin.

    Parameters
    ----------
    request : Request
    settings : ImportSettings
        How it is read.
    seed : int
        Determines everything random in a phantom, a scan and its damage.
    files : callable
        Requests of the same files share what was read of them by `reading_once`.

    Returns
    -------
    Structure
        With a margin of background on every side. Beyond the scan's faces the mask is background, grey values
        are those on the face, and ``origin`` may be negative.

    Raises
    ------
    InputError
        Names the request's location, what is wrong, and a hint.
    """
    location = request.location
    try:
        made = None if request.source == FILES else table("SOURCES").get(request.source)
        scan = find(made)(request, settings, seed) if made else _read_files(request, settings, files)
        if isinstance(scan, Structure):
            return scan
        if not request.organ:
            organ = scan.names.get(int(request.label)) or f"label_{request.label}"
            request = replace(request, organ=organ)
        return _crop(scan, request)
    except InputError as error:
        raise error.at(location) from None
    except MemoryError:
        raise InputError(location, "the scan does not fit into memory", "give the job more memory") from None


def structure_of_array(
    mask: AnyArray, affine: FloatArray, settings: ImportSettings, name: str = "mask", annotated: str = AUTO
) -> Structure:
    """Make a structure of a mask in memory, as `read_request` does of one in a file.

    Parameters
    ----------
    mask : (a, b, c) array
        Boolean; whole numbers, of which all but 0 are the organ; or probabilities: the border is where they
        are one half.
    affine : (4, 4) float
        Index to world mm (RAS).
    settings : ImportSettings
        ``slice_axis``.
    name : str
        Of the organ, and what messages name.
    annotated : {"auto", "every slice", "nonempty"}
        Which slices were drawn, see `cccd.inputs.annotation.find_annotation`.

    Raises
    ------
    InputError
        Not three-dimensional, empty, with an unusable affine, or with too few slices.
    """
    array = np.asarray(mask)
    if array.ndim != 3:
        raise InputError(name, f"it has {array.ndim} dimensions", "give a three-dimensional array")
    if array.dtype.kind not in "biuf":
        raise InputError(name, f"its values are no real numbers ({array.dtype})", "give a mask of numbers")
    volume = LabelMap.of(Volume(array, check_affine(affine, name), name)).organ("", name)
    layers = _mask_layers(volume.data)
    frame, coarser = frame_of(volume, settings), volume.coarser
    scan = Scan(frame, **layers, coarser=coarser, annotated=annotated, warnings=volume.warnings)
    return _crop(scan, Request(name, name, name))


def with_segmentation_notes(structure: Structure, report: Mapping[str, Any]) -> Structure:
    """Add to a structure what made its mask and what that warned of (the job segment_structure's report)."""
    provenance = {**structure.provenance, "segmenter": report["segmenter"]}
    return replace(structure, provenance=provenance, warnings=[*structure.warnings, *report["warnings"]])


def _read_files(request: Request, settings: ImportSettings, files: Callable[..., Any]) -> Scan:
    request = completed(request)
    paths = {name: existing(path, name) for name, path in request.files.items()}
    referenced = ""
    if "mask" in paths:
        paths["mask"] = object_in(paths["mask"])
        if "image" in paths and paths["image"].is_dir() and is_object(paths["mask"]):
            referenced = find(table("READERS")["reference"].read)(paths["mask"])
    image = None
    if "image" in paths:
        image = files(read_image, paths["image"], request.source, settings.fill_gaps, referenced)
    if "mask" in paths and paths["mask"].is_file() and dicom_modality(paths["mask"]) == "RTSTRUCT":
        if "boundary" in paths:
            raise InputError(
                request.location, "an RTSTRUCT cannot be combined with boundary maps", "empty one of them"
            )
        regions = files(find(table("READERS")["RTSTRUCT"].read), paths["mask"])
        scan = regions.scan(request, image, settings)
    else:
        scan = _scan_of_voxels(paths, request, image, settings, files)
    provenance = {
        "source": request.source,
        "label": request.label,
        "files": _checksums(request, files),
        "versions": dict(_versions()),
        **scan.provenance,
    }
    warnings: list[str] = [] if image is None else image.warnings
    return replace(scan, provenance=provenance, warnings=warnings + scan.warnings)


def frame_of(volume: Volume, settings: ImportSettings) -> Frame:
    """Return the grid of a volume, its slice axis as the settings choose it."""
    return Frame(volume.affine, slice_axis_of(volume, settings), volume.shape)


def slice_axis_of(volume: Volume, settings: ImportSettings) -> int:
    """Axis along which slices run; uneven ones are DICOM's, on a grid that may be finer than their pixels."""
    known = volume.uneven and settings.slice_axis == "auto"
    return 2 if known else find_slice_axis(volume.affine, settings.slice_axis)


def _scan_of_voxels(
    paths: Mapping[str, Path],
    request: Request,
    image: Volume | None,
    settings: ImportSettings,
    files: Callable[..., Any],
) -> Scan:
    """Read mask and boundary maps, or find the organ in the image, and move all to one grid."""
    mask = read_mask(paths["mask"], request, image, files) if "mask" in paths else None
    boundary = read_boundary_maps(paths["boundary"]) if "boundary" in paths else None
    provenance: dict[str, Any] = {}
    drawn = mask if boundary is None else boundary
    if drawn is None:
        assert image is not None  # the sheet's check
        if request.label:
            raise image_without_mask(image.location, request.label)
        found, provenance = find_organ(image, request, settings)
        if request.seeds:
            frame = frame_of(image, settings)
            return Scan(frame, image.data, region=found.data, provenance=provenance, warnings=found.warnings)
        mask = drawn = found
    warnings = [note for volume in (mask, boundary) if volume is not None for note in volume.warnings]
    if image is not None and on_grid(drawn, image.affine, image.shape, fill=False) is not None:
        grid = image
    else:
        grid = drawn
        if image is not None and drawn.uneven:
            warnings.append(
                f"{drawn.location}: unevenly spaced; grey values of {image.location} are not used"
            )
            image = None
    layers: dict[str, Any] = {}
    for name, volume in (("mask", mask), ("boundary", boundary), ("image", image)):
        if volume is not None:
            layers[name], notes = _move_to_grid(volume, grid, settings.resample)
            warnings += notes
    if mask is not None:
        if "mask" in paths and boundary is None:
            uneven = any(volume is not None and volume.uneven for volume in (mask, image))
            layers["annotated"] = NONEMPTY if request.annotated == AUTO and uneven else request.annotated
            layers["coarser"] = _coarser(mask, layers["mask"], grid)
        layers |= _mask_layers(layers["mask"]) | {"names": mask.names}
    return Scan(frame_of(grid, settings), **layers, provenance=provenance, warnings=warnings)


def _coarser(mask: Volume, moved: AnyArray, grid: Volume) -> CoarserGrid | None:
    """Give the voxels that a mask was copied from, where it was moved to the grid of its image."""
    if mask.coarser is None or (mask.shape == grid.shape and same_grid(mask.affine, grid.affine, grid.shape)):
        return mask.coarser
    return find_coarser_grid(moved, np.linalg.norm(grid.affine[:3, :3], axis=0))


def _mask_layers(mask: AnyArray) -> dict[str, Any]:
    """Return a mask as it is, or that of probabilities beside them."""
    return {"mask": mask} if mask.dtype == bool else {"mask": mask >= 0.5, "probability": mask}


def find_organ(image: Volume, request: Request, settings: ImportSettings) -> tuple[Volume, dict[str, Any]]:
    """Find the organ in an image without a mask, by a row of ``MASKS``: a mask, and how, for provenance."""
    how = "seed" if request.seeds else "stripped" if request.source == "upenn_gbm" else "threshold"
    return find(table("MASKS")[how])(image, request, settings)


def _move_to_grid(volume: Volume, grid: Volume, interpolate: bool) -> tuple[AnyArray, list[str]]:
    """Voxels of ``volume`` on the grid of another, by interpolation only if allowed, which is a warning."""
    if volume is grid:
        return volume.data, []
    binary = volume.data.dtype == bool
    moved = on_grid(volume, grid.affine, grid.shape, fill=False if binary else None)
    if moved is not None:
        return moved.data, []
    if not interpolate:
        raise InputError(
            volume.location,
            f"its grid ({_describe(volume)}) is not that of {grid.location} ({_describe(grid)})",
            "give matching files, or set import: resample: true to interpolate",
        )
    moved = interpolate_on_grid(volume, grid.affine, grid.shape, order=0 if binary else 1)
    return moved.data, [f"{volume.location}: interpolated on the grid of {grid.location}"]


def _describe(volume: Volume) -> str:
    """Describe a volume's grid for a message: voxels, spacing and the first voxel's position."""
    shape = " x ".join(str(n) for n in volume.shape)
    spacing = " x ".join(f"{size:.4g}" for size in np.linalg.norm(volume.affine[:3, :3], axis=0))
    origin = ", ".join(f"{x:.4g}" for x in volume.affine[:3, 3])
    return f"{shape} voxels of {spacing} mm from {origin}"


def existing(path: Path, column: str) -> Path:
    """Refuse a path that cannot be read, or does not exist, naming what its folder holds.

    Parameters
    ----------
    path : path
    column : str
        What messages name: the sheet's column.

    Raises
    ------
    InputError
        The path does not exist, or must not be read.
    """
    if path.exists():
        if not os.access(path, os.R_OK):
            raise InputError(column, f"you may not read {path.name}", "change its rights, or copy it")
        return path
    folder = path.parent
    if not folder.is_dir():
        raise InputError(column, f"{path.name} is not there, nor its folder {folder}", "correct the path")
    entries = (entry for entry in folder.iterdir() if not entry.name.startswith("."))
    names = sorted(entry.name for entry in entries if entry.suffix or not path.suffix)  # no folder for a file
    hint = nearest(path.name, names, lambda name: without_suffix(name) or name, "correct the path")
    raise InputError(column, f"there is no {path.name} in {folder}", hint)


def scan_of(structure: Structure) -> Volume | None:
    """Return the grey values around an organ, with where they lie; None where there are none."""
    if structure.image is None:
        return None
    return Volume(structure.image, structure.affine, f"the scan of {structure.organ}")


def _extent_of_contours(contours: Curves, frame: Frame) -> tuple[IntArray, IntArray, int]:
    """First and last index (3,) of the organ in the frame, and the number of its slices."""
    axis, plane = frame.slice_axis, list(frame.in_plane_axes)
    first, last = np.zeros(3, np.int64), np.zeros(3, np.int64)
    first[plane] = np.floor(contours.points.min(axis=0)).astype(int)
    last[plane] = np.ceil(contours.points.max(axis=0)).astype(int)
    first[axis], last[axis] = contours.slice.min(), contours.slice.max()
    return first, last, len(np.unique(contours.slice))


def _extent_of_voxels(scan: Scan) -> tuple[IntArray, IntArray, int]:
    """First and last index (3,) of the organ in the frame, and the number of its slices."""
    axis = scan.frame.slice_axis
    drawn = next(array for array in (scan.region, scan.boundary, scan.mask) if array is not None)
    first, last = bounding_box(drawn)
    slices = int(drawn.any(axis=tuple({0, 1, 2} - {axis})).sum())
    if scan.boundary is not None and scan.mask is not None and scan.mask.any():
        low, high = bounding_box(scan.mask)
        first, last = np.minimum(first, low), np.maximum(last, high)
    return first, last, slices


def _annotation(scan: Scan, first: IntArray, last: IntArray, location: str) -> Annotation | None:
    """Find which slices of a mask or of contours were drawn, where that is not all from first to last."""
    frame = scan.frame
    if scan.contours is not None:
        slices = np.unique(scan.contours.slice).astype(np.int64)
        some = scan.annotated == NONEMPTY and np.ptp(slices) >= len(slices)
        return Annotation(slices) if some else None
    if scan.mask is None or scan.annotated == EVERY_SLICE:
        return None
    if scan.probability is not None:
        if scan.annotated == NONEMPTY:
            raise InputError(
                location, "annotated: nonempty cannot be combined with probabilities", "give a mask of labels"
            )
        return None
    order = [frame.slice_axis, *frame.in_plane_axes]
    return find_annotation(
        crop(scan.mask, first, last).transpose(order), first[order], scan.annotated, location
    )


def _on_coarser_grid(scan: Scan, location: str) -> Scan:
    """Read a mask whose voxels are copies at those that they were copied from."""
    grid, mask, frame = scan.coarser, scan.mask, scan.frame
    if grid is None or mask is None or scan.probability is not None:
        return scan
    first, last, _ = _extent_of_voxels(scan)
    coarse_mask = grid.of(mask)
    # of so few voxels it is as likely an organ with flat sides of its own
    voxels_wide = [int(coarse_mask.any(axis=tuple({0, 1, 2} - {axis})).sum()) for axis in range(3)]
    if min(voxels_wide) < FEW_SLICES or _annotation(scan, first, last, location) is not None:
        return scan
    a, b, c = (len(index) for index in grid.index)
    coarse = Frame(frame.affine @ grid.affine, frame.slice_axis, (a, b, c), Grid(frame.affine, frame.shape))
    size = " x ".join(f"{mm:.3g}" for mm in coarse.spacing)
    note = f"the mask's voxels are copies of coarser ones, {size} mm; the surface is made of those"
    image = None if scan.image is None else grid.mean_of(scan.image)
    return replace(scan, frame=coarse, mask=coarse_mask, image=image, warnings=[*scan.warnings, note])


def _crop(scan: Scan, request: Request) -> Structure:
    scan = _on_coarser_grid(scan, request.location)
    frame, warnings = scan.frame, list(scan.warnings)
    axis = frame.slice_axis
    if scan.contours is None:
        first, last, slices = _extent_of_voxels(scan)
        warnings += _cut_notes(frame, first, last)
    else:
        first, last, slices = _extent_of_contours(scan.contours, frame)
        along = np.arange(3) == axis  # how far an image reaches to the sides is not always known
        warnings += _cut_notes(frame, np.where(along, first, 1), np.where(along, last, 0))
    if slices < FEW_SLICES:
        lies = f"{request.organ} lies on {slices} slice{'s'[: slices > 1]} along axis {axis}"
        warnings.append(f"{lies}: where it ends above and below is a guess")
    annotation = _annotation(scan, first, last, request.location)
    empty = int(last[axis] - first[axis]) + 1 - slices
    if empty and annotation is None and scan.contours is None:
        between = f"{empty} slice{'s'[: empty > 1]} between the organ's first and last"
        warnings.append(f"{between} {'are' if empty > 1 else 'is'} empty: filled from the others")
    warnings += _size_notes(frame, first, last, request.location)
    margin = MARGIN_VOXELS if scan.region is None else _REGION_MARGIN_VOXELS
    first, last = first - margin, last + margin
    if annotation is not None:  # beyond the drawn slices the organ may go on as far as their widest gap
        warnings.append(annotation_note(annotation, frame, scan.annotated))
        widest = int(np.diff(annotation.slices).max())
        first[axis] -= widest
        last[axis] += widest
    image, mask, region, boundary = (
        None if array is None else crop(array, first, last)
        for array in (scan.image, scan.mask, scan.region, scan.boundary)
    )
    probability = None
    if scan.probability is not None:  # beyond the scan there is nothing
        inside = crop(np.ones(frame.shape, bool), first, last)
        probability = np.where(inside, crop(scan.probability, first, last), np.float32(0))
    if region is not None and scan.mask is not None and mask is not None:
        outside = int(np.count_nonzero(scan.mask)) - int(np.count_nonzero(mask))
        note = f"{outside} voxels of the ground truth lie outside the crop, and are not scored"
        warnings += [note] * (outside > 0)
    if annotation is not None and mask is not None:
        drawn = np.isin(np.arange(int(mask.shape[axis])) + int(first[axis]), annotation.slices)
        mask &= np.expand_dims(drawn, frame.in_plane_axes)
    return Structure(
        case=request.case,
        organ=request.organ,
        frame=frame,
        origin=first.astype(np.int64),
        image=None if image is None else np.ascontiguousarray(image, np.float32),
        mask=mask,
        probability=probability,
        region=region,
        boundary=boundary,
        contours=scan.contours,
        truth=scan.truth,
        annotation=annotation,
        provenance=scan.provenance,
        warnings=warnings,
    )


def _cut_notes(frame: Frame, first: IntArray, last: IntArray) -> list[str]:
    """Warn at which faces of the scan the organ may be cut."""
    low, high = first <= 0, last >= np.array(frame.shape) - 1
    ends = [name for name, cut in zip(("first", "last"), (low, high), strict=True) if cut[frame.slice_axis]]
    sides = (low | high)[list(frame.in_plane_axes)].any()
    faces = [f"the scan's {name} slice" for name in ends] + ["the sides of its slices"] * bool(sides)
    return [f"the organ touches {' and '.join(faces)}: it may be cut there"] if faces else []


def _size_notes(frame: Frame, first: IntArray, last: IntArray, location: str) -> list[str]:
    """Refuse an organ that is longer than a limit, and warn of one that one would not see."""
    voxel = np.linalg.norm(frame.affine[:3, :3], axis=0)
    longest = float(((last - first + 1) * voxel).max())
    size = " x ".join(f"{mm:.4g}" for mm in voxel)
    if longest > _MOST_MM:
        raise InputError(
            location,
            f"the organ is {longest / 1000:.4g} m long, its voxels {size} mm",
            "give millimetres in the header",
        )
    if longest >= SMALL_MM:
        return []
    return [f"the organ is {longest:.2g} mm long, its voxels {size} mm: are the header's units millimetres?"]


@cache
def _versions() -> dict[str, str]:
    found: dict[str, str] = {}
    for name in _READERS:
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _checksums(request: Request, files: Callable[..., Any]) -> dict[str, str]:
    """Checksums of what a request names, and of the voxels in files beside headers, by their names."""
    found: dict[str, str] = {}
    for named in filter(None, (request.image, request.mask, request.boundary)):
        path = request.folder / named
        found[str(named)] = files(checksum, path)
        for voxels in voxel_files(path):
            name = named.parent / os.path.relpath(voxels, path.parent)
            found[str(name)] = files(checksum, voxels)
    return found
