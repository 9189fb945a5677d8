"""One closed mesh from the patches of all tubes: joined, blended where they meet, of the slices' volume."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cccd.containers import Frame
from cccd.geometry.bsplines import Patch
from cccd.geometry.mesh import Mesh
from cccd.surface.blending import blended
from cccd.surface.booleans import combine, solid, triangles
from cccd.surface.evaluate import swollen, tessellate
from cccd.surface.matching import SMALLEST_PART_VOXELS
from cccd.surface.patches import FittedTubes
from cccd.surface.stack import CONTROL_BYTES, SliceStack
from cccd.surface.surface import Surface
from cccd.surface.tubes import Tube

__all__ = ["Solid", "join_patches"]

#: The whole surface moves by at most this many pixels to regain the volume of the slices.
MOST_OFFSET_PIXELS = 0.25
#: Planar caps stay where they are when the surface moves; the rest follows within this many cells of them.
CAP_CELLS, SAME_PLANE = 3.0, 1e-3
#: Cells of the grid on which the surface is meshed, in edges (marching cubes' edges are a little longer),
#: and how many of them thin organs have at least through their thickness.
CELL_EDGES, THICKNESS_CELLS = 0.8, 25


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed mesh of all tubes together, in the plane's mm and height.

    Attributes
    ----------
    vertices, faces : (V, 3) float64 mm, (F, 3) int64
        Outwards.
    fitted : FittedTubes
        The patches that it was made of.
    offset : float
        mm by which it was then moved outwards.
    stack : SliceStack
        What the slices hold.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    fitted: FittedTubes
    offset: float
    stack: SliceStack

    def to_world(self, frame: Frame) -> Surface:
        """Give the mesh, and the patches moved like it, in mm RAS."""
        affine = _plane_to_world(frame, self.stack.origin)
        vertices = _transformed(self.vertices, affine)
        mirrored = np.linalg.det(affine[:3, :3]) < 0
        faces = np.ascontiguousarray(self.faces[:, ::-1]) if mirrored else self.faces
        up = np.array([0.0, 0.0, 1.0])
        moved = [swollen(patch, patch.sign * self.offset, up) for patch in self.fitted.patches()]
        patches = [
            replace(patch, control_points=_transformed(patch.control_points, affine)) for patch in moved
        ]
        return Surface(patches, vertices, faces, frame, self.report())

    def report(self) -> dict[str, Any]:
        """Count and measure, as plain JSON, with warnings."""
        ends = [end for tube in self.fitted.tubes.tubes for end in tube.ends]
        control_bytes = CONTROL_BYTES * self.fitted.control_points
        left_out = self.fitted.tubes.left_out
        return {
            "tubes": len(self.fitted.tubes.tubes),
            "cavities": sum(tube.hole for tube in self.fitted.tubes.tubes),
            "joined_ends": ends.count("joined"),
            "caps": ends.count("cap"),
            "openings": ends.count("opens"),
            "cut_ends": ends.count("cut"),
            "control_points": self.fitted.control_points,
            "control_bytes": control_bytes,
            "marching_cubes_bytes": self.stack.marching_cubes_bytes,
            "compactness": self.stack.marching_cubes_bytes / max(control_bytes, 1),
            "vertices": len(self.vertices),
            "triangles": len(self.faces),
            "mean_error_mm": float(np.mean([fit.error for fit in self.fitted.fits])),
            "warnings": [
                f"{left_out} parts of fewer than {SMALLEST_PART_VOXELS} voxels are not in the surface"
            ]
            if left_out
            else [],
            "bodies": Mesh(self.vertices, self.faces).count_bodies(),
        }


def join_patches(fitted: FittedTubes, stack: SliceStack, blend_reach: float, edge: float) -> Solid:
    """Join the patches of all tubes into one closed mesh.

    Their union, holes subtracted, is blended along the lines where tubes meet, meshed, and moved outwards
    or inwards by a little so that it holds the volume of the slices.

    Parameters
    ----------
    fitted : FittedTubes
        The patches.
    stack : SliceStack
        What the slices hold.
    blend_reach : float
        mm to either side of where tubes meet over which the surface gives way to the target field.
    edge : float
        Edge length in mm of the mesh's triangles; shorter in thin organs.
    """
    tubes = fitted.tubes.tubes
    cell = float(np.clip(stack.thickness / THICKNESS_CELLS, edge / 2, CELL_EDGES * edge))
    vertices, faces, origins = _united(fitted.patches(), tubes, cell / CELL_EDGES)
    seams = np.concatenate([_seams(vertices, faces, origins), fitted.jumps])
    level_set = blended(vertices, faces, seams, stack.target, blend_reach, cell)
    meshed = level_set.mesh()
    if len(meshed[1]) == 0:
        return Solid(vertices, faces, fitted, 0.0, stack)
    planes = _cap_planes(tubes)
    offset = _volume_offset(*meshed, planes, stack, cell)
    vertices, faces = level_set.mesh(offset)
    return Solid(_with_level_caps(vertices, planes, offset, cell), faces, fitted, offset, stack)


def _united(
    patches: Sequence[Patch], tubes: Sequence[Tube], edge: float
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Vertices, faces of the union of all patches minus the holes, and which patch (F,) each face is from."""
    bodies = [solid(*tessellate(patch, edge)) for patch in patches]
    joined = triangles(combine(bodies, [tube.hole for tube in tubes], [tube.depth for tube in tubes]))
    return joined if len(joined[1]) else triangles(bodies[0])  # holes may be as wide as what they are in


