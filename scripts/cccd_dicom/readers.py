"""Read DICOM: image series, segmentations (SEG) and structure sets (RTSTRUCT).

Coordinates in DICOM are LPS mm; everything that leaves this module is RAS.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pydicom
from pydicom.errors import InvalidDicomError

from cccd.errors import InputError, choices
from cccd.geometry.arrays import AnyArray, FloatArray, SingleArray
from cccd.inputs.grid import LPS_TO_RAS, Volume, check_affine
from cccd.inputs.labels import choose_labels
from cccd.inputs.load import Scan
from cccd.inputs.readers import check_count, check_size, guarded
from cccd.request import Request
from cccd.settings.imports import ImportSettings
from cccd.tolerances import ORTHOGONALITY
from cccd_dicom.drawn_contours import assemble_contours, contour_frame
from cccd_dicom.slices import CONTOUR_PLANE, SAME_PLANE_MM, even_grid

#: Slice positions may differ from even spacing by this share of the spacing.
_EVEN_SPACING = 0.02
#: Numbers in the headers of one series' slices may differ by this much (they are written with few digits).
_SAME_HEADER = 1e-4
#: Slices whose positions differ by less than this, in pixels, lie at one place.
_SAME_POSITION_PX = 1e-3

#: Modalities of what lies beside images, and has pixels or a position as they have.
NO_IMAGES = ("SEG", "RTSTRUCT", "RTDOSE")
#: What to do with an image that cannot be read.
_AGAIN = "copy it again, or take it out of the folder"
#: Nothing that says whose scan it is: free text, such as a description, may.
_HEADER = [
    *("SOPInstanceUID", "SeriesInstanceUID", "SeriesNumber", "Modality", "Rows", "Columns", "NumberOfFrames"),
    *("ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing", "SliceThickness"),
    "FrameOfReferenceUID",
]


class _Slice(NamedTuple):
    """One image of a series."""

    path: Path
    header: pydicom.Dataset  # without pixels


def sop_uid(image: pydicom.Dataset, keyword: str) -> str:
    """Read ``SOPClassUID`` or ``SOPInstanceUID`` of an image, empty where the file does not say it.

    Anonymisers blank it in the data set, and leave it in the header before that (PS3.10, section 7.1).
    """
    header = getattr(image, "file_meta", {})
    return known_uid(image.get(keyword)) or known_uid(header.get(f"MediaStorage{keyword}"))


def known_uid(value: object) -> str:
    """Return a UID, empty where there is none or a word in its place, as anonymisers write.

    Examples
    --------
    >>> known_uid("1.2.840.10008"), known_uid("anonymous"), known_uid(None)
    ('1.2.840.10008', '', '')
    """
    return str(value) if re.fullmatch(r"[0-9.]{1,64}", str(value)) else ""


def _series_in(folder: Path) -> dict[str, list[_Slice]]:
    """Images under a folder by series; other files and objects are skipped."""
    series: dict[str, list[_Slice]] = defaultdict(list)
    others: list[_Slice] = []
    for path in sorted(file for file in folder.rglob("*") if file.is_file()):
        with guarded(path.name, "its header is damaged", _AGAIN):
            try:
                header = pydicom.dcmread(path, stop_before_pixels=True, specific_tags=_HEADER)
            except InvalidDicomError:
                if path.suffix.lower() != ".dcm":
                    continue
                raise InputError(path.name, "it is not DICOM, though its name says so", _AGAIN) from None
        is_image = header.get("Rows") and header.get("Modality") not in NO_IMAGES
        images = series[str(header.get("SeriesInstanceUID", ""))] if is_image else others
        images.append(_Slice(path, header))
    kinds = {sop_uid(files[0].header, "SOPClassUID") for files in series.values()} - {""}
    for path, header in others:
        if sop_uid(header, "SOPClassUID") in kinds:
            raise InputError(path.name, "it is an image whose header ends too early", _AGAIN)
    return series


def _choose_series(folder: Path, modality: str | None, referenced: str) -> list[_Slice]:
    """Find the series under a folder: the referenced one, or the one there is, of one modality if named."""
    location, series = folder.name, _series_in(folder)
    if referenced in series:
        return series[referenced]
    if modality:
        series = {uid: files for uid, files in series.items() if files[0].header.get("Modality") == modality}
    if not series:
        kind = f"{modality} " if modality else ""
        raise InputError(
            location, f"no DICOM {kind}images in this folder", "give the folder of one DICOM series"
        )
    if len(series) > 1:
        named = [
            f"{files[0].path.parent.name} ({files[0].header.get('Modality', '?')}"
            f" series {files[0].header.get('SeriesNumber') or '?'}, {len(files)} images)"
            for files in series.values()
        ]
        raise InputError(
            location,
            f"{len(series)} DICOM series in this folder: {', '.join(named[:8])}",
            "give the folder of one",
        )
    (files,) = series.values()
    return files


def _check_alike(location: str, files: list[_Slice]) -> None:
    """Refuse slices without geometry, and slices of different images."""
    for path, header in files:
        for name in ("ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing"):
            if not header.get(name):
                raise InputError(location, f"{path.name} has no {name}", "give a series of axial-like slices")
    keys = ("Rows", "Columns", "ImageOrientationPatient", "PixelSpacing")
    first = files[0]
    for path, header in files[1:]:
        for name in keys:
            if not np.allclose(header[name].value, first.header[name].value, atol=_SAME_HEADER):
                raise InputError(
                    location,
                    f"{path.name} differs from {first.path.name} in {name}",
                    "give the folder of one scan",
                )


class _Stack(NamedTuple):
    """Parallel slices of a series in LPS mm, sorted along their normal."""

    files: list[_Slice]  # S of them
    plane: FloatArray  # (3, 2): steps along a row and along a column
    normal: FloatArray  # (3,), of unit length
    positions: FloatArray  # (S, 3) of the first pixels

    @property
    def heights(self) -> FloatArray:
        """Positions (S,) along the normal, ascending."""
        return self.positions @ self.normal

    @property
    def pixel_size(self) -> float:
        """The smaller edge of a pixel."""
        return np.linalg.norm(self.plane, axis=0).min()


def _stack(location: str, files: list[_Slice]) -> _Stack:
    """Read the geometry of a series from its headers."""
    _check_alike(location, files)
    first = files[0].header
    along_row, along_column = np.reshape([float(x) for x in first.ImageOrientationPatient], (2, 3))
    between_rows, between_columns = (float(x) for x in first.PixelSpacing)
    plane = np.column_stack([along_row * between_columns, along_column * between_rows])
    positions = np.array([[float(x) for x in file.header.ImagePositionPatient] for file in files])
    if not (np.isfinite(plane).all() and np.isfinite(positions).all()) or not plane.any(axis=0).all():
        raise InputError(location, "its slices have no usable geometry", "export the series again")
    normal = np.cross(along_row, along_column)
    order = np.argsort(positions @ normal, kind="stable")
    return _Stack([files[n] for n in order], plane, normal, positions[order])


def _modality_pixels(path: Path) -> SingleArray:
    """Pixels (columns, rows) of one slice in modality units (HU)."""
    with guarded(path.name, "its pixels cannot be decoded", "export the slice again"):
        dataset = pydicom.dcmread(path)
        pixels = dataset.pixel_array
    if pixels.ndim != 2:
        raise InputError(
            path.name, "its pixels are not single numbers (colour?)", "give a CT, MR or PET series"
        )
    with guarded(path.name, "its rescale slope is damaged", "export the slice again"):
        slope = float(dataset.get("RescaleSlope", 1))
        intercept = float(dataset.get("RescaleIntercept", 0))
    return (pixels.astype(np.float32) * np.float32(slope) + np.float32(intercept)).T


def read_series(
    folder: Path,
    fill_gaps: bool = False,
    modality: str | None = None,
    referenced: str = "",
) -> Volume:
    """Read the one image series in a folder (and the folders below), or the referenced one of several.

    Parameters
    ----------
    folder : path
        A folder, or the one file of a single or multi-frame image.
    fill_gaps : bool
        Interpolate missing and unevenly spaced slices; otherwise they are an error.
    modality : str, optional
        Look at series of this modality only, e.g. ``"CT"``.
    referenced : str
        UID of the series to take where the folder has it; empty where nothing refers to one.

    Returns
    -------
    Volume
        Values in modality units (HU), float32; axes are column, row, slice. The slice spacing comes from the
        slices' positions; SliceThickness, which is wrong where slices overlap or leave gaps, is used for a
        single slice only.

    Raises
    ------
    InputError
        No series or several, mixed or undecodable slices, slices missing or uneven.
    """
    location = folder.name
    with guarded(location, "its headers are damaged", "export the series again"):
        if folder.is_file():
            files = [_Slice(folder, pydicom.dcmread(folder, stop_before_pixels=True))]
        else:
            files = _choose_series(folder, modality, referenced)
        check_size(_promised(files), location)
        if len(files) == 1 and int(files[0].header.get("NumberOfFrames") or 1) > 1:
            return _read_multiframe(files[0].path)
        stack = _stack(location, files)
    affine, spacing = _stack_affine(location, stack)
    data = np.stack([_modality_pixels(file.path) for file in stack.files], axis=-1)
    warnings: list[str] = []
    index = (stack.heights - stack.heights[0]) / spacing
    if np.abs(index - np.arange(len(index))).max() > _EVEN_SPACING * max(1, len(index) ** 0.5):
        finer, _ = even_grid(stack.heights, CONTOUR_PLANE)
        affine[:3, 2] *= finer / spacing
        data, note = _interpolate_slices(location, data, index, spacing, finer / spacing, fill_gaps)
        warnings.append(note)
    return Volume(
        data,
        affine,
        location,
        warnings=warnings,
        instances=tuple(sop_uid(file.header, "SOPInstanceUID") for file in stack.files),
        frame_of_reference=str(stack.files[0].header.get("FrameOfReferenceUID", "")),
        uneven=bool(warnings),
    )


def _promised(files: list[_Slice]) -> tuple[int, int, int]:
    """Pixels along a slice's two edges and images, as the headers of a series say."""
    header = files[0].header
    frames = int(header.get("NumberOfFrames") or 1) if len(files) == 1 else len(files)
    return int(header.get("Rows") or 1), int(header.get("Columns") or 1), frames


