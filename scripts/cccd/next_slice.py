"""The slice that would shrink the band most if it was drawn."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cccd.bands.scale import shipped_scale
from cccd.bands.signs import Signs, Slices
from cccd.containers import Annotation, Frame, Sections, Structure
from cccd.curves import describe_curves
from cccd.errors import InputError
from cccd.reconstruction import find_contours
from cccd.settings.root import Settings
from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_in_plane
from cccd.surface.spline import SplineSolid
from cccd.surface.target import TargetField

__all__ = ["Gain", "rank_slices", "rank_unannotated"]

#: At most this many slices of a gap are tried.
TRIED = 5


class Gain(NamedTuple):
    """A slice, from 0 along the slice axis, and the share by which the band shrinks if it is annotated."""

    slice: int
    shrinks: float


def rank_slices(structure: Structure, settings: Settings) -> list[Gain]:
    """Rank the slices that were not drawn by how much each would shrink the error band.

    A slice is taken to be drawn as the present surface runs there: then the band is estimated anew. Slices up
    to the median gap beyond the first and last one count as well.

    Parameters
    ----------
    structure : Structure
        Of which some slices were drawn.
    settings : Settings

    Returns
    -------
    list of Gain
        The best first; at most `TRIED` slices of each gap.

    Raises
    ------
    InputError
        Every slice was drawn.
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
    slices, area, z = solid.stack.slices, solid.mesh.vertex_areas, solid.mesh.vertices[:, 2]
    ends = np.concatenate([[slices.z[0] - slices.step], slices.z, [slices.z[-1] + slices.step]])
    before = _width(solid, slices)
    gains: list[Gain] = []
    for k in _candidates(annotation, frame):
        height = k * frame.slice_spacing
        above = int(np.searchsorted(ends, height))
        # elsewhere the means over the organ change a little: that is no gain
        gap = (z > ends[above - 1]) & (z < ends[above])
        narrower = before - _width(solid, _with_slice(solid, height))
        gains.append(Gain(k, float(area[gap] @ narrower[gap] / (area @ before))))
    return sorted(gains, key=lambda gain: -gain.shrinks)


def _width(solid: SplineSolid, slices: Slices) -> np.ndarray:
    signs, scale = Signs.of(solid.mesh, slices), shipped_scale()
    return scale(signs.outer) + scale(signs.inner)


def _candidates(annotation: Annotation, frame: Frame) -> Sequence[int]:
    """Slices to try: in each gap, and as far beyond the ends as the median gap."""
    drawn = annotation.slices
    step, count = int(np.median(np.diff(drawn))), frame.shape[frame.slice_axis]
    ends = [max(int(drawn[0]) - step, -1), *map(int, drawn), min(int(drawn[-1]) + step, count)]
    tried: list[int] = []
    for low, high in itertools.pairwise(ends):
        between = np.arange(low + 1, high)
        if len(between) > TRIED:
            places = np.linspace(0, len(between) - 1, TRIED + 2).round().astype(int)
            between = between[np.unique(places)[1:-1]]
        tried += between.tolist()
    return tried


def _with_slice(solid: SplineSolid, z: float) -> Slices:
    """Slices with one more, as the surface runs at a height in mm."""
    slices, target = solid.stack.slices, solid.stack.target
    levels = target if isinstance(target, TargetField) else target.outlines
    n = int(np.clip(np.searchsorted(levels.z, z, side="right") - 1, 0, len(levels.z) - 2))
    share = np.float32(np.clip((z - levels.z[n]) / (levels.z[n + 1] - levels.z[n]), 0, 1))
    plane = (1 - share) * levels.planes[n] + share * levels.planes[n + 1]
    return slices.with_slice(z, plane.astype(np.float32))
