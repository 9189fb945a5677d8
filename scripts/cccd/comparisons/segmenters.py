"""Table 3 measured here: the segmentation networks, and CCCD on the true mask and on each network's mask.

Only phantoms are used: the scan with all that is around the organ can be made again, and weights that were
trained on other individuals are shipped.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pandas as pd

from cccd.comparisons.paper_k import AUTOMATIC, CCCD, OUTLINES
from cccd.containers import Frame, Structure
from cccd.curves import corner_splines, describe_curves, sample_splines
from cccd.curves.corners import k_cosine_corners
from cccd.curves.measures import bytes_per_slice
from cccd.geometry.arrays import BoolArray
from cccd.geometry.mesh import Mesh
from cccd.metrics import surface_distances
from cccd.project import shipped_weights
from cccd.reconstruction import fit_and_loft
from cccd.settings.curves import CurveSettings
from cccd.settings.imports import ImportSettings, PhantomSettings
from cccd.settings.surface import LoftSettings
from cccd.tracing import trace_stack

__all__ = ["COLUMNS", "TRUE_MASK", "compare_segmenters"]

#: What CCCD starts from where no network made the mask.
TRUE_MASK = "the true mask"

COLUMNS = (
    "method", "given", "dice_percent", "assd_mm", "hd95_mm", "parameters", "points_per_slice",
    "bytes_per_slice", "seconds_per_slice", "surface_assd_mm",
)  # fmt: skip

#: Points on each surface whose distances are averaged.
_SAMPLES = 20_000


def compare_segmenters(
    structure: Structure, fitting: CurveSettings, lofting: LoftSettings, seed: int
) -> pd.DataFrame:
    """Measure every shipped network on a phantom, and CCCD on its true mask and on each network's mask.

    Parameters
    ----------
    structure : Structure
        Of any other source than a phantom there are no rows.
    fitting, lofting
        Sections ``curves`` and ``surface`` of the configuration.
    seed : int
        The cohort's; it makes the phantom.

    Returns
    -------
    DataFrame
        Columns as in `COLUMNS`. Masks are compared in 3D on the scan's grid. ``bytes_per_slice`` is a bit per
        pixel of the scan's slices for a mask, and 8 bytes per control point, as the paper counts, for CCCD.
        ``surface_assd_mm`` is the distance between the surface that the best network's mask leads to and the
        true one.
    """
    files = shipped_weights(structure.organ) if structure.provenance.get("source") == "phantom" else []
    if not files:
        return pd.DataFrame(columns=list(COLUMNS))
    from cccd.segmentation.inference import labels_of, probabilities  # torch takes seconds to load
    from cccd.segmentation.model import load_segmenter
    from cccd.segmentation.networks import NETWORKS, parameters
    from cccd.segmentation.sources import scan_phantom

    told = {key: structure.provenance[key] for key in PhantomSettings.model_fields}
    reading = ImportSettings(phantom=PhantomSettings(**told))
    scan, truth = scan_phantom(structure.case, structure.organ, reading, seed)
    frame = Frame(scan.affine, structure.frame.slice_axis, scan.shape)
    rows = _cccd_rows(truth, truth, TRUE_MASK, frame, fitting)
    masks: dict[str, BoolArray] = {}
    for file in files:
        model, plan = load_segmenter(file)
        title = NETWORKS[plan.network].title
        begun = time.process_time()
        mask = labels_of(probabilities(model, scan, plan), plan) > 0
        seconds = (time.process_time() - begun) / scan.shape[frame.slice_axis]
        row: dict[str, Any] = {"method": title, "given": "the image", **_compare(mask, truth, frame)}
        row |= {"parameters": parameters(model), "seconds_per_slice": seconds}
        row["bytes_per_slice"] = np.ceil(mask[:, :, 0].size / 8)
        rows += [row, *_cccd_rows(mask, truth, title, frame, fitting)]
        masks[title] = mask
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    networks = table[table["given"] == "the image"]
    best = int(networks["dice_percent"].to_numpy().argmax())
    if structure.truth is not None:
        mask = list(masks.values())[best]
        away = _surface_distance(mask, frame, structure.truth, fitting, lofting)
        table.loc[networks.index[best], "surface_assd_mm"] = away
    return table


def _stack(mask: BoolArray, frame: Frame) -> BoolArray:
    """Put a mask's slices first."""
    return np.ascontiguousarray(np.moveaxis(mask, frame.slice_axis, 0))


def _compare(found: BoolArray, truth: BoolArray, frame: Frame) -> dict[str, float]:
    from cccd.segmentation.scores import volume_scores

    scores = volume_scores(found, truth, frame.spacing)
    return {"dice_percent": 100 * scores["dice"], "assd_mm": scores["assd_mm"], "hd95_mm": scores["hd95_mm"]}


def _cccd_rows(
    mask: BoolArray, truth: BoolArray, given: str, frame: Frame, fitting: CurveSettings
) -> list[dict[str, Any]]:
    """CCCD's splines around a mask's slices, for the paper's k and with knots of their own choice."""
    curves = trace_stack(_stack(mask, frame), (0, 0, 0), frame)
    rows = []
    for k in (*OUTLINES["figure14"], None):
        begun = time.process_time()
        if k is None:
            splines = describe_curves(curves, fitting).splines
        else:
            splines = corner_splines(curves, k_cosine_corners(curves.points, curves.offsets, k))
        seconds = (time.process_time() - begun) / max(len(np.unique(curves.slice)), 1)
        drawn = sample_splines(splines, per_pixel=2.0)
        filled = drawn.rasterise((0, 0, 0), _stack(mask, frame).shape)
        found = np.moveaxis(filled, 0, frame.slice_axis)
        slices, owner = np.unique(splines.slice, return_inverse=True)
        points = np.bincount(owner, np.diff(splines.offsets), len(slices))
        size = 8 * np.median(points) if k else np.median(bytes_per_slice(curves, splines)["spline"])
        rows.append(
            {
                "method": f"{CCCD}, {f'k = {k}' if k else AUTOMATIC}",
                "given": given,
                **_compare(found, truth, frame),
                "points_per_slice": float(np.median(points)),
                "bytes_per_slice": float(size),
                "seconds_per_slice": seconds,
            }
        )
    return rows


def _surface_distance(
    mask: BoolArray, frame: Frame, truth: Mesh, fitting: CurveSettings, lofting: LoftSettings
) -> float:
    """Average distance in mm between the surface that a mask leads to and the true one."""
    curves = trace_stack(_stack(mask, frame), (0, 0, 0), frame)
    mesh = fit_and_loft(curves, fitting, lofting).mesh
    return surface_distances(mesh, truth, np.random.default_rng(0), _SAMPLES)["assd"]
