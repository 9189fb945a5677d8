"""Structures whose boundary pixels had to be ordered: their surfaces, and what was decided on the way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from cccd.containers import Boundaries, Curves, Panel, Sections, SliceFigure, Structure
from cccd.curves import describe_curves
from cccd.geometry.arrays import offsets_of
from cccd.junctions.ordering import count_changes
from cccd.metrics import dice
from cccd.settings.curves import CurveSettings
from cccd.settings.surface import LoftSettings
from cccd.surface import LoftedSurface, loft_surface
from cccd.surface.measure import Reference, measure_mesh
from cccd.tracing import trace_stack
from cccd_paper.comparisons.baselines.decoders import DECODERS
from cccd_paper.comparisons.decoders import decode
from cccd_paper.comparisons.ordering_comparison import decided_slices
from cccd_paper.comparisons.samples import between
from cccd_paper.junctions.grid import build_grid

__all__ = [
    "CLASSICAL",
    "NETWORK",
    "THRESHOLD",
    "compare_map_surfaces",
    "decoded_curves",
    "map_figures",
    "map_links",
]

#: The run's own ordering, the classical decoder that does best in the table of junctions, and no ordering.
NETWORK, CLASSICAL, THRESHOLD = "network", "skeleton prune + tour + prizes", "region by threshold, traced"

#: No ordering, where the region was grown from a seed.
GROWN = "region from the seed, traced"

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
    fitting: CurveSettings,
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
    fitting, lofting : CurveSettings, LoftSettings
        As the structure's own curves and surface were made.

    Returns
    -------
    DataFrame
        One row per way: the network, the classical decoder, and of an image the region that a threshold
        found, traced. ``slices`` with boundary pixels, ``decided`` (those whose map is no outline already)
        and ``without_curve``; ``pixels`` of the maps and how many are ``kept`` and ``dropped``, and pixels
        that were ``bridged``; ``curves``; Dice, ASSD and 95 % Hausdorff distance in mm, and volume bias. Of
        the traced region what concerns the maps is missing.
    """
    reference = None if structure.mask is None else Reference.of(structure)

    def measured(made: LoftedSurface) -> dict[str, object]:
        figures = measure_mesh(made.mesh, structure, reference=reference)
        return {name: figures[name] for name in _FIGURES if name in figures}

    def lofted(curves: Curves) -> dict[str, object]:
        if not len(curves):
            return {}
        return measured(loft_surface(Sections(curves, describe_curves(curves, fitting).splines), lofting))

    decoded = decoded_curves(boundaries)
    decided = len(decided_slices(boundaries))
    rows = [
        {"method": method, "decided": decided, **_counts(boundaries, curves), **figures}
        for method, curves, figures in (
            (NETWORK, contours, measured(surface)),
            (CLASSICAL, decoded, lofted(decoded)),
        )
    ]
    if structure.region is not None:
        region = structure.required_stack("region")
        traced = trace_stack(region, structure.stack_origin, structure.frame)
        grown = "seed" in structure.provenance.get("region", {})
        rows.append({"method": GROWN if grown else THRESHOLD, "curves": len(traced), **lofted(traced)})
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


def decoded_curves(boundaries: Boundaries) -> Curves:
    """Order every slice's pixels by the classical decoder, which finds one outer curve, or none."""
    run: Callable[..., np.ndarray] = DECODERS[CLASSICAL].run
    chains = [decode(run, pixels, pixels.mean(axis=0)) for pixels in boundaries]
    found = [n for n, chain in enumerate(chains) if len(chain)]
    points = np.concatenate([np.zeros((0, 2)), *(chains[n] for n in found)])
    offsets = offsets_of([len(chains[n]) for n in found])
    slices = boundaries.slice[found]
    return Curves(points, offsets, slices, np.zeros(len(found), bool), boundaries.frame)


# What was decided ---------------------------------------------------------------------------------------


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
    decoded = [decoded_curves(pixels) for pixels in maps]
    panels = [
        _panel(structure, pixels, curves, int(k), method)
        for method, stack in ((NETWORK, ordered), (CLASSICAL, decoded))
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
