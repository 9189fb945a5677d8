"""Labels of a map: choose them by number or name, know FreeSurfer's, and tell maps from grey images."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np

from cccd.errors import InputError, choices, nearest
from cccd.geometry.arrays import AnyArray, distinct

#: A map is FreeSurfer's with so many labels, none of another number, and white matter on both sides.
_FEWEST, _WHITE_MATTER = 12, {2, 41}


def plain_name(name: str) -> str:
    """Turn a name into one that the cohort sheet allows."""
    return re.sub(r"[^A-Za-z0-9_-]+", "_", name).strip("_")


def choose_labels(names: dict[int, str], label: str, organ: str, location: str, kind: str) -> list[int]:
    """Choose labels by number or name.

    Parameters
    ----------
    names : dict of int to str
        The labels that exist.
    label : str
        Numbers, one name, or several names separated by commas; empty stands for the only one or the one
        that is called like the organ.
    organ : str
        The row's organ.
    location, kind : str
        For the message: the file and what its labels are called.

    Returns
    -------
    list of int
        Numbers of the labels chosen, ascending.

    Raises
    ------
    InputError
        No such label; lists those there are.

    Examples
    --------
    >>> choose_labels({5: "liver", 7: "spleen"}, "Spleen", "organ", "scan.nii", "label")
    [7]
    >>> choose_labels({5: "liver", 7: "spleen"}, "5, 7", "organ", "scan.nii", "label")
    [5, 7]
    """
    there = choices(f"{number} ({name})" if name else number for number, name in sorted(names.items()))
    if not label:
        if len(names) == 1:
            return list(names)
        called = [number for number, name in names.items() if name.lower() == organ.lower()]
        if len(called) == 1:
            return called
        raise InputError(location, f"it has {len(names)} {kind}s and no label says which", there)
    wanted = [part.strip() for part in label.split(",")]
    for parts in ([label], wanted):
        found = [_labels_called(names, part) for part in parts]
        if all(found):
            return sorted({number for numbers in found for number in numbers})
    absent = next(part for part, numbers in zip(wanted, found, strict=True) if not numbers)
    near = nearest(absent, filter(None, names.values()), otherwise=there)
    raise InputError(location, f"it has no {kind} {absent!r}", near)


def _labels_called(names: dict[int, str], wanted: str) -> list[int]:
    """Numbers that ``wanted`` means: an exact name, then a number, then a name in another case."""
    exact = [number for number, name in names.items() if name == wanted]
    if not exact and wanted.isdecimal():
        exact = [number for number in names if number == int(wanted)]
    if exact:
        return exact
    return [number for number, name in names.items() if name.strip().lower() == wanted.lower()]


def freesurfer_labels(location: str, present: Collection[int]) -> dict[int, tuple[str, str]]:
    """Names and colours by FreeSurfer's numbers (and SynthSeg's); none for a map that has others.

    Examples
    --------
    >>> freesurfer_labels("aparc+aseg.mgz", [17, 999, 2035])
    {17: ('Left-Hippocampus', '#dcd814'), 2035: ('ctx-rh-insula', '#ffc020')}
    >>> freesurfer_labels("liver.nii.gz", [17])
    {}
    """
    is_named = re.search(r"aseg|aparc|wmparc|synthseg|\.mg[zh]$", location.lower())
    if not is_named and (len(present) < _FEWEST or not {*present} >= _WHITE_MATTER):
        return {}
    known: dict[int, tuple[str, str]] = {}
    for line in Path(__file__).with_name("freesurfer.txt").read_text(encoding="utf-8").splitlines()[1:]:
        number, name, *rgb = line.split()
        known[int(number)] = name, "#" + bytes(map(int, rgb)).hex()
    found = {number: known[number] for number in present if number in known}
    return found if is_named or len(found) == len(present) else {}


#: The hint where an image stands in a mask's place.
HOW_TO_GIVE_AN_IMAGE = (
    "give the organ's mask, and its image with --image (column image of a sheet); for an image alone "
    "cccd segment makes a mask, and --threshold LOW:HIGH takes a range of its grey values"
)

#: Grey images have more values than this; a map of fewer is noise where none of its labels hangs together.
_FEW_VALUES = 16
#: Masks and maps of less labels are not looked at as labels.
_LEAST_VALUES = 3
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
#: Of a mask of so many voxels, which fill this share of the volume (a sparser one is done at once), so many
#: of the voxels' neighbours are background, by the share that chance would give: in noise 1, in masks
#: mostly less than a half.
_LEAST_MASKED, _LEAST_FILLED, _MOST_SCATTERED = 1000, 0.05, 0.9
#: Grey values from 0 to 1 fill this share of the volume, are neither 0 nor 1 in this share of it, and turn
#: from rising to falling, by steps of 0.05 at least, at this share of their steps. Probabilities settle at 0
#: and 1 but for the organ's border, where they rise and fall: one of the three at least is a half of it.
_GREY_FILLED, _GREY_UNSETTLED, _GREY_TURNS, _TURNING_STEP = 0.1, 0.87, 0.08, 0.05
#: Crops of less voxels with a probability say nothing.
_LEAST_PROBABLE = 5000
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
    data : (a, b, c) array of whole numbers or bool
    location : str
        What messages name.

    Raises
    ------
    InputError
        Grey values, noise, or values below -1 (which some programs write for "not looked at").
    """
    if not data.size:
        return
    low, high = data.min(), data.max()
    if low < -1 or (high >= _LEAST_VALUES and _is_grey(data)):
        raise InputError(location, f"grey values, {low} to {high}, not labels", HOW_TO_GIVE_AN_IMAGE)
    if high > 0 and _is_noise(data > 0):
        raise InputError(location, "noise: its voxels are scattered at random", "give the organ's mask")


