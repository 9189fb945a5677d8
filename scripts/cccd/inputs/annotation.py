"""Which slices of a mask were drawn: a slice that nobody drew is not an empty slice."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from cccd.containers import Annotation, Frame, Guide, Structure
from cccd.errors import InputError
from cccd.geometry.arrays import BoolArray, IntArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import voxelise
from cccd.inputs.grid import crop

#: The rules by which a mask's slices count as drawn.
AUTO, EVERY_SLICE, NONEMPTY = RULES = ("auto", "every slice", "nonempty")
#: By itself, a mask is taken for one of which some slices were drawn when at least two empty ones lie between
#: any two of them; one alone may be an organ's thin part, or a slip of the hand.
LEAST_GAP = 3
#: It then also has so many drawn slices, and this share of neighbours overlaps: it is one organ, not many.
LEAST_SLICES, OVERLAPPING = 3, 0.5
#: A slice less of which than this lies in squares of 2 x 2 pixels holds lines: planes across it were drawn.
SOLID = 0.5
#: There are no such planes where fewer slices than this share hold lines: an organ's ends may be thin.
LINES = 1 / 3
#: Planes across the slices must account for this share of what such slices hold.
EXPLAINED = 0.9


def find_annotation(stack: BoolArray, origin: IntArray, rule: str, location: str) -> Annotation | None:
    """Find out which slices of a mask were drawn, and which planes across them.

    Parameters
    ----------
    stack : (S, I, J) bool
        A mask, slices first.
    origin : (3,) int
        Source index ``(k, i, j)`` of its first pixel.
    rule : {"auto", "every slice", "nonempty"}
        ``nonempty``: those that are not empty. ``auto``: the same, if the gaps between them are such that no
        organ would have them; see `LEAST_GAP`. ``every slice``: all; what is empty is empty.
    location : str
        What messages name.

    Returns
    -------
    Annotation or None
        None where every slice counts.

    Raises
    ------
    InputError
        ``nonempty``, and there are fewer than three drawn slices.

    Examples
    --------
    >>> import numpy as np
    >>> stack = np.zeros((20, 9, 9), bool)
    >>> stack[[2, 6, 13], 2:7, 2:7] = True
    >>> find_annotation(stack, np.zeros(3, int), "auto", "mask").slices
    array([ 2,  6, 13])
    """
    if rule == EVERY_SLICE:
        return None
    slices, across = drawn_slices(stack)
    if len(slices) < LEAST_SLICES:
        if rule == AUTO:
            return None
        count = f"it is annotated on {len(slices)} slice{'s'[: len(slices) > 1]}"
        raise InputError(location, count, f"annotate at least {LEAST_SLICES} slices along the slice axis")
    gaps = np.diff(slices)
    if gaps.max() == 1 or (rule == AUTO and not _is_sparse(stack[slices], gaps)):
        return None
    guides = tuple(
        Guide(
            axis,
            position + int(origin[1 + axis]),
            np.moveaxis(stack, 1 + axis, 0)[position],
            origin[[0, 2 - axis]],
        )
        for axis, position in across
    )
    return Annotation(slices + int(origin[0]), guides)


def drawn_slices(stack: BoolArray) -> tuple[IntArray, list[tuple[int, int]]]:
    """Tell the slices of a stack (S, I, J) that were drawn from those that planes across them only cross.

    Such a slice holds lines; planes are found where lines of neighbouring slices make an area. Without planes
    that account for the lines, all slices that are not empty are drawn.

    Returns
    -------
    slices : (D,) int
        Ascending.
    planes : list of (int, int)
        Axis of each plane across them, 0 for i and 1 for j, and its position.
    """
    filled: BoolArray = np.any(stack, axis=(1, 2))
    pixels = np.count_nonzero(stack, axis=(1, 2))
    squares = np.array([np.count_nonzero(_in_squares(plane[None])) for plane in stack])
    lines = filled & (squares < SOLID * pixels)
    if not filled.sum() * LINES <= lines.sum() < filled.sum():
        return np.flatnonzero(filled), []
    rest = stack & lines[:, None, None]
    explained = np.zeros_like(rest)
    planes: list[tuple[int, int]] = []
    for axis in (0, 1):
        across = np.moveaxis(rest, 1 + axis, 0)
        squares = _in_squares(np.moveaxis(stack, 1 + axis, 0))
        solid = np.count_nonzero(squares & across, axis=(1, 2))
        drawn = np.flatnonzero(solid > SOLID * np.count_nonzero(across, axis=(1, 2)))
        np.moveaxis(explained, 1 + axis, 0)[drawn] = across[drawn]
        planes += [(axis, int(position)) for position in drawn]
    if np.count_nonzero(explained) < EXPLAINED * np.count_nonzero(rest):
        return np.flatnonzero(filled), []
    return np.flatnonzero(filled & ~lines), planes


def _in_squares(planes: BoolArray) -> BoolArray:
    """Pixels of planes (P, A, B) that lie in a full square of 2 x 2 of them."""
    corner = planes[:, :-1, :-1] & planes[:, 1:, :-1] & planes[:, :-1, 1:] & planes[:, 1:, 1:]
    covered = np.zeros_like(planes)
    for a in (slice(None, -1), slice(1, None)):
        for b in (slice(None, -1), slice(1, None)):
            covered[:, a, b] |= corner
    return covered


def _is_sparse(drawn: BoolArray, gaps: IntArray) -> bool:
    """Whether drawn slices (D, I, J), so far apart (D - 1,), are some of an organ's and not all."""
    overlapping = (drawn[1:] & drawn[:-1]).any(axis=(1, 2))
    return bool(gaps.min() >= LEAST_GAP and overlapping.mean() >= OVERLAPPING)