def _stack_affine(location: str, stack: _Stack) -> tuple[FloatArray, float]:
    """Affine (4, 4) in RAS of index (column, row, slice), and the slice spacing, the median gap."""
    positions, heights = stack.positions, stack.heights
    gaps = np.diff(heights)
    if len(gaps) and gaps.min() < _SAME_POSITION_PX * stack.pixel_size:
        where = stack.files[int(gaps.argmin())].path.name
        raise InputError(
            location,
            f"several images lie at the position of {where}",
            "give one time point or reconstruction",
        )
    if len(gaps):
        spacing = float(np.median(gaps))
        step = (positions[-1] - positions[0]) / (heights[-1] - heights[0]) * spacing
    else:
        spacing = float(stack.files[0].header.get("SliceThickness") or 1.0)
        step = stack.normal * spacing
    affine = np.eye(4)
    affine[:3, :3] = np.column_stack([stack.plane, step])
    affine[:3, 3] = positions[0]
    affine = check_affine(LPS_TO_RAS @ affine, location)
    strays = positions - positions[0] - np.outer((heights - heights[0]) / spacing, step)
    if np.abs(strays).max(initial=0) > max(_EVEN_SPACING * spacing, ORTHOGONALITY * stack.pixel_size):
        raise InputError(location, "its slices do not lie in one line", "give the folder of one scan")
    return affine, spacing


