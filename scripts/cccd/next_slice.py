"""The slice that would lower the error most if it was drawn."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cccd.bands.signs import SIGNS, Signs, Slices
from cccd.containers import Frame, Sections, Structure
from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray, IntArray, SingleArray
from cccd.reconstruction import find_contours
from cccd.settings.root import Settings
from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_in_plane
from cccd.surface.spline import SplineSolid

__all__ = ["Gain", "rank_slices", "rank_unannotated"]

#: What a slice beyond the last of evenly spaced ones is worth. The organ ends somewhere before the next of
#: them, or that would have been drawn, so the slice half way is empty as often as not.
BEYOND_EVEN = 0.5
#: Signs of a vertex that grow with the error beside it.
USED = ("linear", "slope")
#: Slices that their neighbours foretell exactly still surprise by this share of the mean.
LEAST_SURPRISE = 0.03
#: What is divided by is at least this.
TINY = 1e-12


class Gain(NamedTuple):
    """A slice, from 0 along the slice axis, and the share of the error that is expected to go with it."""

    slice: int
    lowers: float


def rank_slices(structure: Structure, settings: Settings) -> list[Gain]:
    """Rank the gaps between drawn slices by how much a slice in the middle is expected to lower the error.

    Parameters
    ----------
    structure : Structure
        Of which some slices were drawn.
    settings : Settings

    Returns
    -------
    list of Gain
        The best first: one slice of each gap, and one beyond either end.

    Raises
    ------
    InputError
        Every slice was drawn.

    Notes
    -----
    The error in a gap is estimated by the geometric mean of three figures: how far the surface lies off the
    linear interpolation of distances and how far the slices lie apart along its normal, both integrated over
    the gap; and the area by which the slices beside it differ from what their neighbours interpolate without
    them.

    Errors between slices grow with the square of their distance. A slice at a share :math:`t` of a gap leaves
    parts of :math:`t` and :math:`1 - t`, so :math:`3 t (1 - t)` of the gap's error is gone: most in the
    middle. Beyond either end the gap is the median one. There the gain counts half (`BEYOND_EVEN`) if no gap
    is wider than the median one.
    """
    if structure.annotation is None:
        problem = "no slice is left to draw: every slice counts as annotated"
        raise InputError(structure.organ, problem, "give a mask of some slices, or --annotated nonempty")
    curves = find_contours(structure, settings.boundaries, settings.gnn.inference)
    return rank_unannotated(structure.sections(curves), settings.surface)


def rank_unannotated(sections: Sections, settings: LoftSettings) -> list[Gain]:
    """Rank slices as `rank_slices` does, of curves that are found already; none where all are annotated."""
    annotation, frame = sections.annotation, sections.curves.frame
    if annotation is None:
        return []
    drawn, gains = annotation.slices, list[Gain]()
    gaps = _gaps(drawn, frame)
    errors = _errors(loft_in_plane(sections, settings), np.array(gaps) * frame.slice_spacing)
    beyond = BEYOND_EVEN if np.diff(drawn).max() <= _usual(drawn) else 1.0
    for (low, high), error in zip(gaps, errors, strict=True):
        middle = (low + high) // 2
        share = (middle - low) / (high - low)
        worth = 1.0 if drawn[0] < middle < drawn[-1] else beyond
        gains.append(Gain(middle, worth * 3 * share * (1 - share) * float(error)))
    return sorted(gains, key=lambda gain: -gain.lowers)


def _errors(solid: SplineSolid, gaps: FloatArray) -> FloatArray:
    """Each gap's share (G,) of the error between the slices; gaps (G, 2) from height to height in mm."""
    mesh, slices = solid.mesh, solid.stack.slices
    order = np.argsort(mesh.vertices[:, 2])
    signs = Signs.of(mesh, slices).outer[:, [SIGNS.index(name) for name in USED]]
    below = np.cumsum((mesh.vertex_areas[:, None] * np.exp(signs))[order], axis=0)
    ends = np.searchsorted(mesh.vertices[order, 2], gaps)
    linear, slope = np.diff(np.vstack([np.zeros(2), below])[ends], axis=1)[:, 0].T
    surprise = np.interp(gaps, *_surprise(slices)).mean(axis=1) * np.diff(gaps)[:, 0] ** 2
    errors = np.cbrt(linear * slope * surprise)
    return errors / max(errors.sum(), TINY)


def _surprise(slices: Slices) -> tuple[FloatArray, FloatArray]:
    """Heights of the inner slices, and how far their neighbours are from foretelling each without it.

    An area by the product of the distances to the neighbours, on the mean one; at least `LEAST_SURPRISE`.
    """
    z, distance = slices.z, slices.distance
    if len(z) < 3:
        return z[:1], np.ones(1)
    found = np.empty(len(z) - 2)
    for n in range(1, len(z) - 1):
        share = np.float32((z[n] - z[n - 1]) / (z[n + 1] - z[n - 1]))
        plane = (1 - share) * distance[n - 1] + share * distance[n + 1]
        apart = np.abs(_inside(plane, slices.pixel) - _inside(distance[n], slices.pixel)).sum()
        found[n - 1] = apart / ((z[n] - z[n - 1]) * (z[n + 1] - z[n]))
    return z[1:-1], found / max(found.mean(), TINY) + LEAST_SURPRISE


def _inside(distance: SingleArray, pixel: float) -> SingleArray:
    """Share of each pixel that lies inside."""
    return np.clip(0.5 - distance / np.float32(pixel), 0, 1)


def _usual(drawn: IntArray) -> int:
    return int(np.median(np.diff(drawn)))


def _gaps(drawn: IntArray, frame: Frame) -> Sequence[tuple[int, int]]:
    """Neighbouring drawn slices with others between them, and as much beyond both ends."""
    step, count = _usual(drawn), frame.shape[frame.slice_axis]
    ends = [max(int(drawn[0]) - step, -1), *map(int, drawn), min(int(drawn[-1]) + step, count)]
    return [(low, high) for low, high in itertools.pairwise(ends) if high - low > 1]
