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
    """Say what of the slices is not in the surface: parts and cavities smaller than a number of voxels."""
    lines = [
        _gone(verb, one, many, stack.left_out[one], stack.smallest_voxels)
        for verb, one, many in (("dropped", "fragment", "fragments"), ("filled", "cavity", "cavities"))
        if stack.left_out[one]
    ]
    return [*lines, *stack.warnings]


def _gone(verb: str, one: str, many: str, volumes: Sequence[float], smallest_voxels: float) -> str:
    """Report what of some mm^3 each went as smaller than a number of voxels."""
    total = np.format_float_positional(sum(volumes), 3, fractional=False, trim="-")
    count, volume = len(volumes), f"{total} mm³" + (" in total" if len(volumes) > 1 else "")
    return (
        f"{verb} {count} {one if count == 1 else many} smaller than {smallest_voxels:g} voxels ({volume}); "
        "lower surface.smallest_part_voxels to keep them"
    )