def _interpolate_slices(
    location: str, data: AnyArray, index: FloatArray, spacing: float, step: float, fill_gaps: bool
) -> tuple[AnyArray, str]:
    """Interpolate slices (c, r, S) at ``index`` (S,) onto multiples of a step, if allowed, and say so."""
    gaps = np.diff(index)
    missing = int(np.rint(gaps - 1).sum()) if np.abs(gaps - np.rint(gaps)).max() < CONTOUR_PLANE else 0
    worst = int(gaps.argmax())
    problem = (
        f"{missing} slices are missing (a gap of {gaps[worst] * spacing:g} mm after slice {worst + 1}, "
        f"{spacing:g} mm elsewhere)"
        if missing
        else f"its slices are unevenly spaced ({gaps.min() * spacing:g} to {gaps.max() * spacing:g} mm)"
    )
    if not fill_gaps:
        raise InputError(
            location, problem, "complete the series, or set import: fill_gaps: true to interpolate"
        )
    even = step * np.arange(int(np.rint(index[-1] / step)) + 1)
    low = np.clip(np.searchsorted(index, even, side="right") - 1, 0, len(index) - 2)
    share = np.clip((even - index[low]) / (index[low + 1] - index[low]), 0, 1).astype(np.float32)
    return data[..., low] * (1 - share) + data[..., low + 1] * share, f"{location}: {problem}; interpolated"


