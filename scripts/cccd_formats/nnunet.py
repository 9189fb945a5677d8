"""Probabilities as nnU-Net leaves them (``--save_probabilities``): ``.npz``, and its ``.pkl`` beside it.

Both versions write an array (channels, z, y, x). The second puts it back on the scan's whole grid; the first
leaves it cropped to what is not zero, and the ``.pkl`` says where that lies.
"""

from __future__ import annotations

import io
import json
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray, FloatArray, SingleArray
from cccd.inputs.grid import LPS_TO_RAS, Volume, check_affine
from cccd.inputs.labels import choose_labels
from cccd.inputs.readers import check_size, dataset_names, guarded

_HINT = "run nnUNetv2_predict --save_probabilities again, and keep both files"


class _BestTwo(NamedTuple):
    """The most probable label (a, b, c) everywhere, its probability, and that of the next one."""

    label: AnyArray
    best: AnyArray
    second: AnyArray


@dataclass(frozen=True, eq=False)
class Classes:
    """Probabilities of several labels on one grid.

    Attributes
    ----------
    values : dict of int to (a, b, c) float16 or float32
        By label; 0 is the background, which regions that overlap have none of.
    names : dict of int to str
        Names of the labels, from ``dataset.json``.
    affine : (4, 4) float64
        Index to world mm (RAS).
    location : str
        The file's name.
    """

    values: dict[int, AnyArray]
    names: dict[int, str]
    affine: FloatArray
    location: str

    def of_organ(self, label: str, organ: str) -> Volume:
        """Field of an organ, one half on its border, where it is as probable as the best of the other labels.

        Parameters
        ----------
        label, organ : str
            As in the cohort sheet; without a label the organ's name, or the only one.

        Returns
        -------
        Volume
            float32, 0 to 1. Of two labels it is the probability itself.

        Raises
        ------
        InputError
            No such label, or one that is nowhere the most probable.
        """
        known = {value: self.names.get(value, "") for value in self.values if value}
        chosen = choose_labels(known, label, organ, self.location, "label")
        field = self._largest(chosen)
        if 0 in self.values and len(chosen) < len(self.values):
            field = (1 + field - self._largest_but(chosen)) / 2
        if not (field >= 0.5).any():
            raise InputError(
                self.location,
                f"label {label or organ!r} is nowhere the most probable",
                "choose another label, or leave the row out",
            )
        return Volume(field, self.affine, self.location)

    def present(self) -> dict[str, str]:
        """List the labels that are the most probable somewhere, and the name of each."""
        if 0 not in self.values:
            there = [value for value in self.values if (self.values[value] >= 0.5).any()]
        else:
            there = [int(value) for value in np.unique(self._best_two.label) if value]
        return {str(value): self.names.get(value, "") for value in sorted(there)}

    def _largest(self, labels: Sequence[int]) -> SingleArray:
        return np.max([self.values[value] for value in labels], axis=0).astype(np.float32)

    def _largest_but(self, labels: Sequence[int]) -> SingleArray:
        """Return the largest probability of all labels but some."""
        if len(labels) > 1:
            return self._largest([value for value in self.values if value not in labels])
        two = self._best_two
        return np.where(two.label == labels[0], two.second, two.best).astype(np.float32)

    @cached_property
    def _best_two(self) -> _BestTwo:
        """Look through all labels once, for all organs."""
        (first, best), *others = self.values.items()
        label, second = np.full(best.shape, first, np.int32), np.zeros_like(best)
        for value, probability in others:
            higher = probability > best
            second = np.where(higher, best, np.maximum(second, probability))
            best, label = np.where(higher, probability, best), np.where(higher, np.int32(value), label)
        return _BestTwo(label, best, second)


def read_classes(path: Path) -> Classes:
    """Read nnU-Net's probabilities.

    Parameters
    ----------
    path : path
        The ``.npz``. Its ``.pkl`` lies beside it, ``dataset.json`` beside or above it.

    Raises
    ------
    InputError
        Not readable, no probabilities, or the ``.pkl`` is missing or of another scan.
    """
    location = path.name
    with guarded(location, "no probabilities of nnU-Net", _HINT), np.load(path, allow_pickle=False) as held:
        key = next((key for key in ("probabilities", "softmax") if key in held), None)
        if key is None:
            raise InputError(location, f"it contains {', '.join(held) or 'nothing'}, no probabilities", _HINT)
        check_size(_promised_shape(held, key)[-3:], location)
        channels = held[key]
    if channels.ndim != 4 or not np.issubdtype(channels.dtype, np.floating):
        size = " x ".join(map(str, channels.shape))
        raise InputError(location, f"its probabilities are {channels.dtype} of {size}", _HINT)
    if not np.isfinite(channels).all() or channels.min() < 0 or channels.max() > 1.001:
        raise InputError(location, "its values are no probabilities between 0 and 1", _HINT)
    facts = _read_facts(path.with_suffix(".pkl"), location)
    dataset = _dataset(path)
    with guarded(path.with_suffix(".pkl").name, "it lacks the position of the probabilities", _HINT):
        affine, size = _grid(facts)
        whole = _uncropped(channels, facts, size, "regions_class_order" not in dataset)
    before = facts.get("shape_before_cropping")  # the second version's, its axes perhaps in another order
    if (size is not None and whole.shape[1:] != size) or (
        before is not None and sorted(map(int, before)) != sorted(whole.shape[1:])
    ):
        found = " x ".join(map(str, whole.shape[:0:-1]))
        raise InputError(location, f"{found} voxels are not those of its .pkl", _HINT)
    names = _names(dataset, path)
    first = 1 if "regions_class_order" in dataset else 0
    return Classes(
        {first + n: channel.T for n, channel in enumerate(whole)},
        names,
        check_affine(affine, location),
        location,
    )


