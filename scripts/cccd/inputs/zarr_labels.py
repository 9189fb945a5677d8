"""Label maps in OME-Zarr."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, cast

import numpy as np

from cccd.errors import InputError
from cccd.extras import needing
from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray
from cccd.inputs.grid import check_affine
from cccd.inputs.readers import guarded

__all__ = ["ZarrLabels", "is_zarr", "open_zarr"]

#: mm per unit of length that OME-Zarr names; without a name, lengths are taken as mm.
_MM = {"millimeter": 1.0, "micrometer": 1e-3, "nanometer": 1e-6, "centimeter": 10.0, "meter": 1e3, "": 1.0}

#: Voxels that are read at once: half a gigabyte of bytes.
_MOST_VOXELS = 512e6

#: Directions against RAS (RFC 4); what names none is taken as RAS.
_AGAINST_RAS = {"right-to-left", "anterior-to-posterior", "superior-to-inferior"}

#: What ends at a missing chunk by this share of the voxels one layer further in, and by so many voxels, was
#: cut off there: a round end has half of them at most.
_CUT_SHARE, _CUT_VOXELS = 0.8, 16


def is_zarr(path: Path) -> bool:
    """Whether a path is that of a Zarr folder: by its name, or by what is in it."""
    return path.name.lower().rstrip("/").endswith(".zarr") or any(
        (path / name).is_file() for name in ("zarr.json", ".zgroup", ".zarray")
    )


@dataclass(eq=False)
class ZarrLabels:
    """The label map of highest resolution of an OME-Zarr folder.

    Attributes
    ----------
    path : Path
        The folder.
    affine : (4, 4) float64
        Index (z, y, x) to mm RAS.
    shape : (3,) tuple of int
        Slices, rows, columns.
    """

    path: Path
    affine: FloatArray
    shape: tuple[int, int, int]
    _array: Any = field(repr=False)
    _folder: Path = field(repr=False)

    def whole(self, label: str) -> BoolArray:
        """Read a label's voxels (Z, Y, X).

        Parameters
        ----------
        label : str
            Value or values, ``5`` or ``5,7``; empty for all but 0.

        Raises
        ------
        InputError
            There are too many voxels, no such label, a chunk is damaged or missing, or values are no labels.
        """
        name = self.path.name
        if label and not label.replace(",", "").isdecimal():
            raise InputError(name, f"label {label!r} is no number", "give its value: --label 5")
        if np.prod(self.shape, dtype=float) > _MOST_VOXELS:
            size = " x ".join(map(str, self.shape))
            raise InputError(name, f"{size} voxels are too many", "crop it to the organ, or halve its voxels")
        if self._array.dtype.kind not in "biu":
            raise InputError(name, f"its values are no labels ({self._array.dtype})", "give a label map")
        with guarded(name, "a chunk is damaged", "copy it again"):
            data = np.asarray(self._array[:]).reshape(self.shape)
        values = [int(value) for value in label.split(",") if value]
        mask = np.isin(data, values) if values else data != 0
        if not mask.any():
            raise InputError(name, f"there is no label {label or 'at all'} in it", "check --label")
        self._check_chunks(mask)
        return mask

    def _check_chunks(self, organ: BoolArray) -> None:
        """Refuse an organ (Z, Y, X) that is cut off at a chunk whose file is not there.

        A chunk without a file is empty by Zarr's rules, and one that was lost looks the same.
        """
        size = np.array((self._array.shards or self._array.chunks)[-3:])
        lead = (0,) * (self._array.ndim - 3)
        for number in product(*(range(-(-n // c)) for n, c in zip(self.shape, size.tolist(), strict=True))):
            key = self._array.metadata.encode_chunk_key((*lead, *number))
            start = size * number
            if not (self._folder / key).exists() and _is_cut(
                organ, start, np.minimum(start + size, self.shape)
            ):
                raise InputError(
                    self.path.name,
                    f"chunk {key} is missing, and the organ is cut off there",
                    "copy the folder again, or write zeros if nothing is there",
                )


def _is_cut(organ: BoolArray, start: AnyArray, stop: AnyArray) -> bool:
    """Whether an organ ends as if cut off at a face of a block without voxels of its own."""
    block = [slice(a, b) for a, b in zip(start, stop, strict=True)]
    for axis in range(3):
        for at, inwards in ((int(start[axis]) - 1, -1), (int(stop[axis]), 1)):
            if not 0 <= at < organ.shape[axis] or not 0 <= at + inwards < organ.shape[axis]:
                continue
            layers: list[int] = []
            for layer in (at, at + inwards):
                where = list(block)
                where[axis] = slice(layer, layer + 1)
                layers.append(int(np.count_nonzero(organ[tuple(where)])))
            if layers[0] >= max(_CUT_VOXELS, _CUT_SHARE * layers[1]):
                return True
    return False


def open_zarr(path: Path) -> ZarrLabels:
    """Open an OME-Zarr folder (0.4 or 0.5), of one time and one channel; nothing of the array is read.

    Raises
    ------
    InputError
        It is not there, no OME-Zarr, or has several times or channels.
    """
    name = path.name
    if not path.is_dir():
        raise InputError(name, "there is no such folder", "correct the path")
    with needing(name, "zarr"):
        import zarr  # pyright: ignore[reportMissingImports]  # of the extra zarr
    with guarded(name, "not a readable OME-Zarr", "export it again"):
        group = cast(Any, zarr).open_group(str(path), mode="r")
        attributes = dict(group.attrs)
    multiscales = attributes.get("ome", attributes).get("multiscales")
    if not multiscales:
        hint = "give the folder of an image, such as DATA.zarr/labels/NAME"
        raise InputError(name, "it has no OME multiscales: no sizes of voxels are known", hint)
    axes, dataset = multiscales[0]["axes"], multiscales[0]["datasets"][0]
    folder = dataset["path"]
    with guarded(name, f"the array {folder} is not readable", "export it again"):
        array = group[folder]
    kinds = [str(axis.get("name", "")).lower() for axis in axes]
    if kinds[-3:] != ["z", "y", "x"] or any(size != 1 for size in array.shape[:-3]):
        what = ", ".join(f"{kind} {size}" for kind, size in zip(kinds, array.shape, strict=True))
        raise InputError(name, f"its axes are {what}", "give z, y, x, of one time and one channel")
    z, y, x = array.shape[-3:]
    affine = check_affine(_affine(axes[-3:], dataset, name), name)
    return ZarrLabels(path, affine, (z, y, x), array, path / folder)


def _affine(axes: list[dict[str, Any]], dataset: dict[str, Any], name: str) -> FloatArray:
    """Index (z, y, x) to mm RAS, by the dataset's scale and translation."""
    scale, shift = np.ones(3), np.zeros(3)
    for change in dataset.get("coordinateTransformations", []):
        if change["type"] == "scale":
            scale = np.array(change["scale"][-3:], float)
        elif change["type"] == "translation":
            shift = np.array(change["translation"][-3:], float)
    affine = np.zeros((4, 4))
    affine[3, 3] = 1
    for n, axis in enumerate(axes):
        unit = str(axis.get("unit") or "")
        if unit not in _MM:
            raise InputError(name, f"the unit of {axis['name']} is {unit!r}", f"use one of {', '.join(_MM)}")
        orientation = axis.get("orientation") or {}
        value = orientation.get("value", "") if isinstance(orientation, dict) else orientation
        sign = -1.0 if value in _AGAINST_RAS else 1.0
        affine[2 - n, n] = sign * _MM[unit] * scale[n]
        affine[2 - n, 3] = sign * _MM[unit] * shift[n]
    return affine
