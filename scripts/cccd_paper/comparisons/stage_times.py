"""From an image to its surface by every method of Table 5, each stage timed alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pandas as pd

from cccd.containers import Curves, Frame, Sections, Splines, Structure
from cccd.contours import trace_contours
from cccd.curves.corners import k_cosine_corners
from cccd.curves.fitting import corner_splines
from cccd.geometry.polygons import RaggedPolygons
from cccd.settings.junctions import BoundarySettings
from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_surface
from cccd_junctions.boundary import extract_boundaries
from cccd_paper.comparisons.baselines.corner_detectors import CORNER_DETECTORS
from cccd_paper.comparisons.baselines.reconstructions import RECONSTRUCTIONS, reconstruct
from cccd_paper.comparisons.fuse import near_boundary, order_by_links
from cccd_paper.comparisons.orderers import Orderer
from cccd_paper.comparisons.paper_k import CCCD
from cccd_paper.comparisons.parameters import PAPER_TABLE_2
from cccd_paper.comparisons.samples import SliceSample, choose_slices, middle_slab, outer_curves
from cccd_paper.comparisons.timing import timed
from cccd_workflow.surface_measures import voxel_dice

#: CCCD's k here: the one with which the paper's scores are best.
K = 3
STAGES = ("corner", "curve", "spline", "surface")
#: Slices of the slab: bad curves make bad surfaces, which take longest.
MOST_SLICES = 6


@dataclass(frozen=True)
class PlanarMethod:
    """A corner detector, and the reconstruction that links its corners."""

    detector: str
    reconstruction: str

    @property
    def title(self) -> str:
        """Name in the table."""
        names = CORNER_DETECTORS[self.detector].title, RECONSTRUCTIONS[self.reconstruction].title
        return ", ".join(names)


#: The paper's detectors, ordered by a short tour, and its reconstructions of Harris corners.
WAYS = (
    PlanarMethod("harris", "tour"),
    PlanarMethod("shi_tomasi", "tour"),
    PlanarMethod("fast", "tour"),
    PlanarMethod("harris", "connect2d"),
    PlanarMethod("harris", "crawl"),
    PlanarMethod("harris", "nn_crust"),
)


def time_stages(
    structure: Structure,
    curves: Curves,
    finding: BoundarySettings,
    lofting: LoftSettings,
    orderers: Sequence[Orderer] = (),
    most_slices: int = MOST_SLICES,
) -> pd.DataFrame:
    """Take a slab of slices from its images to a surface by every method, and time each stage.

    Of each slice the longest outer curve is taken, filled: an image that every detector can work on. Every
    method's splines run through boundary pixels, and are lofted as they are: no surface is moved to the
    pixels' outer border, half a pixel further out, and Dice lacks that half pixel for all alike.

    Parameters
    ----------
    structure : Structure
        With a mask; without one the table is empty.
    curves : Curves
        Its ordered curves.
    finding : BoundarySettings
        Of CCCD's boundary pixels.
    lofting : LoftSettings
    orderers : sequence of Orderer
        The run's network, by which CCCD orders the pixels; without one the mask is traced.
    most_slices : int
        Of an organ with more, a slab of this many adjacent ones is taken.

    Returns
    -------
    DataFrame
        One row per method: ``slices``; processor time per slice in ms to find the corners (``corner_ms``),
        to link them into a curve (``curve_ms``) and to fit the spline (``spline_ms``), and for the surface
        of all of them (``surface_ms``, per slice too); their sum ``total_ms``; ``closed_share``, the share of
        slices with one closed simple curve, the others having no spline; ``dice_3d`` of the surface. A
        curve is what CCCD has first: its ``curve_ms`` has the boundary pixels and their order.
    """
    if structure.mask is None or not len(curves):
        return pd.DataFrame()
    slab, samples = _filled_slab(structure, curves, most_slices)
    _, few, _ = middle_slab(structure, curves, 3)
    loft_surface(Sections(few), lofting)  # compiled before it is timed
    made = {way.title: _linked_corners(way, samples, slab.frame) for way in WAYS}
    made[CCCD] = _ordered_pixels(slab, finding, orderers)
    return pd.DataFrame(
        [_timed(method, planar, slab, len(samples), lofting) for method, planar in made.items()]
    )


def _filled_slab(
    structure: Structure, curves: Curves, most_slices: int
) -> tuple[Structure, list[SliceSample]]:
    """Cut the slab, with the longest curve of each slice filled for its mask, and each slice's sample."""
    slab, inside, _ = middle_slab(structure, curves, most_slices)
    samples = choose_slices(slab, inside, most_slices, 0.0)
    slices = np.array([sample.k for sample in samples])
    longest = _curves([sample.curve for sample in samples], slices, slab.frame)
    mask = longest.rasterise(slab.stack_origin, slab.required_stack("mask").shape)
    filled = replace(slab, mask=np.moveaxis(mask, 0, slab.frame.slice_axis))
    return filled, choose_slices(filled, longest, most_slices, 0.0)


