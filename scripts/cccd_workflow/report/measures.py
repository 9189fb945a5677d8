"""Where the numbers of the overviews stand in ``metrics.json``, and how the pages' headlines write them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple


class Headline(NamedTuple):
    """How a number by which a surface is judged at a glance is written.

    ``factor`` turns it into ``unit``, ``form`` is its format; four digits without one.
    """

    heading: str
    unit: str
    factor: float
    form: str


class Measure(NamedTuple):
    """A number of a structure: its column in ``tables/structures.csv`` and its path in ``metrics.json``."""

    name: str
    path: tuple[str | int, ...]
    headline: Headline | None = None

    def look_up(self, metrics: Mapping[str, Any]) -> Any:
        """Take the number; None where it was not measured."""
        found: Any = metrics
        for key in self.path:
            if isinstance(found, Mapping):
                found = found.get(key)
            else:
                found = found[key] if isinstance(found, Sequence) and isinstance(key, int) else None
        return found


#: Columns of ``tables/structures.csv``, each explained in ``docs/tables.md``.
MEASURES = (
    Measure("volume_ml", ("surface", "volume_ml"), Headline("Volume", "ml", 1, "")),
    Measure("volume_low_ml", ("surface", "volume_low_ml")),
    Measure("volume_high_ml", ("surface", "volume_high_ml")),
    Measure("surface_area_mm2", ("surface", "area_mm2"), Headline("Surface area", "cm²", 0.01, "")),
    *(
        Measure(f"{side}_{axis}_mm", ("surface", "bounding_box_mm", end, n))
        for n, axis in enumerate("xyz")
        for end, side in enumerate(("lowest", "highest"))
    ),
    *(Measure(f"centroid_{axis}_mm", ("surface", "centroid_mm", n)) for n, axis in enumerate("xyz")),
    Measure("slices", ("curves", "slices")),
    Measure("curves", ("curves", "curves")),
    Measure("dice_3d", ("surface", "dice_3d"), Headline("Dice with the mask", "", 1, ".4f")),
    Measure("reference", ("surface", "reference")),
    Measure("assd_mm", ("surface", "assd_mm"), Headline("Mean distance", "mm", 1, ".2f")),
    Measure("hd95_mm", ("surface", "hd95_mm")),
    Measure("normals_median_deg", ("surface", "normals_median_deg")),
    Measure("normals_p90_deg", ("surface", "normals_p90_deg")),
    Measure("volume_bias", ("surface", "volume_bias"), Headline("Volume bias", "%", 100, "+z.2f")),
    Measure("closed_manifold", ("surface", "closed_manifold")),
    Measure("self_intersections", ("surface", "self_intersections")),
    Measure("genus", ("surface", "genus")),
    Measure("genus_true", ("surface", "genus_true")),
    Measure("control_points", ("surface", "control_points")),
    Measure("control_bytes", ("surface", "control_bytes")),
    Measure("compactness", ("surface", "compactness")),
    Measure("boundary_points", ("curves", "boundary_points")),
    Measure("spline_control_points", ("curves", "control_points")),
    Measure("spline_dice_median", ("curves", "dice_median")),
    Measure("spline_dice_p5", ("curves", "dice_p5")),
    Measure("area_kept", ("curves", "area_kept")),
)

#: The measures that a page shows with its structure, and how.
HEADLINES = tuple((measure, measure.headline) for measure in MEASURES if measure.headline is not None)
