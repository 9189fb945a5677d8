"""What a user is told of a surface in one line each."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["left_out_warnings"]


def left_out_warnings(volumes: Sequence[float], smallest_voxels: float) -> list[str]:
    """Report the parts, in mm^3, that were left out as smaller than a number of voxels."""
    if not volumes:
        return []
    count, volume = len(volumes), f"{sum(volumes):.3g} mm³"
    parts, verb = ("1 part", "is") if count == 1 else (f"{count} parts", "are")
    size = f"{volume}, fewer than {smallest_voxels:g} voxels" + (" each" if count > 1 else "")
    return [f"{parts} ({size}) {verb} not in the surface"]