def _curves(polygons: Sequence[np.ndarray], slices: np.ndarray, frame: Frame) -> Curves:
    """Outer curves of polygons (n, 2), turned counter-clockwise."""
    ragged = RaggedPolygons.of(polygons)
    turned = [p[::-1] if area < 0 else p for p, area in zip(polygons, ragged.signed_areas, strict=True)]
    return outer_curves(turned, slices, frame)


class _Planar(NamedTuple):
    """What a method makes of the slices, and the processor seconds of its stages."""

    curves: Curves
    splines: Splines | None
    seconds: dict[str, float]


def _linked_corners(way: PlanarMethod, samples: Sequence[SliceSample], frame: Frame) -> _Planar:
    """Corners of the slices' masks, those on the boundary linked where that gives a closed simple curve."""
    detect = CORNER_DETECTORS[way.detector].run
    parameters = PAPER_TABLE_2[way.detector]

    def corners(sample: SliceSample) -> np.ndarray:
        found = detect(sample.images["mask"], **parameters) + sample.origin
        return found[near_boundary(found, sample.curve)].astype(float)

    corners(samples[0])  # compiled before anything is timed
    reconstruct(way.reconstruction, samples[0].curve[::8])
    found, corner_s = timed(lambda: [corners(sample) for sample in samples])
    polygons, curve_s = timed(lambda: [_in_order(points, way.reconstruction) for points in found])
    simple = [len(points) >= 3 and bool(RaggedPolygons.of([points]).is_simple[0]) for points in polygons]
    kept = [points for points, fit in zip(polygons, simple, strict=True) if fit]
    curves = _curves(kept, np.array([sample.k for sample in samples])[simple], frame)
    seconds = {"corner": corner_s, "curve": curve_s}
    if not kept:
        return _Planar(curves, None, seconds)
    everywhere = np.ones(len(curves.points), bool)
    splines, seconds["spline"] = timed(corner_splines, curves, everywhere)
    return _Planar(splines.sample(), splines, seconds)


def _in_order(points: np.ndarray, reconstruction: str) -> np.ndarray:
    """Return the points (n, 2) along their one closed curve; none where the links are no such curve."""
    points = np.unique(points, axis=0)
    try:
        return points[order_by_links(points, lambda corners: reconstruct(reconstruction, corners))]
    except ValueError:
        return np.zeros((0, 2))


def _ordered_pixels(slab: Structure, finding: BoundarySettings, orderers: Sequence[Orderer]) -> _Planar:
    """CCCD: boundary pixels ordered, corners on their chain, splines with the corners as control points."""

    def order() -> Curves:
        return orderers[0](extract_boundaries(slab, finding)) if orderers else trace_contours(slab)

    order()  # compiled before anything is timed
    curves, curve_s = timed(order)
    corners, corner_s = timed(k_cosine_corners, curves.points, curves.offsets, K)
    splines, spline_s = timed(corner_splines, curves, corners)
    seconds = {"corner": corner_s, "curve": curve_s, "spline": spline_s}
    return _Planar(splines.sample(), splines, seconds)  # as drawn curves: no half pixel is added


def _timed(method: str, planar: _Planar, slab: Structure, n_slices: int, lofting: LoftSettings) -> dict:
    """Loft what a method left of the slices, and put its stages into a row."""
    slices = len(np.unique(planar.curves.slice))
    seconds, score = dict(planar.seconds), np.nan
    if slices > 1:
        surface, seconds["surface"] = timed(loft_surface, Sections(planar.curves), lofting)
        if len(surface.mesh.faces):
            score = voxel_dice(surface.mesh, slab)
    stages = {f"{stage}_ms": 1e3 * seconds.get(stage, np.nan) / n_slices for stage in STAGES}
    total = sum(stages.values())  # missing where a stage is
    return {"method": method, "slices": n_slices, **stages, "total_ms": total,
            "closed_share": slices / n_slices, "dice_3d": score}  # fmt: skip
