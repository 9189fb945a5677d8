"""Structures whose boundary pixels had to be ordered: their surfaces, and what was decided on the way."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import cv2
import numpy as np
import pandas as pd
from scipy import ndimage

from cccd.containers import Boundaries, Curves, Sections, Structure
from cccd.contours import trace_stack
from cccd.geometry.arrays import BoolArray, IntArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import dice
from cccd.settings.surface import LoftSettings
from cccd.surface.surface import LoftedSurface
from cccd_junctions.ordering import count_changes
from cccd_paper.comparisons.baselines.decoders import DECODERS
from cccd_paper.comparisons.decoders import decode
from cccd_paper.comparisons.lofted_distances import filtered_mesh
from cccd_paper.comparisons.ordering_comparison import decided_slices
from cccd_paper.comparisons.samples import between, outer_curves
from cccd_paper.junctions.grid import build_grid
from cccd_segmentation.seeds import parse_seeds
from cccd_viewers.page_files import Panel, SliceFigure
from cccd_workflow.surface_measures import Reference, measure_mesh

#: The run's own ordering, and no ordering: the region in which edges were sought, found by a threshold or
#: grown from a seed, and the threshold that is best of many.
NETWORK, FOUND, GROWN, THRESHOLD = (
    "network",
    "region by threshold, traced",
    "region from the seed, traced",
    "best threshold, traced",
)

# Before the name of the classical decoder that is best on the structure.
_BEST = "best classical decoder: "

#: Thresholds that are tried: blurs and radii of openings in pixels, and the quantiles of the organ's own grey
#: values at which windows begin and end.
_BLURS_PX, _OPENINGS_PX = (0.0, 1.0), (0, 1, 2, 3, 4, 6)
_FIRST, _LAST = (0.01, 0.05, 0.1, 0.2), (0.9, 0.97, 0.995, 1.0)
#: All are tried on every second pixel, and so many of the best on every pixel.
_STEP, _TRIED_IN_FULL = 2, 8

#: Figures of a surface that the table has, where there is something to measure against.
_FIGURES = (
    "dice_3d", "assd_mm", "hd95_mm", "volume_bias", "closed_manifold", "genus", "genus_true",
)  # fmt: skip

#: The picture shows so many slices.
_SHOWN = 4


def compare_map_surfaces(
    structure: Structure,
    boundaries: Boundaries,
    contours: Curves,
    surface: LoftedSurface,
    lofting: LoftSettings,
) -> pd.DataFrame:
    """Measure the surface beside the one that the map's pixels give in a classical decoder's order.

    The network reads more than these pixels: the image, where there is one, and the neighbouring slices.

    Parameters
    ----------
    structure : Structure
        Its mask and its true surface are what the surfaces are measured against, and read for nothing else.
    boundaries : Boundaries
        Its boundary pixels.
    contours : Curves
        The network's curves.
    surface : LoftedSurface
        The one lofted from these.
    lofting : LoftSettings
        As the structure's own surface was made. The others are filtered alike and have no spline.

    Returns
    -------
    DataFrame
        One row per way: the network, the classical decoder and, of an image, the region in which edges were
        sought and the threshold, both traced. Decoder and threshold are those of the largest Dice, so they
        know the mask. ``slices`` with boundary pixels, ``decided`` (those whose map is no outline already)
        and ``without_curve``; ``pixels`` of the maps and how many are ``kept`` and ``dropped``, and pixels
        that were ``bridged``; ``curves``; Dice, ASSD and 95 % Hausdorff distance in mm, and volume bias. Of
        the traced region what concerns the maps is missing.
    """
    reference = None if structure.mask is None else Reference.of(structure)

    def measured(mesh: Mesh) -> dict[str, object]:
        figures = measure_mesh(mesh, structure, reference=reference)
        return {name: figures[name] for name in _FIGURES if name in figures}

    def lofted(curves: Curves) -> dict[str, object]:
        if not len(curves):
            return {}
        return measured(filtered_mesh(Sections(curves), lofting))

    name, decoded = best_decoded(structure, boundaries)
    decided = len(decided_slices(boundaries))
    rows = [
        {"method": method, "decided": decided, **_counts(boundaries, curves), **figures}
        for method, curves, figures in (
            (NETWORK, contours, measured(surface.mesh)),
            (f"{_BEST}{name}", decoded, lofted(decoded)),
        )
    ]
    if structure.region is not None:
        seeded = "seed" in structure.provenance.get("region", {})
        found = {GROWN if seeded else FOUND: structure.required_stack("region")}
        if structure.mask is not None and structure.image is not None:
            found[THRESHOLD] = best_threshold(structure)
        for method, region in found.items():
            traced = trace_stack(region, structure.stack_origin, structure.frame)
            rows.append({"method": method, "curves": len(traced), **lofted(traced)})
    return pd.DataFrame(rows)


def _counts(boundaries: Boundaries, curves: Curves) -> dict[str, int]:
    """Count slices, pixels and curves of one decoder's result."""
    return {
        "slices": len(boundaries),
        "without_curve": len(np.setdiff1d(boundaries.slice, curves.slice)),
        "pixels": len(boundaries.points),
        **count_changes(boundaries, curves),
        "curves": len(curves),
    }