def _read_multiframe(path: Path) -> Volume:
    """Read an enhanced (multi-frame) CT or MR; axes are column, row, slice."""
    import highdicom  # slow to import, and few inputs need it

    with guarded(path.name, "no volume can be made of its frames", "export it again"):
        volume = highdicom.imread(path).get_volume().flip_spatial(0)  # slices along the normal, as a series'
    frame = str(volume.frame_of_reference_uid or "")
    affine = check_affine(LPS_TO_RAS @ volume.affine[:, [2, 1, 0, 3]], path.name)
    data = np.asarray(volume.array, np.float32).transpose(2, 1, 0)  # from slice, row, column
    return Volume(data, affine, path.name, frame_of_reference=frame)


@dataclass(frozen=True, eq=False)
class Segments:
    """A DICOM SEG, read once for all its segments.

    Attributes
    ----------
    seg : highdicom.seg.Segmentation
    names : dict of int to str
        Labels of the segments by their numbers.
    referenced : set of str
        SOP instance UIDs of the images whose pixels the frames mark.
    location : str
        The file's name.
    """

    seg: Any
    names: dict[int, str]
    referenced: set[str]
    location: str

    @classmethod
    def read(cls, path: Path) -> Segments:
        """Read a SEG.

        Raises
        ------
        InputError
            Not a SEG, or too large.
        """
        import highdicom  # slow to import, and few inputs need it

        location = path.name
        with guarded(location, "not a readable DICOM SEG", "export the segmentation again"):
            header = pydicom.dcmread(path, stop_before_pixels=True)
            check_size(_promised([_Slice(path, header)]), location)
            seg = highdicom.seg.segread(path)
            names = {n: seg.get_segment_description(n).segment_label for n in seg.segment_numbers}
            return cls(seg, names, _referenced(seg), location)

    def mask(self, label: str, organ: str, series: Volume | None) -> Volume:
        """Take segments as one mask.

        Parameters
        ----------
        label : str
            Segment numbers (``"1"``, ``"1,2"``) or a segment's label; empty when there is just one segment or
            one that is called like the organ.
        organ : str
            The row's organ.
        series : Volume, optional
            The image series, to check that the segmentation refers to it.

        Returns
        -------
        Volume
            Boolean; slices without a frame are background. Fractions are cut at one half.

        Raises
        ------
        InputError
            No such segment, frames that form no volume, or slices that the series does not have.
        """
        seg, location = self.seg, self.location
        chosen = choose_labels(self.names, label, organ, location, "segment")
        if series is not None and series.instances:
            unknown = self.referenced - set(series.instances)
            if unknown:
                raise InputError(
                    location,
                    f"it refers to {len(unknown)} slices that {series.location} does not have",
                    "give the series that was segmented",
                )
        with guarded(location, "its frames form no volume", "export it on the slices of one series"):
            if not self._frames.is_regular:
                return replace(self._frames.volume(seg, chosen, location), names=self.names)
            volume = seg.get_volume(segment_numbers=chosen, combine_segments=False)
            volume = volume.flip_spatial(0)  # slices along the normal, as a series'
        data = np.asarray(volume.array)
        mask = np.any(data.reshape(*data.shape[:3], -1) >= 0.5, axis=-1).transpose(2, 1, 0)
        affine = volume.affine[:, [2, 1, 0, 3]]
        made_on = seg.get("ReferencedSeriesSequence", [])
        if sum(len(one.get("ReferencedInstanceSequence", [])) for one in made_on) > mask.shape[2]:
            # the scan goes on where the SEG has no frames
            mask = np.pad(mask, ((0, 0), (0, 0), (1, 1)))
            affine[:3, 3] -= affine[:3, 2]
        affine = check_affine(LPS_TO_RAS @ affine, location)
        reference = str(volume.frame_of_reference_uid or "")
        return Volume(mask, affine, location, self.names, frame_of_reference=reference)

    @cached_property
    def _frames(self) -> _Frames:
        return _Frames.of(self.seg)


