"""Algorithm 1 as printed, from boundary pixels to eq. (10)'s surface, beside our own curves and surface.

Lines 8 to 10, blur, dilation and edges, are `cccd_junctions.boundary`: an image's edges, or a mask's outline.
Which edges line 10 means is not printed; Canny's thresholds are those of the configuration (section
``boundaries``).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd

from cccd.containers import Boundaries, Curves, Splines, Structure
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import dice
from cccd.geometry.sections import cross_sections
from cccd.surface.surface import LoftedSurface
from cccd_paper.comparisons.corner_measures import paper_splines
from cccd_paper.comparisons.orderers import Orderer, load_orderers
from cccd_paper.comparisons.tensor_product_loft import TUNED, loft_splines
from cccd_paper.comparisons.tuning import SAMPLES
from cccd_viewers.page_files import Panel, SliceFigure
from cccd_workflow.surface_measures import Reference, measure_agreement

#: The methods' names in the table.
PAPER, OURS = "paper", "ours"

#: Figures of a surface that the table has.
_FIGURES = ("dice_3d", "assd_mm", "hd95_mm", "volume_bias")


@dataclass(frozen=True, eq=False)
class PaperChain:
    """What Algorithm 1 leaves.

    Attributes
    ----------
    curves : Curves
        Corrected chain codes (line 15).
    splines : Splines
        Of the corners (lines 16 and 17).
    mesh : Mesh or None
        Line 22; None where fewer than two slices have a curve.
    seconds : float
        Processor time from line 12 on.
    """

    curves: Curves
    splines: Splines
    mesh: Mesh | None
    seconds: float


def load_paper_orderer(path: str | Path) -> Orderer | None:
    """Load the paper's network to order boundary pixels with; None where PyTorch is not installed."""
    try:
        return load_orderers(path)[0]
    except ImportError:  # masks alone need no PyTorch, and get their own row
        return None


@lru_cache(maxsize=1)  # the table and the figure are of the same chain
def run_algorithm_1(boundaries: Boundaries, paper_orderer: Orderer) -> PaperChain:
    """Run lines 12 to 22 on the boundary pixels of line 10.

    Parameters
    ----------
    boundaries : Boundaries
    paper_orderer : Orderer
        The paper's network, which is asked on slices with junctions; without any a chain code is followed.
    """
    begin = time.process_time()
    curves = paper_orderer(boundaries)
    splines = paper_splines(curves, TUNED.k)
    lofted = len(np.unique(curves.slice[~curves.hole])) > 1
    mesh = loft_splines(curves, splines) if lofted else None
    return PaperChain(curves, splines, mesh, time.process_time() - begin)


def compare_algorithm_1(
    structure: Structure,
    boundaries: Boundaries,
    curves: Curves,
    splines: Splines,
    surface: LoftedSurface,
    paper_orderer: Orderer | None,
) -> pd.DataFrame:
    """Measure the paper's curves and surface beside ours.

    Parameters
    ----------
    structure : Structure
        Its mask, or its true surface, is what both are measured against.
    boundaries : Boundaries
        Its boundary pixels.
    curves, splines, surface : Curves, Splines, LoftedSurface
        Ours, as they came from the run.
    paper_orderer : Orderer or None
        The paper's network; without it there is no row of the paper's.

    Returns
    -------
    DataFrame
        A row of each ``method``: ``slices`` with boundary pixels and how many of them have a ``closed``
        curve; ``control_points`` of the splines, their ``share`` of the curves' pixels, and ``dice_2d``, the
        median over the mask's slices of the Dice of what the splines enclose; Dice, ASSD, 95 % Hausdorff
        distance and volume bias of the surface, its ``genus`` and the true one; of the paper's chain
        processor ``seconds``.
    """
    reference = None if structure.mask is None else Reference.of(structure)
    own = _row(OURS, structure, reference, boundaries, curves, splines, surface.mesh)
    if paper_orderer is None:
        return pd.DataFrame([own])
    chain = run_algorithm_1(boundaries, paper_orderer)
    paper = _row(PAPER, structure, reference, boundaries, chain.curves, chain.splines, chain.mesh)
    return pd.DataFrame([paper | {"seconds": chain.seconds}, own])


def _row(
    method: str,
    structure: Structure,
    reference: Reference | None,
    boundaries: Boundaries,
    curves: Curves,
    splines: Splines | None,
    mesh: Mesh | None,
) -> dict[str, object]:
    """Measure one method's curves and surface."""
    found = {
        "method": method,
        "slices": len(boundaries),
        "closed": len(np.intersect1d(boundaries.slice, curves.slice)),
    }
    if splines is not None and len(curves):
        points = len(splines.control_points)
        found |= {"control_points": points, "share": points / max(len(curves.points), 1)}
        found["dice_2d"] = _dice_2d(structure, splines.sample())
    if mesh is not None and len(mesh.faces):
        figures = measure_agreement(mesh, structure, reference, SAMPLES)
        found |= {name: figures[name] for name in _FIGURES if name in figures}
        found["genus"] = mesh.genus if mesh.is_closed_manifold else np.nan
    if structure.truth is not None:
        found["genus_true"] = structure.truth.genus
    return found


def _dice_2d(structure: Structure, drawn: Curves) -> float:
    """Median over the mask's slices of the Dice of what curves enclose; missing without a mask."""
    truth = structure.stack("mask")
    if truth is None:
        return float("nan")
    used = truth.any(axis=(1, 2))
    enclosed = drawn.rasterise(structure.stack_origin, truth.shape)
    return float(np.median(np.asarray(dice(truth[used], enclosed[used], axis=(1, 2)))))


def section_figures(
    structure: Structure, boundaries: Boundaries, surface: LoftedSurface, paper_orderer: Orderer | None
) -> dict[str, SliceFigure]:
    """Draw the paper's surface and ours, cut across the slices through the middle, over the reference."""
    if paper_orderer is None:
        return {}
    chain = run_algorithm_1(boundaries, paper_orderer)
    reference = None if structure.mask is None else Reference.of(structure).mesh
    meshes = {"paper, Algorithm 1": chain.mesh, "ours": surface.mesh}
    axis, rows, columns = _plane(structure)
    middle = float((surface.mesh.vertices @ axis).mean())
    across = np.column_stack([rows, columns])
    panels = []
    for title, mesh in meshes.items():
        layers = {
            name: _segments(one, axis, middle, across)
            for name, one in (("boundary", reference), ("spline", mesh))
            if one is not None and len(one.faces)
        }
        if layers:
            panels.append(Panel(title, layers))
    return {"algorithm_1": SliceFigure(panels, len(panels))} if panels else {}


def _plane(structure: Structure) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the normal of a plane across the slices, and the picture's directions down and to the right."""
    frame = structure.frame
    axes = frame.affine[:3, :3] / np.linalg.norm(frame.affine[:3, :3], axis=0)
    first, second = (axes[:, axis] for axis in frame.in_plane_axes)
    through = np.cross(first, second)
    normal = np.cross(through, first)
    return normal / np.linalg.norm(normal), -through / np.linalg.norm(through), first


def _segments(mesh: Mesh, normal: np.ndarray, height: float, across: np.ndarray) -> np.ndarray:
    """Segments (M, 2, 2) in which a mesh meets a plane, in the plane's own directions."""
    loops: Sequence[np.ndarray] = cross_sections(mesh, normal, np.array([height]))[0]
    parts = [np.stack([loop, np.roll(loop, -1, axis=0)], axis=1) @ across for loop in loops]
    return np.concatenate([np.zeros((0, 2, 2)), *parts])