def best_decoded(structure: Structure, boundaries: Boundaries) -> tuple[str, Curves]:
    """Order every slice's pixels by the classical decoder that is nearest to the mask: its name, its curves.

    Each finds one outer curve on a slice, or none. Without a mask, the first of them.
    """
    truth = structure.stack("mask")
    if truth is None:
        name = next(iter(DECODERS))
        return name, _decoded_curves(boundaries, name)
    made = {name: _decoded_curves(boundaries, name) for name in DECODERS}
    near = {
        name: float(dice(truth, curves.rasterise(structure.stack_origin, truth.shape)))
        for name, curves in made.items()
    }
    best = max(near, key=lambda name: near[name])
    return best, made[best]


def _decoded_curves(boundaries: Boundaries, name: str) -> Curves:
    run: Callable[..., np.ndarray] = DECODERS[name].run
    chains = [decode(run, pixels, pixels.mean(axis=0)) for pixels in boundaries]
    found = [n for n, chain in enumerate(chains) if len(chain)]
    return outer_curves([chains[n] for n in found], boundaries.slice[found], boundaries.frame)


def best_threshold(structure: Structure) -> BoolArray:
    """Find the mask (S, I, J) of the window of grey values that is nearest to a structure's own.

    After a blur and an opening of the slices, or none, the component that a seed lies in, or the largest; its
    holes filled. All of these are chosen by the largest Dice, as nobody could without the mask.
    """
    image, truth = structure.required_stack("image"), structure.required_stack("mask")
    seeds = _seeds_in_stack(structure)
    blurred = {blur: ndimage.gaussian_filter(image, (0, blur, blur)) for blur in _BLURS_PX}
    windows = {
        blur: [*np.quantile(grey[truth], (*_FIRST, *_LAST[:-1])), np.inf] for blur, grey in blurred.items()
    }

    def found(option: tuple[float, int, int, int], step: int) -> BoolArray:
        blur, first, last, radius = option
        grey, bounds = blurred[blur][:, ::step, ::step], windows[blur]
        inside = (grey >= bounds[first]) & (grey <= bounds[len(_FIRST) + last])
        return _component(inside, radius / step, seeds // (1, step, step))

    def score(option: tuple[float, int, int, int], step: int) -> float:
        return float(dice(found(option, step), truth[:, ::step, ::step]))

    options = product(_BLURS_PX, range(len(_FIRST)), range(len(_LAST)), _OPENINGS_PX)
    likely = sorted(options, key=lambda option: -score(option, _STEP))[:_TRIED_IN_FULL]
    return found(max(likely, key=lambda option: score(option, 1)), 1)


def _seeds_in_stack(structure: Structure) -> IntArray:
    """Middles (n, 3) of the seeds that a structure's region was grown from, as indices (s, i, j)."""
    named = structure.provenance.get("region", {}).get("seed", [])
    seeds = [seed for text in named for seed in parse_seeds(text, structure.organ)]
    if not seeds:
        return np.zeros((0, 3), np.int64)
    middles = np.array([np.add(seed.first, seed.end) // 2 for seed in seeds])
    axis = structure.frame.slice_axis
    return middles[:, [axis, *structure.frame.in_plane_axes]] - structure.stack_origin


def _component(inside: BoolArray, opening_px: float, seeds: IntArray) -> BoolArray:
    """Components (S, I, J) nearest to seeds (n, 3), or the largest, of what is left by an opening; filled."""
    if opening_px >= 0.5:
        reach = int(np.ceil(opening_px))
        disc = (np.hypot(*np.mgrid[-reach : reach + 1, -reach : reach + 1]) <= opening_px + 0.5).astype(
            np.uint8
        )
        inside = (
            np.stack([cv2.morphologyEx(part, cv2.MORPH_OPEN, disc) for part in inside.astype(np.uint8)]) > 0
        )
    labels, count = ndimage.label(inside)
    if not count:
        return inside
    chosen = [1 + int(np.bincount(labels.ravel())[1:].argmax())]
    if len(seeds):
        there = np.argwhere(inside)
        nearest = [((there - seed) ** 2).sum(axis=1).argmin() for seed in seeds]
        chosen = [int(label) for label in labels[tuple(there[nearest].T)]]
    found = np.isin(labels, chosen)
    outside, _ = ndimage.label(np.pad(~found, 1, constant_values=True))
    return (outside != outside[0, 0, 0])[1:-1, 1:-1, 1:-1]


def map_links(pixels: np.ndarray, curves: Curves) -> dict[str, np.ndarray]:
    """Sort the links of one slice: those between neighbouring pixels of the map, and those of its curves.

    Parameters
    ----------
    pixels : (N, 2) int array
        The slice's boundary map.
    curves : Curves
        Of this slice alone; pixel chains.

    Returns
    -------
    dict of str to (M, 2, 2) arrays
        ``kept``: links of the map that a curve runs along; ``dropped``: those that none does; ``bridged``:
        links of curves that are not the map's.
    """
    grid = build_grid(pixels)
    given = _link_set(grid.pixels[grid.candidates])
    chain = np.rint(curves.points).astype(np.int64)
    drawn = _link_set(np.stack([chain, chain[curves.polygons.successors]], axis=1))
    sorts = {"dropped": given - drawn, "kept": given & drawn, "bridged": drawn - given}
    return {name: np.array(sorted(links), float).reshape(-1, 2, 2) for name, links in sorts.items()}


def _link_set(links: np.ndarray) -> set[tuple[tuple[int, int], ...]]:
    """Links (M, 2, 2) of pixels, each with its ends in order."""
    return {tuple(sorted(map(tuple, link))) for link in links.astype(int).tolist()}


def map_figures(structure: Structure, boundaries: Boundaries, contours: Curves) -> dict[str, SliceFigure]:
    """Draw what the network and the classical decoder made of a few slices that needed a decision.

    Parameters as in `compare_map_surfaces`; nothing where every slice is an outline already.
    """
    decided = decided_slices(boundaries)
    if not len(decided):
        return {}
    places = ((np.arange(min(_SHOWN, len(decided))) + 0.5) * len(decided) / _SHOWN).astype(int)
    shown = decided[np.minimum(places, len(decided) - 1)]
    maps = [between(boundaries, range(k, k + 1), boundaries.frame) for k in shown.tolist()]
    ordered = [between(contours, range(k, k + 1), contours.frame) for k in shown.tolist()]
    name, whole = best_decoded(structure, boundaries)
    decoded = [between(whole, range(k, k + 1), whole.frame) for k in shown.tolist()]
    panels = [
        _panel(structure, pixels, curves, int(k), method)
        for method, stack in ((NETWORK, ordered), (name, decoded))
        for k, pixels, curves in zip(shown, maps, stack, strict=True)
    ]
    return {"map_surfaces": SliceFigure(panels, len(shown))}


def _panel(structure: Structure, boundaries: Boundaries, curves: Curves, k: int, method: str) -> Panel:
    """Draw slice ``k``, whose pixels and curves are given alone, as slice 0."""
    links = map_links(boundaries.points, curves)
    detail = ", ".join(f"{len(links[name])} {name}" for name in ("kept", "dropped", "bridged"))
    truth = structure.stack("mask")
    if truth is not None:
        first, *corner = structure.stack_origin
        _, rows, columns = truth.shape
        filled = curves.rasterise((0, *corner), (1, rows, columns))[0]
        detail += f"\nDice {float(dice(truth[k - first], filled)):.3f}"
    return Panel(f"slice {k}", links, detail, method)