class _Frames(NamedTuple):
    """Where the frames of a SEG lie, in LPS mm; several segments may have frames at one place."""

    plane: FloatArray  # (3, 2): steps along a row and along a column
    normal: FloatArray  # (3,), of unit length
    positions: FloatArray  # (F, 3) of the first pixels

    @classmethod
    def of(cls, seg: Any) -> _Frames:
        """Read them from the functional groups."""
        own = seg.PerFrameFunctionalGroupsSequence

        plane = _group(seg, own[0], "PlaneOrientationSequence").ImageOrientationPatient
        along_row, along_column = np.reshape([float(x) for x in plane], (2, 3))
        rows, columns = (float(x) for x in _group(seg, own[0], "PixelMeasuresSequence").PixelSpacing)
        positions = [
            [float(x) for x in _group(seg, frame, "PlanePositionSequence").ImagePositionPatient]
            for frame in own
        ]
        plane = np.column_stack([along_row * columns, along_column * rows])
        return cls(plane, np.cross(along_row, along_column), np.array(positions))

    @property
    def _ordered(self) -> FloatArray:
        """Positions (P, 3) along the normal, each once."""
        heights = self.positions @ self.normal
        order = np.argsort(heights, kind="stable")
        return self.positions[order][np.r_[True, np.diff(heights[order]) > SAME_PLANE_MM]]

    @property
    def is_regular(self) -> bool:
        """Whether they lie above each other, at multiples of one distance."""
        places = self._ordered
        if len(places) < 2:
            return True
        away = places - places[0]
        aside = away - np.outer(away @ self.normal, self.normal)
        heights = away @ self.normal
        least = np.diff(heights).min()
        multiples = heights / least
        pixel = np.linalg.norm(self.plane, axis=0).min()
        even = np.abs(multiples - np.rint(multiples)).max() <= _EVEN_SPACING * max(1, len(heights) ** 0.5)
        return bool(even and np.abs(aside).max() <= ORTHOGONALITY * pixel * max(1.0, multiples[-1]))

    def volume(self, seg: Any, chosen: Sequence[int], location: str) -> Volume:
        """Put the frames of some segments onto a grid through their planes, tilted or uneven as they are."""
        places = self._ordered
        heights = places @ self.normal
        spacing, index = even_grid(heights)
        step = (places[-1] - places[0]) / index[-1]
        affine = np.eye(4)
        affine[:3, :3], affine[:3, 3] = np.column_stack([self.plane, step]), places[0]
        off = places - places[0] - index[:, None] * step
        if (
            np.abs(off - np.outer(off @ self.normal, self.normal)).max()
            > np.linalg.norm(self.plane, axis=0).min()
        ):
            raise InputError(location, "its frames do not lie in one line", "export it on one series")
        owner = np.rint((self.positions @ self.normal - heights[0]) / spacing).astype(int)
        pixels = seg.pixel_array.reshape(len(self.positions), int(seg.Rows), int(seg.Columns))
        labelled = str(seg.SegmentationType) == "LABELMAP"
        most = float(seg.get("MaximumFractionalValue", 1)) if seg.SegmentationType == "FRACTIONAL" else 1.0
        mask = np.zeros((int(seg.Columns), int(seg.Rows), int(index[-1]) + 1), bool)
        for k, frame, pixel in zip(owner, seg.PerFrameFunctionalGroupsSequence, pixels, strict=True):
            if labelled:
                mask[..., k] |= np.isin(pixel, chosen).T
            elif _group(seg, frame, "SegmentIdentificationSequence").ReferencedSegmentNumber in chosen:
                mask[..., k] |= (pixel >= 0.5 * most).T
        margin = int(np.median(np.diff(index)))
        if margin > 1:  # empty slices show that the organ ends there, rather than being cut by the scan's end
            mask = np.pad(mask, ((0, 0), (0, 0), (margin, margin)))
            affine[:3, 3] -= margin * affine[:3, 2]
        reference = str(seg.get("FrameOfReferenceUID", ""))
        affine = check_affine(LPS_TO_RAS @ affine, location)
        return Volume(mask, affine, location, frame_of_reference=reference, uneven=margin > 1)


