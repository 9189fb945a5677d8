"""Limits that ``cccd compare`` holds figures against, and its default tolerance; quick to load."""

from __future__ import annotations

from typing import NamedTuple

#: Surfaces this near to each other agree, for the surface Dice: about a voxel of most scans.
TOLERANCE_MM = 1.0


class Limit(NamedTuple):
    """A figure's limit: the command's option, what the figure is called, its unit, and when it is missed."""

    option: str
    name: str
    unit: str
    missed: str

    def is_missed(self, value: float | None, limit: float) -> bool:
        """Whether a figure is beyond the limit; one that is not there is. A bias counts either way."""
        if value is None:
            return True
        return value < limit if self.option.startswith("min") else abs(value) > limit


#: By figure.
LIMITS = {
    "dice": Limit("min-dice", "Dice", "SHARE", "a Dice is below"),
    "surface_dice": Limit("min-surface-dice", "surface Dice", "SHARE", "a surface Dice is below"),
    "assd_mm": Limit("max-assd", "ASSD", "MM", "an average symmetric distance is above"),
    "hd95_mm": Limit("max-hd95", "HD95", "MM", "a 95th percentile of the distances is above"),
    "hausdorff_mm": Limit("max-hausdorff", "Hausdorff distance", "MM", "a largest distance is above"),
    "volume_bias": Limit(
        *("max-volume-bias", "volume bias", "SHARE"),
        "volumes differ by more, as a share of B's: 0.02 is 2 percent",
    ),
}
