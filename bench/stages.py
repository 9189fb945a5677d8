"""What is timed in each stage, and beside what, on an organ of so many slices."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import torch
from organ import make_organ
from scipy.interpolate import splprep
from torch_geometric.data import Batch

from cccd.containers import Boundaries, Curves, Sections
from cccd.contours import trace_contours
from cccd.curves.describe import describe_curves
from cccd.geometry.arrays import concatenate_ragged
from cccd.settings.root import Settings
from cccd.surface.loft import loft_surface
from cccd_datasets.corruptions import corrupt
from cccd_junctions.boundary import extract_boundaries
from cccd_junctions.checkpoint import load_model
from cccd_junctions.ordering import order_boundaries, order_contours
from cccd_paper.comparisons.volume_meshes import flying_edges, windowed_sinc
from cccd_training.junctions.data import label_map
from cccd_training.junctions.loss import total_loss
from cccd_training.junctions.synthetic_maps import draw_map
from cccd_workflow.surface_measures import measure_surface

MODEL = Path(__file__).parents[1] / "workflow" / "models" / "junctions.pt"

Methods = dict[str, Callable[[], object]]


def junctions(slices: int, settings: Settings) -> Methods:
    """Damaged boundary maps to ordered curves, beside contour following of the filled mask."""
    organ = make_organ(slices)
    stack = organ.stack("mask").astype(np.uint8)
    rng = np.random.default_rng(settings.seed)
    filled = [layer for layer in range(len(stack)) if stack[layer].any()]
    maps = [np.argwhere(corrupt(rng, stack[layer], "spurs")).astype(np.int32) for layer in filled]
    numbers = np.array(filled, np.int32) + organ.stack_origin[0]
    boundaries = Boundaries(*concatenate_ragged(maps), numbers, organ.frame)
    follow = partial(cv2.findContours, mode=cv2.RETR_CCOMP, method=cv2.CHAIN_APPROX_NONE)
    model = load_model(MODEL)
    return {
        "GNN and minimum cut": lambda: order_boundaries(boundaries, model, image=organ.stack("image")),
        "minimum cut alone": lambda: order_boundaries(boundaries, None),
        "our tracing of a mask": lambda: trace_contours(organ),
        "cv2.findContours of a mask": lambda: [follow(layer) for layer in stack],
    }


def network(slices: int, settings: Settings) -> Methods:
    """The junction network on damaged maps, on the GPU beside the CPU where there is one."""
    maps = [draw_map(np.random.default_rng([settings.seed, n]), "mixed") for n in range(slices)]
    data = [label_map(drawn, False) for drawn in maps]
    methods = {}
    for device in ("CPU", "CUDA") if torch.cuda.is_available() else ("CPU",):
        model, there = load_model(MODEL).to(device.lower()), Batch.from_data_list(data).to(device.lower())

        def step(model=model, there=there) -> None:
            model.zero_grad()
            total_loss(model.train()(there), there).backward()

        methods[f"prediction, {device}"] = partial(model.predict, data)
        methods[f"step of training, {device}"] = step
    return methods


def curves(slices: int, settings: Settings) -> Methods:
    """Chain codes, corners and closed splines, beside a smoothing spline of every curve."""
    traced = trace_contours(make_organ(slices))
    few = settings.curves
    paper = few.model_copy(update={"method": "corners"})
    # splprep bounds the sum of squares: the tolerance that ours has at every point
    allowed = few.tolerance_px**2

    def smooth() -> None:
        for points in traced:
            closed = np.vstack([points, points[:1]])
            splprep(closed.T, s=allowed * len(points), per=True)

    return {
        "few knots (default)": lambda: describe_curves(traced, few),
        "corners as control points": lambda: describe_curves(traced, paper),
        "splprep": smooth,
    }


def surface(slices: int, settings: Settings) -> Methods:
    """Lofting, beside the isosurface and the smoothing that people take today."""
    organ = make_organ(slices)
    traced = trace_contours(organ)
    return {
        "spline surface": lambda: loft_surface(Sections(traced), settings.surface),
        "flying edges": lambda: flying_edges(organ),
        "flying edges + windowed sinc": lambda: windowed_sinc(flying_edges(organ)),
    }


def pipeline(slices: int, settings: Settings) -> Methods:
    """From a scan with its mask to a measured surface, beside an isosurface of the mask."""
    organ = make_organ(slices)
    model = load_model(MODEL)

    def ordered_by_network() -> Curves:
        boundaries = extract_boundaries(organ, settings.boundaries)
        return order_contours(organ, boundaries, model)[0]

    def reconstruct(contours: Callable[[], Curves]) -> None:
        curves = contours()
        describe_curves(curves, settings.curves)
        measure_surface(loft_surface(Sections(curves), settings.surface), organ)

    return {
        "every stage": lambda: reconstruct(lambda: trace_contours(organ)),
        "every stage, ordered by the GNN": lambda: reconstruct(ordered_by_network),
        "flying edges + windowed sinc": lambda: windowed_sinc(flying_edges(organ)),
    }


#: By the name of the benchmark on the command line.
STAGES = {
    "junctions": junctions,
    "network": network,
    "curves": curves,
    "surface": surface,
    "pipeline": pipeline,
}
