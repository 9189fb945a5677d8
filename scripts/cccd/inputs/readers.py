"""Read volumes from NIfTI, NRRD, MHA and whatever else SimpleITK reads.

Every reader returns a `Volume` in the file's own axis order with its affine in RAS, and refuses what is no
single three-dimensional scalar scan.
"""

from __future__ import annotations

import contextlib
import json
import math
import re
from collections.abc import Generator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import nibabel.loadsave
import numpy as np
from nibabel.analyze import AnalyzeImage
from nibabel.nifti1 import Nifti1Pair
from nibabel.spatialimages import SpatialImage

from cccd.errors import InputError
from cccd.file_headers import named_files, read_header
from cccd.geometry.arrays import AnyArray, FloatArray
from cccd.inputs.grid import LPS_TO_RAS, Volume, check_affine, farthest_apart
from cccd.plugins import Reader, find, own_rows, row, table

if TYPE_CHECKING:
    import SimpleITK as sitk  # noqa: N813


def volume_suffix(name: str) -> str:
    """Return the suffix of a volume's file, the longest that a row of ``READERS`` has; empty for other files.

    >>> volume_suffix("Liver.SEG.nrrd"), volume_suffix("liver.stl")
    ('.seg.nrrd', '')
    """
    return _suffix_in(own_rows("READERS"), name) or _suffix_in(table("READERS"), name)


def _suffix_in(rows: Mapping[str, Reader], name: str) -> str:
    known = (suffix for suffix, reader in rows.items() if reader.holds == "volume")
    return max(filter(name.lower().endswith, known), key=len, default="")


def without_suffix(name: str) -> str | None:
    """Return a volume's name without the suffix of its format; None for other files."""
    suffix = volume_suffix(name)
    return name[: -len(suffix)] if suffix else None


def reader_of(path: Path) -> Reader | None:
    """Return a volume's row of ``READERS``: by its name or, a folder's, by what is in it; None for others."""
    named: Reader | None = row("READERS", volume_suffix(path.name))
    if not path.is_dir() or (named and named.inside):
        return named
    rows = table("READERS").values()
    return next((row for row in rows if any((path / name).is_file() for name in row.inside)), None)


#: What people give in place of a volume, by its suffix, and what to give instead.
_OTHERWISE = {
    **dict.fromkeys(
        (".stl", ".obj", ".ply", ".vtp", ".glb", ".3mf", ".step", ".iges", ".surf.gii"),
        ("a surface, not a volume", "give the mask from which it was made, or run cccd surface on this file"),
    ),
    **dict.fromkeys(
        (".tsv", ".csv"), ("a table, not a volume", "cccd run and cccd check take a cohort sheet (.tsv)")
    ),
    ".pkl": ("nnU-Net's properties of a scan, not a volume", "give the .npz next to it"),
}
#: What a file may ask for: a damaged or hostile header must not fill the memory.
MOST = {
    "slices": 20_000,  # of a volume, or images of a series: several times a whole body at half a millimetre
    "pixels": 100_000_000,  # of one slice, 10,000 squared: micrographs have fewer
    "voxels": 4_000_000_000,  # 8 GB: a packed file of some megabytes can promise a thousand times its size
    "contours": 100_000,  # of one region (RTSTRUCT): dozens on every slice of a whole body
    "contour_points": 20_000_000,  # of all these contours, some hundred each: half a gigabyte
}
#: Deflate packs at most this many bytes into one.
_DEFLATE_RATIO = 1032
#: Where the voxels of a MetaImage or NRRD are: in itself, in a file, in a list, or in files with numbers.
_PLACE = re.compile(rb"^(?:ElementDataFile *=|data ?file:) *(.*?)\s*$", re.MULTILINE | re.IGNORECASE)
_SOUND_PLACE = re.compile(rb"[^%]*|[^%\s]+%0?\d?d[^%\s]*( \d+ \d+( [1-9]\d*( \d)?)?)?")
#: NRRD fields are never longer than so many bytes; Teem crashes on some that are.
_NRRD_FIELD = 400


@contextlib.contextmanager
def guarded(location: str, problem: str, hint: str) -> Generator[None]:
    """Turn whatever a decoder raises over a damaged file into one line.

    Decoders raise ``KeyError``, ``struct.error``, ``AssertionError`` and their own errors alike, so every
    ``Exception`` is caught; an `InputError` passes through, and a module that is not installed.

    Parameters
    ----------
    location, problem, hint : str
        Those of the `InputError`; the decoder's reason is added to the problem.

    Raises
    ------
    InputError
        In place of any other exception.
    """
    try:
        yield
    except (InputError, ModuleNotFoundError):
        raise
    except PermissionError:
        raise InputError(location, "you may not read it", "change its rights, or copy it") from None
    except Exception as error:
        # ITK ends with a "Reason" that is whatever the system's last error happened to be
        lines = [line.strip() for line in str(error).splitlines() if not re.match(r"\s*(Reason:|$)", line)]
        reason = re.sub(r"\(0x[0-9a-f]+\)", "", lines[-1] if lines else type(error).__name__)[:160]
        raise InputError(location, f"{problem} ({reason})", hint) from None


