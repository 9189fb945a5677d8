"""The whole way from a scan with its mask to a measured surface, beside an isosurface of the mask."""

from collections.abc import Callable
from pathlib import Path

from organ import make_organ

from cccd.boundary import extract_boundaries
from cccd.comparisons.volume_meshes import flying_edges, windowed_sinc
from cccd.curves import describe_curves
from cccd.curves.ordering import order_structure
from cccd.junctions import load_model
from cccd.surface import loft_surface, measure_surface

TITLE = "Whole pipeline"
SIZES = (8, 16, 32, 64)
MODEL = Path(__file__).parents[2] / "workflow" / "models" / "junctions.pt"


def prepare(slices: int, settings: dict) -> dict[str, Callable]:
    """Give the methods to time on an organ of so many slices."""
    organ = make_organ(slices)
    model = load_model(MODEL)

    def reconstruct(ordering: str) -> None:
        boundaries = extract_boundaries(organ, settings["boundaries"])
        curves, _ = order_structure(organ, boundaries, model, ordering)
        describe_curves(curves, settings["curves"])
        measure_surface(loft_surface(curves, settings["surface"]), organ)

    return {
        "every stage": lambda: reconstruct("auto"),
        "every stage, ordered by the GNN": lambda: reconstruct("gnn"),
        "flying edges + windowed sinc": lambda: windowed_sinc(flying_edges(organ)),
    }
