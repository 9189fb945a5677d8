"""The slice that would shrink the band most if it was drawn."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cccd.bands.scale import shipped_scale
from cccd.bands.signs import Signs
from cccd.containers import Frame, Sections, Structure
from cccd.curves import describe_curves
from cccd.errors import InputError
from cccd.geometry.arrays import IntArray
from cccd.reconstruction import find_contours
from cccd.settings.root import Settings
from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_in_plane

__all__ = ["Gain", "rank_slices", "rank_unannotated"]

#: What a slice beyond the last of evenly spaced ones is worth. The organ ends somewhere before the next of
#: them, or that would have been drawn, so the slice half way is empty as often as not.
BEYOND_EVEN = 0.5


class Gain(NamedTuple):
    """A slice, from 0 along the slice axis, and the share by which the band shrinks if it is annotated."""

    slice: int
    shrinks: float


def rank_slices(structure: Structure, settings: Settings) -> list[Gain]:
    """Rank the gaps between drawn slices by how much a slice in the middle would shrink the error band.

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
    Errors between slices grow with the square of their distance. A slice at a share :math:`t` of a gap leaves
    parts of :math:`t` and :math:`1 - t`, so :math:`3 t (1 - t)` of the gap's band, integrated over the
    surface, is gone: most in the middle. Beyond either end the gap is the median one. There the gain counts
    half (`BEYOND_EVEN`) if no gap is wider than the median one.
    """
    if structure.annotation is None:
        problem = "no slice is left to draw: every slice counts as annotated"
        raise InputError(structure.organ, problem, "give a mask of some slices, or --annotated nonempty")
    curves, _ = find_contours(structure, settings.boundaries, settings.gnn.inference)
    fitted = describe_curves(curves, settings.curves)
    sections = Sections(fitted.curves, fitted.splines, annotation=structure.annotation)
    return rank_unannotated(sections, settings.surface)


def rank_unannotated(sections: Sections, settings: LoftSettings) -> list[Gain]:
    """Rank slices as `rank_slices` does, of curves that are found already; none where all are annotated."""
    annotation, frame = sections.annotation, sections.curves.frame
    if annotation is None:
        return []
    solid = loft_in_plane(sections, settings)
    signs, scale = Signs.of(solid.mesh, solid.stack.slices), shipped_scale()
    band = solid.mesh.vertex_areas * (scale(signs.outer) + scale(signs.inner))
    at = solid.mesh.vertices[:, 2] / frame.slice_spacing
    drawn, gains = annotation.slices, list[Gain]()
    beyond = BEYOND_EVEN if np.diff(drawn).max() <= _usual(drawn) else 1.0
    for low, high in _gaps(drawn, frame):
        middle = (low + high) // 2
        share = (middle - low) / (high - low)
        within = float(band[(at > low) & (at < high)].sum() / band.sum())
        worth = 1.0 if drawn[0] < middle < drawn[-1] else beyond
        gains.append(Gain(middle, worth * 3 * share * (1 - share) * within))
    return sorted(gains, key=lambda gain: -gain.shrinks)


def _usual(drawn: IntArray) -> int:
    return int(np.median(np.diff(drawn)))


def _gaps(drawn: IntArray, frame: Frame) -> Sequence[tuple[int, int]]:
    """Neighbouring drawn slices with others between them, and as much beyond both ends."""
    step, count = _usual(drawn), frame.shape[frame.slice_axis]
    ends = [max(int(drawn[0]) - step, -1), *map(int, drawn), min(int(drawn[-1]) + step, count)]
    return [(low, high) for low, high in itertools.pairwise(ends) if high - low > 1]
