"""Table 3 measured here: the segmentation networks, and CCCD on the true mask and on each network's mask.

Only phantoms are used: the scan with all that is around the organ can be made again, and weights that were
trained on other individuals are shipped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
import pandas as pd
from scipy import ndimage

from cccd.containers import Curves, FittedCurves, Frame, ProbabilityStack, Sections, Structure
from cccd.contours import level_curves, trace_stack
from cccd.curves.describe import describe_curves
from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray, BoolArray, IntArray, SingleArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import dice
from cccd.inputs.grid import Volume
from cccd.settings.curves import CurveSettings
from cccd.settings.imports import ImportSettings, PhantomSettings
from cccd.settings.junctions import BoundarySettings
from cccd.settings.surface import LoftSettings
from cccd_junctions.boundary import extract_boundaries
from cccd_paper.comparisons.corner_measures import paper_splines
from cccd_paper.comparisons.lofted_distances import filtered_mesh
from cccd_paper.comparisons.orderers import Orderer
from cccd_paper.comparisons.paper_k import AUTOMATIC, CCCD, OUTLINES
from cccd_paper.comparisons.samples import middle_curve
from cccd_paper.comparisons.timing import timed
from cccd_segmentation.growing import grow_region
from cccd_segmentation.seeds import Seed
from cccd_viewers.page_files import Panel, SliceFigure
from cccd_workflow.curve_measures import bytes_per_slice
from cccd_workflow.surface_measures import surface_distances

if TYPE_CHECKING:  # torch takes seconds to load
    from cccd_segmentation.model import Segmenter

_Volume = TypeVar("_Volume", BoolArray, SingleArray)

#: What networks start from, and CCCD where no network made the mask: the image, the mask that is the truth,
#: or the image and a voxel in the middle of each part of the organ.
THE_IMAGE, TRUE_MASK, A_SEED = "the image", "the true mask", "the image and a seed"


COLUMNS = (
    "method", "given", "dice_percent", "assd_mm", "hd95_mm", "parameters", "points_per_slice",
    "bytes_per_slice", "seconds_per_slice", "surface_assd_mm", "probability_surface_assd_mm",
)  # fmt: skip

#: The network whose outline stands in Figure 14 (d).
_DRAWN = "h_denseunet"

#: Probability on an organ's border.
_LEVEL = 0.5

#: Smaller parts of an organ, as a share of its largest, get no seed.
_SMALLEST_PART = 0.1

#: Points on each surface whose distances are averaged.
_SAMPLES = 10_000


@dataclass(frozen=True)
class ShippedNetworks:
    """Networks that are shipped for an organ; a scan is made and looked at once, for table and figure.

    Attributes
    ----------
    segmenters : sequence of (module, plan)
    found : dict
        Probabilities (a, b, c) of any label that a network found, by its name, case, organ and seed.
    scans : dict
        Whole scans of phantoms and their true masks, by case, organ and seed.
    """

    segmenters: Sequence[Segmenter]
    found: dict[tuple[str, str, str, int], SingleArray] = field(default_factory=dict)
    scans: dict[tuple[str, str, int], tuple[Volume, BoolArray]] = field(default_factory=dict)

    def scan(self, structure: Structure, seed: int) -> tuple[Volume, BoolArray]:
        """Scan a phantom with all that is around the organ; its true mask."""
        key = (structure.case, structure.organ, seed)
        if key not in self.scans:
            self.scans[key] = _whole_scan(structure, seed)
        return self.scans[key]

    def chances(self, segmenter: Segmenter, structure: Structure, scan: Volume, seed: int) -> SingleArray:
        """Probabilities (a, b, c) of any label in a structure's whole scan, specks left out."""
        key = (segmenter[1].network, structure.case, structure.organ, seed)
        if key not in self.found:
            self.found[key] = _chances(segmenter, scan)
        return self.found[key]


def load_segmenters(*paths: str | Path) -> ShippedNetworks:
    """Load the segmentation networks that are shipped for an organ, each with its plan."""
    from cccd_segmentation.model import load_segmenter

    return ShippedNetworks([load_segmenter(path) for path in paths])