def refuse_grey_probabilities(data: AnyArray, location: str) -> None:
    """Refuse a grey image scaled to 0 to 1 in the place of probabilities.

    Parameters
    ----------
    data : (a, b, c) float array
        From 0 to 1.
    location : str
        What messages name.

    Raises
    ------
    InputError
        Nearly all values are fractions, all over the volume, and go up and down without order.
    """
    looked_at = data[:, :, _slices_looked_at(data.shape)]
    probable = looked_at > 0.1
    count = int(np.count_nonzero(probable))
    unsettled = int(np.count_nonzero(probable & (looked_at < 0.9)))
    if count < max(_LEAST_PROBABLE, _GREY_FILLED * looked_at.size) or unsettled < _GREY_UNSETTLED * count:
        return
    steps = turns = 0
    for axis in (0, 1):
        change = np.moveaxis(np.diff(looked_at, axis=axis), axis, 0)
        one, other = change[:-1], change[1:]
        steep = (np.abs(one) > _TURNING_STEP) & (np.abs(other) > _TURNING_STEP)
        steps += int(np.count_nonzero(steep))
        turns += int(np.count_nonzero(steep & (one * other < 0)))
    if turns >= max(_GREY_TURNS * steps, 1):
        low, high = data.min(), data.max()
        problem = f"grey values, {low:.3g} to {high:.3g}, not probabilities"
        raise InputError(location, problem, HOW_TO_GIVE_AN_IMAGE)


def _is_noise(mask: AnyArray) -> bool:
    """Whether a mask's voxels lie together as often as those of noise do."""
    at = _slices_looked_at(mask.shape)
    mask = mask[:, :, at]
    filled = float(mask.mean())
    if filled * mask.size < _LEAST_MASKED or not _LEAST_FILLED <= filled < 1:
        return False
    ends = borders = 0
    for one, other in _neighbours(mask, at):
        ends += int(np.count_nonzero(one)) + int(np.count_nonzero(other))
        borders += int(np.count_nonzero(one != other))
    return borders > _MOST_SCATTERED * (1 - filled) * ends


def _is_grey(data: AnyArray) -> bool:
    """Whether the values above 0 scatter, or follow each other as on a ramp."""
    at = _slices_looked_at(data.shape)
    values, ranks = distinct(data[:, :, at])
    below = int(np.count_nonzero(values <= 0))
    count = len(values) - below
    if count < _LEAST_VALUES:
        return False
    ranks = ranks.astype(np.int32) - below  # 0 is the first label's
    alike, neighbours = np.zeros(count, np.int64), np.zeros(count, np.int64)
    borders = in_order = 0
    for one, other in _neighbours(ranks, at):
        labelled = (one >= 0) & (other >= 0)
        one, other = one[labelled], other[labelled]
        same = one == other
        alike += 2 * np.bincount(one[same], minlength=count)
        neighbours += np.bincount(one, minlength=count) + np.bincount(other, minlength=count)
        borders += int(np.count_nonzero(~same))
        in_order += int(np.count_nonzero(np.abs(one - other)[~same] <= 2))
    known = neighbours >= _LEAST_NEIGHBOURS
    if np.count_nonzero(known) < _LEAST_VALUES:
        return False
    coherent = alike[known] >= _COHERENT * neighbours[known]
    if len(coherent) <= _FEW_VALUES:
        return not coherent.any()
    ramp = count >= _RAMP_VALUES and in_order >= max(_RAMP_BORDERS * borders, 1)
    return bool(coherent.mean() < _COHERENT_VALUES or ramp)


def _neighbours(data: AnyArray, at: AnyArray) -> Iterator[tuple[AnyArray, AnyArray]]:
    """Voxels and their next ones along each axis; ``at``: the slices, of which only neighbours are paired."""
    for axis, beside in enumerate((slice(None), slice(None), np.diff(at) == 1)):
        along = np.moveaxis(data, axis, 0)
        yield along[:-1][beside], along[1:][beside]


def _slices_looked_at(shape: tuple[int, ...]) -> AnyArray:
    """Return indices along the last axis, ascending: all, or pairs of neighbours spread over the volume."""
    a, b, c = shape
    pairs = max(1, _MOST_VOXELS // (2 * a * b))
    if 2 * pairs >= c:
        return np.arange(c)
    first = np.linspace(0, c - 2, pairs + 2)[1:-1].astype(int)
    return np.union1d(first, first + 1)