def annotation_note(annotation: Annotation, frame: Frame, rule: str) -> str:
    """Say how a mask was understood."""
    gaps = np.diff(annotation.slices)
    apart = f"{gaps.min()}" if gaps.min() == gaps.max() else f"{gaps.min()} to {gaps.max()}"
    count = f"{len(annotation.slices)} of {annotation.slices[-1] - annotation.slices[0] + 1} slices"
    text = f"annotated on {count}, {apart} apart"
    if annotation.guides:
        text += f", and on {_planes(annotation.guides, frame)} across them"
    text += ": the slices between are filled"
    return text + ("; if they are empty, set annotated: every slice" if rule == AUTO else "")


def _planes(guides: Iterable[Guide], frame: Frame) -> str:
    """Count planes by the axis that they are square to."""
    axes = [frame.in_plane_axes[guide.axis] for guide in guides]
    parts = [f"{axes.count(axis)} perpendicular to axis {axis}" for axis in sorted(set(axes))]
    return " and ".join(parts)


def fill_mask(structure: Structure, mesh: Mesh, whole: bool = False) -> BoolArray:
    """Voxels inside a closed mesh; slices that were drawn are as they were drawn.

    Parameters
    ----------
    structure : Structure
        With an annotation.
    mesh : Mesh
        mm RAS.
    whole : bool
        On the grid of the source volume instead of the structure's crop.
    """
    frame, mask, annotation = structure.frame, structure.mask, structure.annotation
    shape, origin = frame.shape, np.zeros(3, np.int64)
    if mask is not None and not whole:
        shape, origin = mask.shape, structure.origin
    filled = voxelise(mesh, frame.affine, shape, origin)
    if mask is not None and annotation is not None:
        first: IntArray = origin - structure.origin
        drawn = crop(mask, first, np.add(first, filled.shape) - 1)
        planes, at = np.moveaxis(filled, frame.slice_axis, 0), annotation.slices - origin[frame.slice_axis]
        planes[at] = np.moveaxis(drawn, frame.slice_axis, 0)[at]
    return filled
