"""Messages to the user about a surface, one line each."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["left_out_warnings"]

_TO_KEEP = "lower surface.smallest_part_voxels to keep them"


def left_out_warnings(volumes: Sequence[float], smallest_voxels: float) -> list[str]:
    """Report the parts, in mm^3, that were left out as smaller than a number of voxels."""
    if not volumes:
        return []
    count, volume = len(volumes), f"{sum(volumes):.3g} mm³" + (" in total" if len(volumes) > 1 else "")
    fragments = "1 fragment" if count == 1 else f"{count} fragments"
    return [f"dropped {fragments} smaller than {smallest_voxels:g} voxels ({volume}); {_TO_KEEP}"]
