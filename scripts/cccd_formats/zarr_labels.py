"""Label maps in OME-Zarr."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any, cast

import numpy as np

from cccd.errors import InputError
from cccd.extras import needing
from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray
from cccd.inputs.grid import Volume, check_affine
from cccd.inputs.readers import guarded

#: mm per unit of length that OME-Zarr names; without a name, lengths are taken as mm.
_MM = {"millimeter": 1.0, "micrometer": 1e-3, "nanometer": 1e-6, "centimeter": 10.0, "meter": 1e3, "": 1.0}

#: Voxels that are read at once: half a gigabyte of bytes.
_MOST_VOXELS = 512e6

#: Directions against RAS (RFC 4); what names none is taken as RAS.
_AGAINST_RAS = {"right-to-left", "anterior-to-posterior", "superior-to-inferior"}

#: What ends at a missing chunk by this share of the voxels one layer further in, and by so many voxels, was
#: cut off there: a round end has half of them at most.
_CUT_SHARE, _CUT_VOXELS = 0.8, 16


def read_zarr(path: Path) -> Volume:
    """Read the label map of highest resolution of an OME-Zarr folder (0.4 or 0.5), of one time and channel.

    Returns
    -------
    Volume
        Axes z, y, x.

    Raises
    ------
    InputError
        No OME-Zarr, several times or channels, too many voxels, or a chunk that is damaged or missing.
    """
    name = path.name
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
    shape = array.shape[-3:]
    if np.prod(shape, dtype=float) > _MOST_VOXELS:
        size = " x ".join(map(str, shape))
        raise InputError(name, f"{size} voxels are too many", "crop it to the organ, or halve its voxels")
    affine = check_affine(_affine(axes[-3:], dataset, name), name)
    with guarded(name, "a chunk is damaged", "copy it again"):
        data = np.asarray(array[:]).reshape(shape)
    _check_chunks(data != 0, array, path / folder, name)
    return Volume(data, affine, name)


def _check_chunks(labelled: BoolArray, array: Any, folder: Path, name: str) -> None:
    """Refuse labels (Z, Y, X) that are cut off at a chunk whose file is not there.

    A chunk without a file is empty by Zarr's rules, and one that was lost looks the same.
    """
    size = np.array((array.shards or array.chunks)[-3:])
    lead = (0,) * (array.ndim - 3)
    for number in product(*(range(-(-n // c)) for n, c in zip(labelled.shape, size.tolist(), strict=True))):
        key = array.metadata.encode_chunk_key((*lead, *number))
        start = size * number
        missing = not (folder / key).exists()
        if missing and _is_cut(labelled, start, np.minimum(start + size, labelled.shape)):
            hint = "copy the folder again, or write zeros if nothing is there"
            raise InputError(name, f"chunk {key} is missing, and the organ is cut off there", hint)


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