def _promised_shape(held: Any, key: str) -> tuple[int, ...]:
    """Shape of an archive's array by its header alone."""
    with held.zip.open(f"{key}.npy") as member:
        first = np.lib.format.read_magic(member) == (1, 0)
        read = np.lib.format.read_array_header_1_0 if first else np.lib.format.read_array_header_2_0
        return read(member)[0]


class _Facts(pickle.Unpickler):
    """Unpickler for plain values and arrays: any other name in a ``.pkl`` could run what it likes."""

    _PLAIN = frozenset(
        {
            ("collections", "OrderedDict"),
            ("numpy", "dtype"),
            ("numpy", "ndarray"),
            *(
                (f"numpy.{core}.{module}", name)
                for core in ("core", "_core")
                for module, name in (
                    ("multiarray", "_reconstruct"),
                    ("multiarray", "scalar"),
                    ("numeric", "_frombuffer"),
                )
            ),
        }
    )

    def find_class(self, module_name: str, global_name: str) -> Any:
        """Find a name that is allowed."""
        if (module_name, global_name) not in self._PLAIN:
            raise pickle.UnpicklingError(f"it asks for {module_name}.{global_name}")
        return super().find_class(module_name, global_name)


def _read_facts(path: Path, location: str) -> Mapping[str, Any]:
    """Read what nnU-Net knew of the scan."""
    if not path.is_file():
        raise InputError(location, f"{path.name}, which says where it lies, is not next to it", _HINT)
    with guarded(path.name, "not nnU-Net's properties of a scan", _HINT):
        facts = _Facts(io.BytesIO(path.read_bytes())).load()
        if not isinstance(facts, Mapping):
            raise TypeError(type(facts).__name__)
        return facts


def _grid(facts: Mapping[str, Any]) -> tuple[FloatArray, tuple[int, int, int] | None]:
    """Affine (RAS, of the axes x, y, z) of a scan, and its size (z, y, x) where it is known."""
    if "nibabel_stuff" in facts:
        held = facts["nibabel_stuff"]
        return np.array(held.get("reoriented_affine", held.get("original_affine")), float), _size(facts)
    if "sitk_stuff" in facts:
        held = facts["sitk_stuff"]
        spacing, origin, direction = held["spacing"], held["origin"], held["direction"]
    else:
        spacing, origin, direction = (facts[f"itk_{name}"] for name in ("spacing", "origin", "direction"))
    affine = np.eye(4)
    affine[:3, :3] = np.reshape(direction, (3, 3)) * np.asarray(spacing, float)
    affine[:3, 3] = origin
    return LPS_TO_RAS @ affine, _size(facts)


def _size(facts: Mapping[str, Any]) -> tuple[int, int, int] | None:
    """Voxels (z, y, x) of a scan, where its properties tell them in that order."""
    held = facts.get("original_size_of_raw_data")
    if held is None:
        return None
    z, y, x = (int(count) for count in held)
    return z, y, x


def _uncropped(
    channels: AnyArray, facts: Mapping[str, Any], size: tuple[int, int, int] | None, background: bool
) -> AnyArray:
    """Put cropped channels (C, z, y, x) back on the scan; beyond the crop all is background."""
    box = facts.get("crop_bbox")
    if size is None or box is None or channels.shape[1:] == size:
        return channels
    whole = np.zeros((len(channels), *size), channels.dtype)
    if background:
        whole[0] = 1
    whole[(slice(None), *(slice(int(low), int(high)) for low, high in box))] = channels
    return whole


def _dataset(path: Path) -> Mapping[str, Any]:
    """Read ``dataset.json``, beside or above; empty where there is none."""
    for folder in (path.parent, path.parent.parent):
        file = folder / "dataset.json"
        if file.is_file():
            with guarded(file.name, "not nnU-Net's dataset.json", "copy it from the training's folder"):
                return json.loads(file.read_text(encoding="utf-8"))
    return {}


def _names(dataset: Mapping[str, Any], path: Path) -> dict[int, str]:
    """Names by label; regions are numbered from 1 in their order."""
    if "regions_class_order" not in dataset:
        return dataset_names(path)
    named = (name for name in dataset["labels"] if name.lower() not in ("background", "ignore"))
    return dict(enumerate(named, 1))
