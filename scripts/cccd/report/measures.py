"""Where the numbers of the overviews stand in ``metrics.json``, and how the page's headlines write them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

__all__ = ["HEADLINES", "MEASURES", "Headline", "Measure"]


class Headline(NamedTuple):
    """How a number by which a surface is judged at a glance is written.

    ``factor`` turns it into ``unit``, ``form`` is its format.
    """

    heading: str
    unit: str
    factor: float
    form: str


class Measure(NamedTuple):
    """A number of a structure: its column in ``tables/structures.csv`` and its path in ``metrics.json``."""

    name: str
    path: tuple[str, ...]
    headline: Headline | None = None

    def look_up(self, metrics: Mapping[str, Any]) -> Any:
        """Take the number; None where it was not measured."""
        found: Any = metrics
        for key in self.path:
            found = found.get(key) if isinstance(found, Mapping) else None
        return found


MEASURES = (
    Measure("slices", ("curves", "slices")),
    Measure("curves", ("curves", "curves")),
    Measure("boundary_points", ("curves", "boundary_points")),
    Measure("spline_control_points", ("curves", "control_points")),
    Measure("spline_dice_median", ("curves", "dice_median")),
    Measure("spline_dice_p5", ("curves", "dice_p5")),
    Measure("area_kept", ("curves", "area_kept")),
    Measure("dice_3d", ("surface", "dice_3d"), Headline("3D Dice", "", 1, ".4f")),
    Measure("assd_mm", ("surface", "assd_mm"), Headline("ASSD", "mm", 1, ".2f")),
    Measure("hd95_mm", ("surface", "hd95_mm")),
    Measure("normals_median_deg", ("surface", "normals_median_deg")),
    Measure("normals_p90_deg", ("surface", "normals_p90_deg")),
    Measure("volume_ml", ("surface", "volume_ml")),
    Measure("volume_bias", ("surface", "volume_bias"), Headline("Volume bias", "%", 100, "+z.2f")),
    Measure("closed_manifold", ("surface", "closed_manifold")),
    Measure("self_intersections", ("surface", "self_intersections")),
    Measure("genus", ("surface", "genus")),
    Measure("genus_true", ("surface", "genus_true")),
    Measure("control_points", ("surface", "control_points"), Headline("Control points", "", 1, ",d")),
    Measure("control_bytes", ("surface", "control_bytes"), Headline("Control mesh", "kB", 1e-3, ".1f")),
    Measure(
        "compactness", ("surface", "compactness"), Headline("Smaller than marching cubes", "×", 1, ".0f")
    ),
)

#: The measures that the page shows with each structure, and how.
HEADLINES = tuple((measure, measure.headline) for measure in MEASURES if measure.headline is not None)