def compare_segmenters(
    structure: Structure,
    segmenters: ShippedNetworks,
    orderers: Sequence[Orderer],
    edges: BoundarySettings,
    fitting: CurveSettings,
    lofting: LoftSettings,
    seed: int,
) -> pd.DataFrame:
    """Measure networks on a phantom, and CCCD on its true mask, on each network's mask and from a seed.

    Parameters
    ----------
    structure : Structure
        Of any other source than a phantom there are no rows.
    segmenters : ShippedNetworks
    orderers : sequence of Orderer
        The first one orders the edges of the image; without one there are no such rows.
    edges, fitting, lofting
        Sections ``boundaries``, ``curves`` and ``surface`` of the configuration.
    seed : int
        The cohort's; it makes the phantom.

    Returns
    -------
    DataFrame
        Columns as in `COLUMNS`. Masks are compared in 3D on the scan's grid. ``bytes_per_slice`` is a bit per
        pixel of the scan's slices for a mask, and 8 bytes per control point, as the paper counts, for CCCD.
        The network of the highest Dice alone has ``surface_assd_mm``, the distance between the surface that
        its mask leads to and the true one, and ``probability_surface_assd_mm``, that of its probabilities at
        one half.
    """
    if not segmenters.segmenters or structure.provenance.get("source") != "phantom":
        return pd.DataFrame(columns=list(COLUMNS))
    from cccd_segmentation.networks import networks, parameters

    scan, truth = segmenters.scan(structure, seed)
    frame = Frame(scan.affine, structure.frame.slice_axis, scan.shape)
    traced = _traced(truth, frame)
    if (one := middle_curve(traced)) is not None:
        describe_curves(one, fitting)  # compiled before anything is timed
    rows, _ = _cccd_rows(traced, truth, TRUE_MASK, frame, fitting)
    if orderers and (curves := _curves_from_seed(scan, truth, frame, orderers[0], edges)) is not None:
        rows += _cccd_rows(curves, truth, A_SEED, frame, fitting)[0]
    best, most = None, -1.0  # row, probabilities, curves of the mask
    for model, plan in segmenters.segmenters:
        title = networks()[plan.network].title
        chances, seconds = timed(segmenters.chances, (model, plan), structure, scan, seed)
        mask = chances >= _LEVEL
        row: dict[str, Any] = {"method": title, "given": THE_IMAGE, **_compare(mask, truth, frame)}
        row |= {"parameters": parameters(model), "seconds_per_slice": seconds / scan.shape[frame.slice_axis]}
        row["bytes_per_slice"] = np.ceil(_stack(mask, frame)[0].size / 8)
        described, fitted = _cccd_rows(_traced(mask, frame), truth, title, frame, fitting)
        rows += [row, *described]
        if row["dice_percent"] > most:
            best, most = (row, chances, fitted), row["dice_percent"]
    if best is not None and structure.truth is not None:
        row, chances, fitted = best
        row["surface_assd_mm"] = _surface_distance(fitted, structure.truth, lofting)
        stack = ProbabilityStack(_stack(chances, frame), np.zeros(3, int))
        fitted = describe_curves(level_curves(stack, frame), fitting)
        row["probability_surface_assd_mm"] = _surface_distance(fitted, structure.truth, lofting)
    return pd.DataFrame(rows, columns=list(COLUMNS))


def network_figures(structure: Structure, segmenters: ShippedNetworks, seed: int) -> dict[str, SliceFigure]:
    """Outline what a network finds on the slice of Figure 14, its panel (d); nothing where it is not shipped.

    Parameters as in `compare_segmenters`.
    """
    drawn = next((pair for pair in segmenters.segmenters if pair[1].network == _DRAWN), None)
    if drawn is None or structure.provenance.get("source") != "phantom":
        return {}
    from cccd_segmentation.networks import networks

    own = middle_curve(trace_stack(structure.required_stack("mask"), structure.stack_origin, structure.frame))
    if own is None:
        return {}
    scan, truth = segmenters.scan(structure, seed)
    frame = Frame(scan.affine, structure.frame.slice_axis, scan.shape)
    first, *corner = _stack_offset(scan, structure.frame)
    layer = int(own.slice[0]) - first
    chances = segmenters.chances(drawn, structure, scan, seed)
    true, found = (_stack(mask, frame)[layer] for mask in (truth, chances >= _LEVEL))
    outline = middle_curve(trace_stack(found[None], (0, *corner), structure.frame))
    if outline is None:
        return {}
    detail = f"{len(outline.points)} pixels, Dice {100 * dice(found, true):.2f} %"
    layers = {"boundary": own.points, "spline": outline.points}
    return {"figure14": SliceFigure([Panel(networks()[_DRAWN].title, layers, detail)])}


def _whole_scan(structure: Structure, seed: int) -> tuple[Volume, BoolArray]:
    """Scan a phantom with all that is around the organ; its true mask."""
    from cccd_datasets.whole_scans import scan_phantom

    spacing = structure.provenance["spacing_mm"]
    reading = ImportSettings(phantom=PhantomSettings(spacing_mm=spacing))
    return scan_phantom(structure.case, structure.organ, reading, seed)


