"""The closed mesh on which the slices' distances vanish, before anything is fitted to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cccd.containers import Frame
from cccd.geometry.mesh import Mesh
from cccd.surface.smooth_mesh import cut_at_ends, smooth_mesh
from cccd.surface.stack import SliceStack
from cccd.surface.surface import LoftedSurface

__all__ = ["RoughSolid", "counts", "loft_rough", "warnings_of"]

#: Waves of this many pixels and shorter go before walls are shared: what is left there bends their rims.
WAVE_PIXELS = 10.0


@dataclass(frozen=True, eq=False)
class RoughSolid:
    """A closed mesh without a spline, in the plane's mm and height.

    Attributes
    ----------
    mesh : Mesh
        Oriented outwards.
    stack : SliceStack
        What the slices hold.
    """

    mesh: Mesh
    stack: SliceStack

    def to_world(self, frame: Frame) -> LoftedSurface:
        """Return the mesh in mm RAS; it has no bodies, and is checked when its walls are shared."""
        affine = self.stack.plane_to_world(frame)
        report = {
            "control_points": 0,
            "control_bytes": 0,
            "marching_cubes_bytes": self.stack.marching_cubes_bytes,
            **counts(self.mesh, self.stack),
            "warnings": warnings_of(self.stack),
        }
        return LoftedSurface([], self.mesh.transformed(affine), frame, report)


def loft_rough(stack: SliceStack, wave: float | None = None) -> RoughSolid:
    """Mesh what the slices tell, without pixels' steps and without a spline.

    Walls between organs are smoothed together and have no spline: a mesh on which the distances vanish serves
    them as well, in a tenth of the time.

    Parameters
    ----------
    stack : SliceStack
        What the slices hold.
    wave : float, optional
        Length in mm of the longest waves that are taken off.
    """
    mesh = smooth_mesh(stack, WAVE_PIXELS * stack.pixel if wave is None else wave)
    return RoughSolid(cut_at_ends(mesh, stack.distance), stack)


def counts(mesh: Mesh, stack: SliceStack) -> dict[str, Any]:
    """Count what a closed mesh has, as plain JSON."""
    volumes = [piece.volume for piece in mesh.pieces()]
    return {
        "vertices": len(mesh.vertices),
        "triangles": len(mesh.faces),
        "bodies": sum(volume > 0 for volume in volumes),
        "cavities": sum(volume < 0 for volume in volumes),
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