def _seams(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], origins: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Vertices (P, 3) at which faces (F,) of different origin meet."""
    first = np.full(len(vertices), origins.max() + 1)
    last = np.full(len(vertices), origins.min() - 1)
    for corner in range(3):
        np.minimum.at(first, faces[:, corner], origins)
        np.maximum.at(last, faces[:, corner], origins)
    return vertices[first < last]


def _cap_planes(tubes: Sequence[Tube]) -> list[tuple[float, int]]:
    """Heights in mm at which the scan cuts the organ, and whether its outside is below (-1) or above (1)."""
    low = {(tube.sections[0].z, -1) for tube in tubes if tube.ends[0] == "cut"}
    high = {(tube.sections[-1].z, 1) for tube in tubes if tube.ends[1] == "cut"}
    return sorted(low | high)


def _volume_offset(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    planes: Sequence[tuple[float, int]],
    stack: SliceStack,
    cell: float,
) -> float:
    """By how many mm a mesh must move outwards, but for its planar caps, to hold the slices' volume."""
    heights = [z for z, _ in planes]
    on_cap = np.isclose(vertices[:, 2:], heights, rtol=0, atol=SAME_PLANE * cell).any(axis=1)
    wall = Mesh(vertices, faces[~on_cap[faces].all(axis=1)]).area
    most = MOST_OFFSET_PIXELS * stack.pixel
    missing = stack.volume - Mesh(vertices, faces).volume
    return float(np.clip(missing / max(wall, 1e-9), -most, most))


def _with_level_caps(
    vertices: NDArray[np.float64], planes: Sequence[tuple[float, int]], offset: float, cell: float
) -> NDArray[np.float64]:
    """Vertices of a mesh that moved outwards, with its planar caps back where they were."""
    z = vertices[:, 2].copy()
    for plane, outwards in planes:
        away = np.abs(z - (plane + outwards * offset)) / cell
        z -= outwards * offset * np.clip(1 - away / CAP_CELLS, 0, 1)
        z[away < SAME_PLANE] = plane
    return np.column_stack([vertices[:, :2], z])


def _plane_to_world(frame: Frame, origin: NDArray[np.int64]) -> NDArray[np.float64]:
    """Affine (4, 4) from the plane's mm and height in mm to mm RAS."""
    scale = np.diag([*(1 / frame.pixel_spacing), 1 / frame.slice_spacing, 1.0])
    scale[:2, 3] = origin
    return frame.stack_affine @ scale


def _transformed(points: NDArray[np.float64], affine: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (..., 3) moved by an affine (4, 4)."""
    return np.ascontiguousarray(points @ affine[:3, :3].T + affine[:3, 3])
