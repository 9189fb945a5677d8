"""Tell grey images from label maps by their voxels alone, and say how to give an image."""

from __future__ import annotations

import numpy as np

from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray

__all__ = ["HOW_TO_GIVE_AN_IMAGE", "image_without_mask", "refuse_grey_values"]

#: The hint where an image stands in a mask's place.
HOW_TO_GIVE_AN_IMAGE = (
    "give the organ's mask, and the image beside it (--image; column image of a sheet); of an image alone "
    "cccd segment makes a mask, and --threshold LOW:HIGH takes a range of its grey values"
)

#: A map of so many labels at most is not looked at: grey images have more values.
_FEW_VALUES = 16
#: A label hangs together where this share of its voxels' neighbours, at least, has it as well: a half in
#: labels of 2 x 2 x 2 voxels that touch others, a few hundredths in a grey image, a third in one slice
#: repeated.
_COHERENT = 0.35
#: Of a label map's labels this share at least hangs together; real ones have 0.4 to 1, grey images 0 to 0.03.
_COHERENT_VALUES = 0.2
#: A value with fewer neighbours than this says nothing.
_LEAST_NEIGHBOURS = 6
#: A smooth ramp of grey has so many values at least (more than there are vertebrae, which touch in order),
#: and this share of its borders is between values that follow each other.
_RAMP_VALUES, _RAMP_BORDERS = 64, 0.95
#: So many voxels are looked at: a tenth to a third of a second.
_MOST_VOXELS = 2_000_000


def image_without_mask(location: str, label: str = "") -> InputError:
    """Return the error of an image in which an organ, or the label of one, was looked for in vain."""
    lacking = f", so it has no label {label!r}" if label else ""
    return InputError(location, f"an image without a mask{lacking}", HOW_TO_GIVE_AN_IMAGE)


def refuse_grey_values(data: AnyArray, location: str) -> None:
    """Refuse whole numbers that are no labels.

    Labels lie together in space: most voxels have their neighbours' value. Grey values scatter, by noise or
    along slopes, but for a background; a smooth ramp's bands follow each other in order. Looked at are
    pairs of neighbouring slices, spread over the volume, and of their voxels those above 0.

    Parameters
    ----------
    data : (a, b, c) array of whole numbers
    location : str
        What messages name.

    Raises
    ------
    InputError
        Grey values, or values below -1 (which some programs write for "not looked at").
    """
    if not data.size:
        return
    low, high = data.min(), data.max()
    if high > 0 and (low < -1 or (high > _FEW_VALUES and _is_grey(data))):
        raise InputError(location, f"grey values, {low} to {high}, not labels", HOW_TO_GIVE_AN_IMAGE)


def _is_grey(data: AnyArray) -> bool:
    """Whether the values above 0 scatter, or follow each other as on a ramp."""
    at = _slices_looked_at(data.shape)
    values, ranks = np.unique(data[:, :, at], return_inverse=True)
    below = int(np.count_nonzero(values <= 0))
    count = len(values) - below
    if count <= _FEW_VALUES:
        return False
    ranks = ranks.reshape((*data.shape[:2], len(at))).astype(np.int32) - below  # 0 is the first label's
    alike, neighbours = np.zeros(count, np.int64), np.zeros(count, np.int64)
    borders = in_order = 0
    for axis in range(3):
        along = np.moveaxis(ranks, axis, 0)
        one, other = along[:-1], along[1:]
        if axis == 2:
            beside = np.diff(at) == 1
            one, other = one[beside], other[beside]
        labelled = (one >= 0) & (other >= 0)
        one, other = one[labelled], other[labelled]
        same = one == other
        alike += 2 * np.bincount(one[same], minlength=count)
        neighbours += np.bincount(one, minlength=count) + np.bincount(other, minlength=count)
        borders += int(np.count_nonzero(~same))
        in_order += int(np.count_nonzero(np.abs(one - other)[~same] <= 2))
    told = neighbours >= _LEAST_NEIGHBOURS
    if np.count_nonzero(told) <= _FEW_VALUES:
        return False
    coherent = alike[told] >= _COHERENT * neighbours[told]
    ramp = count >= _RAMP_VALUES and in_order >= max(_RAMP_BORDERS * borders, 1)
    return bool(coherent.mean() < _COHERENT_VALUES or ramp)


def _slices_looked_at(shape: tuple[int, ...]) -> AnyArray:
    """Return indices along the last axis, ascending: all, or pairs of neighbours spread over the volume."""
    a, b, c = shape
    pairs = max(1, _MOST_VOXELS // (2 * a * b))
    if 2 * pairs >= c:
        return np.arange(c)
    first = np.linspace(0, c - 2, pairs + 2)[1:-1].astype(int)
    return np.union1d(first, first + 1)