def _chances(segmenter: Segmenter, scan: Volume) -> SingleArray:
    """Probabilities (a, b, c) of any label, specks left out."""
    from cccd_segmentation.inference import labels_of, probabilities

    model, plan = segmenter
    found = probabilities(model, scan, plan)
    mask, inside = labels_of(found, plan) > 0, 1 - found[0]
    below = np.nextafter(np.float32(_LEVEL), np.float32(0))
    return np.where(mask, np.maximum(inside, _LEVEL), np.minimum(inside, below)).astype(np.float32)


def _stack(volume: _Volume, frame: Frame) -> _Volume:
    """Put a volume's slices first."""
    return cast(_Volume, np.ascontiguousarray(np.moveaxis(volume, frame.slice_axis, 0)))


def _traced(mask: BoolArray, frame: Frame) -> Curves:
    return trace_stack(_stack(mask, frame), (0, 0, 0), frame)


def _stack_offset(scan: Volume, frame: Frame) -> IntArray:
    """Index (k, i, j) in a frame of a scan's first voxel; both have the same voxels."""
    index = np.rint(np.linalg.solve(frame.affine, scan.affine[:, 3])[:3]).astype(int)
    return np.concatenate([index[[frame.slice_axis]], np.delete(index, frame.slice_axis)])


def _curves_from_seed(
    scan: Volume, truth: BoolArray, frame: Frame, order: Orderer, edges: BoundarySettings
) -> Curves | None:
    """Curves of a scan without a mask: a region grown from seeds, edges near it, the junction network."""
    image = np.asarray(scan.data, np.float32)
    try:
        grown = grow_region(image, frame.spacing, _middles(truth, frame), frame.slice_axis, scan.location)
        alone = Structure("", "", frame, np.zeros(3, int), image=image, region=grown.mask)
        boundaries = extract_boundaries(alone, edges)
    except InputError:
        return None
    curves = order(boundaries, alone.stack("image"), alone.stack_origin, alone.stack("region"))
    return curves if len(curves) else None


def _middles(truth: BoolArray, frame: Frame) -> list[Seed]:
    """Seeds where a person would point: the voxel of each part that lies deepest in it."""
    labels, count = ndimage.label(truth)
    sizes = np.bincount(labels.ravel(), minlength=count + 1)[1:]
    seeds: list[Seed] = []
    for part in 1 + np.flatnonzero(sizes >= _SMALLEST_PART * sizes.max()):
        depth = cast(AnyArray, ndimage.distance_transform_edt(labels == part, sampling=frame.spacing))
        i, j, k = (int(index) for index in np.unravel_index(depth.argmax(), depth.shape))
        seeds.append(Seed((i, j, k), (i + 1, j + 1, k + 1)))
    return seeds


def _compare(found: BoolArray, truth: BoolArray, frame: Frame) -> dict[str, float]:
    from cccd_training.segmentation.scores import volume_scores

    scores = volume_scores(found, truth, frame.spacing)
    return {"dice_percent": 100 * scores["dice"], "assd_mm": scores["assd_mm"], "hd95_mm": scores["hd95_mm"]}


def _cccd_rows(
    curves: Curves, truth: BoolArray, given: str, frame: Frame, fitting: CurveSettings
) -> tuple[list[dict[str, Any]], FittedCurves]:
    """CCCD's splines along curves, for the paper's k and with knots of their own choice; the latter too."""
    fitted, seconds = timed(describe_curves, curves, fitting)
    described = [(AUTOMATIC, fitted.splines, seconds)]
    for k in reversed(OUTLINES["figure14"]):
        splines, seconds = timed(paper_splines, curves, k)
        described.insert(0, (f"k = {k}", splines, seconds))
    rows: list[dict[str, Any]] = []
    for name, splines, seconds in described:
        filled = splines.sample(2.0).rasterise((0, 0, 0), _stack(truth, frame).shape)
        slices, owner = np.unique(splines.slice, return_inverse=True)
        points = np.bincount(owner, np.diff(splines.offsets), len(slices))
        own_knots = name == AUTOMATIC
        size = np.median(bytes_per_slice(curves, splines)["spline"]) if own_knots else 8 * np.median(points)
        rows.append(
            {
                "method": f"{CCCD}, {name}",
                "given": given,
                **_compare(np.moveaxis(filled, 0, frame.slice_axis), truth, frame),
                "points_per_slice": float(np.median(points)),
                "bytes_per_slice": float(size),
                "seconds_per_slice": seconds / len(np.unique(curves.slice)),
            }
        )
    return rows, fitted


def _surface_distance(fitted: FittedCurves, truth: Mesh, lofting: LoftSettings) -> float:
    """Average distance in mm between the filtered mesh of curves and the true surface."""
    mesh = filtered_mesh(Sections(fitted.curves), lofting)
    return surface_distances(mesh, truth, np.random.default_rng(0), _SAMPLES)["assd"]
