"""What a user is told of a surface in one line each."""

from __future__ import annotations

from collections.abc import Sequence

from cccd.geometry.mesh import Mesh
from cccd.surface.stack import SliceStack

__all__ = ["left_out_warnings", "volume_warnings"]

#: A volume that is off by more than this share of the slices' is told.
TOLD_VOLUME = 0.03


def left_out_warnings(volumes: Sequence[float], smallest_voxels: float) -> list[str]:
    """Report the parts, in mm^3, that were left out as smaller than a number of voxels."""
    if not volumes:
        return []
    count, volume = len(volumes), f"{sum(volumes):.3g} mm³"
    parts, verb = ("1 part", "is") if count == 1 else (f"{count} parts", "are")
    size = f"{volume}, fewer than {smallest_voxels:g} voxels" + (" each" if count > 1 else "")
    return [f"{parts} ({size}) {verb} not in the surface"]


def volume_warnings(mesh: Mesh, stack: SliceStack) -> list[str]:
    """Report where moving the surface as far as it may did not give it the slices' volume."""
    share = mesh.volume / stack.volume
    if stack.of_probability or stack.of_some_slices or abs(share - 1) <= TOLD_VOLUME:
        return []
    return [f"the surface holds {share:.0%} of its slices' volume: in places it is as thin as a voxel"]
