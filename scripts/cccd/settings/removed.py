"""Settings that are gone, so that one in an older file is told what became of it."""

from __future__ import annotations

__all__ = ["what_became_of"]

_DECIDED = "the spline surface decides that by itself: delete the key"
_FIXED = "its value is fixed in the code now: delete the key"
_OF_TUBES = (
    "tolerance_voxels",
    "tolerance_filled",
    "compactness",
    "compactness_thin",
    "compactness_filled",
    "edge_voxels",
    "interpolation",
    "detail",
    "fitting",
    "blending",
)
_OF_THE_ORDERING = (
    "rerank",
    "neighbour_nats",
    "neighbour_reach",
    "neighbour_spread_px",
    "neighbour_sweeps",
    "neighbour_score",
    "border_cost",
    "area_power",
    "smallest_loop_px",
    "smallest_loop_share",
    "tip_px",
    "slices_per_batch",
    "edge_slope",
    "shortest_edge_px",
    "edge_half_away_px",
    "most_edges",
    "most_edges_per_pixel",
)
_OF_THE_TRAINING = (
    "dropout",
    "heads",
    "hidden_images",
    "kind_weights",
    "loss",
    "optimiser",
    "pixel_layers",
    "paper.batch_size",
    "paper.dropout",
    "paper.layers",
    "paper.learning_rate",
    "paper.width",
)
#: By the dotted name of a key or of a section.
_REMOVED = {
    "surface.method": "the spline is the only surface: delete the key",
    "surface.matching": "its smallest_part_voxels is surface.smallest_part_voxels now; delete the others",
    **{f"surface.{name}": _DECIDED for name in _OF_TUBES},
    "comparisons.thick_slices.tolerance_voxels": _DECIDED,
    "comparisons.thick_slices.compactness": _DECIDED,
    **{f"gnn.inference.{name}": _FIXED for name in _OF_THE_ORDERING},
    **{f"gnn.{name}": _FIXED for name in _OF_THE_TRAINING},
    "curves.fitting": _FIXED,
    "surface.corner_k": "curves: {method: corners, k: ...} makes these splines: delete the key",
    "surface.solid": _FIXED,
    "surface.walls": _FIXED,
    **{
        f"surface.tetrahedra.{name}": _FIXED
        for name in ("bends", "energy", "rounds", "sharp_deg", "shortest")
    },
    "boundaries.grey_ranges": _FIXED,
    "boundaries.hysteresis": _FIXED,
    **{f"import.{name}": _FIXED for name in ("damage", "limits", "margin_voxels", "scan")},
    **{f"import.phantom.{name}": _FIXED for name in ("blur_mm", "noise_hu")},
    "report.viewer_triangles": _FIXED,
    "comparisons.active_contour": _FIXED,
    **{f"comparisons.corners.{name}": _FIXED for name in ("min_contour_px", "on_boundary_px")},
    "comparisons.reconstruction": "its n_slices is that of comparisons.corners now; delete the others",
    "comparisons.stage_times": _FIXED,
    "segmentation.augmentation": _FIXED,
    "gnn.inference.doubtful_from": "gnn.inference.unlisted_wrong decides now which slices are listed",
    "gnn.link_width": "it follows from gnn.width now: delete the key",
    "gnn.paper.patience": "all of gnn.paper.epochs are trained now: delete the key",
}


def what_became_of(key: str) -> str | None:
    """Say what to do about a dotted key that is no longer a setting; None where it never was one.

    Examples
    --------
    >>> what_became_of("surface.method")
    'the spline is the only surface: delete the key'
    """
    return _REMOVED.get(key)