def _group(seg: Any, frame: Any, name: str) -> Any:
    """Functional group of a frame: its own, or that of all frames."""
    return (frame if name in frame else seg.SharedFunctionalGroupsSequence[0])[name][0]


def _referenced(seg: pydicom.Dataset) -> set[str]:
    """SOP instance UIDs of the images whose pixels the frames mark."""
    return {
        str(source.ReferencedSOPInstanceUID)
        for frame in seg.get("PerFrameFunctionalGroupsSequence", [])
        for derivation in frame.get("DerivationImageSequence", [])
        for source in derivation.get("SourceImageSequence", [])
    }


@dataclass(frozen=True, eq=False)
class Regions:
    """A DICOM RTSTRUCT, read once for all its regions of interest (ROIs).

    Attributes
    ----------
    names : dict of int to str
        Names of the ROIs by their numbers.
    items : dict of int to Dataset
        Their contours' items.
    frame_of_reference : str
        UID.
    location : str
        The file's name.
    """

    names: dict[int, str]
    items: dict[int, pydicom.Dataset]
    frame_of_reference: str
    location: str

    @classmethod
    def read(cls, path: Path) -> Regions:
        """Read an RTSTRUCT.

        Raises
        ------
        InputError
            Not an RTSTRUCT, or one without an ROI.
        """
        location = path.name
        with guarded(location, "not a readable RTSTRUCT", "export the structure set again"):
            dataset = pydicom.dcmread(path)
            regions = dataset.StructureSetROISequence
            names = {int(item.ROINumber): str(item.get("ROIName", "")) for item in regions}
            items = {int(item.ReferencedROINumber): item for item in dataset.get("ROIContourSequence", [])}
            frame = str(dataset.get("FrameOfReferenceUID") or "")
            for item in dataset.get("ReferencedFrameOfReferenceSequence", []):
                frame = str(item.get("FrameOfReferenceUID", "")) or frame
        if not names:
            raise InputError(location, "it has no ROI", "export the structure set again")
        return cls(names, items, frame, location)

    def contours(self, label: str, organ: str) -> list[list[FloatArray]]:
        """Take the contours of ROIs.

        Parameters
        ----------
        label, organ : str
            See `Segments.mask`; the labels here are ROI names or numbers.

        Returns
        -------
        list of list of (n, 3) float64
            Contours of every chosen ROI in world mm (RAS), the first point not repeated; marks are left out.

        Raises
        ------
        InputError
            No such ROI, an ROI without contours, an open contour, or damaged coordinates.
        """
        location, names = self.location, self.names
        doubles = {name for name, count in Counter(names.values()).items() if count > 1}
        rois: list[list[FloatArray]] = []
        for number in choose_labels(names, label, organ, location, "ROI"):
            if names[number] in doubles and not label.isdecimal():
                raise InputError(
                    location, f"several ROIs are called {names[number]!r}", "give the ROI's number as label"
                )
            with guarded(location, f"ROI {names[number]!r} is damaged", "export the structure set again"):
                contours = self._contours_of(number)
            if not contours:
                drawn = [n for n, item in self.items.items() if item.get("ContourSequence")]
                filled = [names[n] for n in drawn if n in names]
                raise InputError(location, f"ROI {names[number]!r} has no contours", choices(filled))
            rois.append([contour for contour in contours if len(contour)])
        return rois

    def scan(self, request: Request, image: Volume | None, settings: ImportSettings) -> Scan:
        """Take the contours that are asked for, and of the image the slices that they were drawn on."""
        rois, location = self.contours(request.label, request.organ), self.location
        drawn = [contour for roi in rois for contour in roi]
        if not drawn:
            raise InputError(location, "its ROI holds points only", "choose another ROI")
        others = None if image is not None else self.first_points
        frame, keep, warnings = contour_frame(drawn, image, location, settings.contour_pixel_mm, others)
        if settings.slice_axis not in ("auto", frame.slice_axis):
            problem = f"its contours lie across axis {frame.slice_axis}, not {settings.slice_axis}"
            raise InputError(location, problem, "set import: slice_axis: auto")
        if image is not None and image.frame_of_reference not in ("", self.frame_of_reference):
            warnings.append(f"{location}: its frame of reference is not that of {image.location}")
        contours, notes = assemble_contours(rois, frame, location)
        grey = None
        if image is not None and keep is not None:
            grey = image.data[tuple(keep if axis == frame.slice_axis else slice(None) for axis in range(3))]
        scan = Scan(frame, grey, contours=contours, annotated=request.annotated, names=self.names)
        return replace(scan, warnings=warnings + notes)

    @cached_property
    def first_points(self) -> FloatArray:
        """First point (N, 3) of each contour of all ROIs in world mm (RAS)."""
        with guarded(self.location, "its contours are damaged", "export the structure set again"):
            items = [item for roi in self.items.values() for item in roi.get("ContourSequence", [])]
            points = [[float(x) for x in _coordinates(item)[:3]] for item in items]
            return np.array(points).reshape(-1, 3) @ LPS_TO_RAS[:3, :3]

    def _contours_of(self, number: int) -> list[FloatArray]:
        item = self.items.get(number)
        sequence = [] if item is None else item.get("ContourSequence", [])
        check_count(len(sequence), "contours", self.location)
        points = sum(len(_coordinates(item)) for item in sequence) // 3
        check_count(points, "contour_points", self.location)
        return [_contour(self.location, self.names[number], item) for item in sequence]


def _coordinates(item: pydicom.Dataset) -> Sequence[str]:
    """Coordinates of a contour, as text."""
    # Above 64 kB they have no type in explicit syntax (PS3.5, 6.2.2).
    data = item.get("ContourData") or []
    return data.decode("ascii").split("\\") if isinstance(data, bytes) else data


def _contour(location: str, roi: str, item: pydicom.Dataset) -> FloatArray:
    """Points (n, 3) of a contour in world mm (RAS), none of a mark."""
    kind = str(item.get("ContourGeometricType", "CLOSED_PLANAR"))
    if kind == "POINT":  # marks, not outlines
        return np.zeros((0, 3))
    if not kind.replace("_", "").startswith("CLOSEDPLANAR"):
        raise InputError(
            location, f"ROI {roi!r} has an open contour ({kind})", "close its contours and export again"
        )
    points = np.array([float(x) for x in _coordinates(item)]).reshape(-1, 3)
    if not np.isfinite(points).all():
        raise InputError(location, f"ROI {roi!r} has coordinates that are not finite", "export it again")
    return points @ LPS_TO_RAS[:3, :3]


#: What the core asks for.
read_segments, read_regions = Segments.read, Regions.read