def read_volume(path: Path) -> Volume:
    """Read a volume from one file, by a row of ``READERS``; what has none is left to SimpleITK.

    Raises
    ------
    InputError
        No volume, not readable, truncated, larger than the limits, not 3-D, or with an unusable grid.

    See Also
    --------
    read_nifti, read_itk, cccd_formats.zarr_labels.read_zarr
    """
    if reader := reader_of(path):
        return find(reader.read)(path)
    if path.is_dir():
        raise InputError(path.name, "a folder, not a volume", "give one file")
    for suffix, (problem, hint) in _OTHERWISE.items():
        if path.name.lower().endswith(suffix):
            raise InputError(path.name, problem, hint)
    return read_itk(path)


def check_count(count: int, name: str, location: str) -> None:
    """Refuse more of something than `MOST` allows, before it is read.

    Examples
    --------
    >>> check_count(20_007, "slices", "a.nii")
    Traceback (most recent call last):
    ...
    cccd.errors.InputError: a.nii: it has 20007 slices, and 20000 are allowed; mend its header, or give a \
part of it
    """
    if count > MOST[name]:
        problem = f"it has {count} {name.replace('_', ' ')}, and {MOST[name]} are allowed"
        raise InputError(location, problem, "mend its header, or give a part of it")


def check_size(shape: Sequence[int], location: str) -> None:
    """Refuse a volume with more slices, larger slices or more voxels than `MOST` allows.

    Parameters
    ----------
    shape : sequence of int
        Voxels along each axis, as a header says, the last across slices; axes of colours or times included.
    location : str
        What messages name.

    Raises
    ------
    InputError
        Names the limit.
    """
    sizes = [int(size) for size in shape]
    voxels, slices = math.prod(sizes), sizes[-1] if sizes else 1
    check_count(slices, "slices", location)
    check_count(voxels // max(slices, 1), "pixels", location)
    check_count(voxels, "voxels", location)


def _spatial(data: AnyArray, location: str) -> AnyArray:
    """Drop trailing axes of length one; refuse what is still not three-dimensional."""
    while data.ndim > 3 and data.shape[-1] == 1:
        data = data[..., 0]
    if data.ndim != 3:
        size = " x ".join(str(n) for n in data.shape)
        raise InputError(location, f"not a 3-D volume ({size})", "give one volume or one time point of it")
    if data.dtype.names or not (np.issubdtype(data.dtype, np.number) or data.dtype == bool):
        raise InputError(
            location, "its voxels are not single numbers (colour?)", "give a grey or label volume"
        )
    if np.iscomplexobj(data):
        raise InputError(location, "its voxels are complex numbers", "give the magnitude")
    if not data.size:
        raise InputError(location, "it contains no voxels", "export the scan again")
    return data


def _check_promise(count: int, ratio: int, *files: Path) -> None:
    """Refuse a header that promises more than its files can hold: its reader would fill the memory."""
    if count > ratio * sum(file.stat().st_size for file in files):
        raise InputError(
            files[0].name, "its header promises more voxels than the file contains", "copy the file again"
        )


def _itk_files(path: Path) -> list[Path]:
    """Return the files of a NRRD or MetaImage, its header's first.

    What SimpleITK's C libraries are known to crash on, which would end the process, is refused.
    """
    header = read_header(path)
    if path.name.lower().endswith((".mha", ".mhd")):
        place = _PLACE.search(header)
        dimensions = re.findall(rb"^\s*NDims *=(.*)$", header[: place and place.end()], re.MULTILINE)
        sound = dimensions and all(re.fullmatch(rb" *[1-9]\s*", number) for number in dimensions)
    else:
        header = re.split(rb"\r?\n\r?\n", header)[0]
        place = _PLACE.search(header)
        fields = [line for line in header.split(b"\n") if not re.match(rb"#|[^:]*:=", line)]
        sound = max(map(len, fields)) <= _NRRD_FIELD
        if any(re.match(rb"encoding: *(te?xt|ascii)", field, re.IGNORECASE) for field in fields):
            raise InputError(path.name, "its voxels are written as text", "save it with encoding raw or gzip")
    if not sound or (place and not _SOUND_PLACE.fullmatch(place[1])):
        raise InputError(path.name, "its header is damaged", "copy the file again")
    if place is None or place[1].lower() == b"local":
        return [path]
    files = named_files(path)
    if not files:
        name = place[1].decode(errors="replace").replace("\0", "")[:80]
        raise InputError(path.name, f"the file of its voxels, {name!r}, is not there", "copy both again")
    return [path, *files]


def read_nifti(path: Path) -> Volume:
    """Read NIfTI-1/2, Analyze or MGH with nibabel, scaled as its header says.

    The affine is the sform where it is set, otherwise the qform.

    Raises
    ------
    InputError
        Not readable, truncated, not 3-D, or with an unusable affine.
    """
    location = path.name
    with guarded(location, "not a readable NIfTI volume", "convert it to NIfTI, NRRD or MHA"):
        image = cast(Any, nibabel.loadsave).load(path)
        if not isinstance(image, SpatialImage):
            raise InputError(location, "not a volume", "give a 3-D volume")
        affine = check_affine(image.affine, location)
    check_size(image.shape[:3], location)
    with guarded(location, "damaged or truncated", "copy or download the file again"):
        voxels = Path(image.file_map["image"].filename or path)
        ratio = _DEFLATE_RATIO if voxels.name.lower().endswith("gz") else 1
        _check_promise(math.prod(map(int, image.shape)) * image.get_data_dtype().itemsize, ratio, voxels)
        data = np.asanyarray(image.dataobj)
    warnings: list[str] = []
    if isinstance(image, AnalyzeImage):
        codes = (int(image.header[code]) for code in ("sform_code", "qform_code") if code in image.header)
        if not any(codes):
            warnings.append(f"{location}: no orientation in its header; left and right may be swapped")
    warnings += _two_places(image, location)
    names = _nifti_names(image) | dataset_names(path)
    return Volume(_spatial(data, location), affine, location, names, warnings=warnings)


def _two_places(image: SpatialImage, location: str) -> list[str]:
    """Say where a NIfTI header's two affines put the voxels at places that are not the same."""
    if not isinstance(image, Nifti1Pair):
        return []
    header = cast(Any, image)
    sform, qform = header.get_sform(coded=True)[0], header.get_qform(coded=True)[0]
    if sform is None or qform is None:
        return []
    apart = farthest_apart(sform, qform, image.shape[:3])
    if apart < 0.5 * np.linalg.norm(sform[:3, :3], axis=0).min():
        return []
    return [f"{location}: its sform and qform put it up to {apart:.3g} mm apart; the sform is used"]


def read_itk(path: Path) -> Volume:
    """Read NRRD, MHA/MHD or another format of SimpleITK.

    Raises
    ------
    InputError
        Not readable, not 3-D, or with an unusable grid.
    """
    import SimpleITK as sitk  # noqa: N813

    location = path.name
    reader = cast(Any, sitk.ImageFileReader())
    reader.SetFileName(str(path))
    with guarded(location, "not a readable volume", "give NIfTI, NRRD, MHA or DICOM"):
        known = location.lower().endswith((".nrrd", ".nhdr", ".mha", ".mhd"))
        files = _itk_files(path) if known else [path]
        reader.ReadImageInformation()
        check_size(reader.GetSize(), location)
        _check_promise(math.prod(map(int, reader.GetSize())), _DEFLATE_RATIO, *files)
        image = reader.Execute()
        if image.GetNumberOfComponentsPerPixel() > 1:
            problem = "its voxels are not single numbers (colour or 4-D)"
            raise InputError(location, problem, "give a grey or label volume")
        data = sitk.GetArrayFromImage(image).T
    if image.GetDimension() != 3:
        return Volume(_spatial(data, location), np.eye(4), location)
    with guarded(location, "its header is damaged", "export it again"):
        names = _segment_names({key: image.GetMetaData(key) for key in image.GetMetaDataKeys()})
    return Volume(_spatial(data, location), check_affine(itk_affine(image), location), location, names)


def itk_affine(image: sitk.Image) -> FloatArray:
    """Affine (4, 4), index to world mm (RAS), of a three-dimensional image of SimpleITK."""
    affine = np.eye(4)
    affine[:3, :3] = np.reshape(cast(Any, image).GetDirection(), (3, 3)) * image.GetSpacing()
    affine[:3, 3] = image.GetOrigin()
    return LPS_TO_RAS @ affine


def _nifti_names(image: SpatialImage) -> dict[int, str]:
    """Names of labels as TotalSegmentator writes them into the header's extension (Caret's XML)."""
    pattern = re.compile(rb'<Label\s[^>]*Key="(\d+)"[^>]*>(?:<!\[CDATA\[)?([^<\]]+)')
    found: dict[int, str] = {}
    for extension in getattr(image.header, "extensions", ()):
        content = extension.get_content()
        content = content if isinstance(content, bytes) else str(content).encode()
        found |= {int(key): name.decode(errors="replace").strip() for key, name in pattern.findall(content)}
    return found


def dataset_names(path: Path) -> dict[int, str]:
    """Names of labels from the ``dataset.json`` that nnU-Net keeps beside or above its label maps."""
    for folder in (path.parent, path.parent.parent):
        file = folder / "dataset.json"
        if not file.is_file():
            continue
        try:
            labels = json.loads(file.read_text(encoding="utf-8"))["labels"].items()
        except (AttributeError, KeyError, OSError, ValueError):
            continue
        # nnU-Net maps names to values (or to lists of values, its regions); its first version did the reverse
        pairs = [(key, value) if str(key).isdecimal() else (value, key) for key, value in labels]
        return {int(value): str(name) for value, name in pairs if str(value).isdecimal() and int(value)}
    return {}


def _segment_names(keys: dict[str, str]) -> dict[int, str]:
    """Names of labels as 3D Slicer writes them into ``.seg.nrrd``."""
    names: dict[int, str] = {}
    for key, value in keys.items():
        if match := re.fullmatch(r"(Segment\d+)_LabelValue", key):
            names[int(value)] = keys.get(f"{match[1]}_Name", match[1])
    return names
