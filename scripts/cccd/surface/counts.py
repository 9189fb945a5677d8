"""What a surface's report counts, and what of the slices it says is not in the surface."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cccd.geometry.mesh import Mesh
from cccd.surface.stack import SliceStack

__all__ = ["counts", "warnings_of"]


def counts(mesh: Mesh, stack: SliceStack) -> dict[str, Any]:
    """Count what a closed mesh has, as plain JSON."""
    volumes = mesh.piece_volumes
    return {
        "vertices": len(mesh.vertices),
        "triangles": len(mesh.faces),
        "bodies": int(np.count_nonzero(volumes > 0)),
        "cavities": int(np.count_nonzero(volumes < 0)),
        "cut_ends": int(np.isfinite(stack.distance.ends).sum()),
    }


def warnings_of(stack: SliceStack) -> list[str]:
    """Say what of the slices is not in the surface: parts smaller than a number of voxels."""
    return [*_left_out_warnings(stack.left_out, stack.smallest_voxels), *stack.warnings]


def _left_out_warnings(volumes: Sequence[float], smallest_voxels: float) -> list[str]:
    """Report the parts, in mm^3, that were left out as smaller than a number of voxels."""
    if not volumes:
        return []
    count, volume = len(volumes), f"{sum(volumes):.3g} mm³" + (" in total" if len(volumes) > 1 else "")
    fragments = "1 fragment" if count == 1 else f"{count} fragments"
    return [
        f"dropped {fragments} smaller than {smallest_voxels:g} voxels ({volume}); lower "
        "surface.smallest_part_voxels to keep them"
    ]
