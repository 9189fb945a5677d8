"""One closed mesh from the patches of all tubes: joined, blended where they meet, of the slices' volume."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cccd.containers import Frame
from cccd.geometry.arrays import FloatArray
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import BlendingSettings, LoftSettings
from cccd.surface.blending import blend, blend_reach, blend_weights, points_on_surface, zero_surface
from cccd.surface.booleans import between_planes, unite
from cccd.surface.checks import Violation, check_surface
from cccd.surface.fairing import CELL_EDGES, fair, without_crossings
from cccd.surface.flat_caps import even_cap, run_on
from cccd.surface.offset import offset_patch
from cccd.surface.patches import FittedTubes
from cccd.surface.stack import CONTROL_BYTES, SliceStack
from cccd.surface.surface import Surface
from cccd.surface.target import TargetDistance
from cccd.surface.tessellation import tessellate
from cccd.surface.tubes import Tube
from cccd.surface.union import unite_on_grid

__all__ = ["Solid", "join_patches"]

#: Rounds in which the target takes over where the surface is not as it must be.
MENDING_ROUNDS = 1
#: Vertices within this share of a cell of where the scan cuts the organ are moved there before it is cut.
NEXT_TO_CUT = 0.2


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed mesh of all tubes together, in the plane's mm and height.

    Attributes
    ----------
    mesh : Mesh
        Oriented outwards.
    fitted : FittedTubes
        The patches that it was made of.
    offset : float
        mm by which it was then moved outwards.
    stack : SliceStack
        What the slices hold.
    violations : tuple of Violation
        What is not as it must be, and could not be mended.
    """

    mesh: Mesh
    fitted: FittedTubes
    offset: float
    stack: SliceStack
    violations: tuple[Violation, ...] = ()

    def to_world(self, frame: Frame) -> Surface:
        """Return the mesh, and the patches moved like it, in mm RAS."""
        affine = self.stack.plane_to_world(frame)
        up = np.array([0.0, 0.0, 1.0])
        moved = [offset_patch(patch, patch.sign * self.offset, up) for patch in self.fitted.patches()]
        patches = [
            replace(patch, control_points=_transformed(patch.control_points, affine)) for patch in moved
        ]
        told = [violation.line(affine) for violation in self.violations]
        return Surface(patches, self.mesh.transformed(affine), frame, self.report(told))

    def report(self, violations: Sequence[str] = ()) -> dict[str, Any]:
        """Count and measure, as plain JSON, with warnings; ``violations`` are lines for people."""
        tubes, stack = self.fitted.tubes, self.stack
        ends = [end for tube in tubes.tubes for end in tube.ends]
        control_bytes = CONTROL_BYTES * self.fitted.control_points
        return {
            "tubes": len(tubes.tubes),
            "depths": [tube.depth for tube in tubes.tubes],
            "cavities": sum(tube.hole for tube in tubes.tubes),
            "joined_ends": ends.count("joined"),
            "caps": ends.count("cap"),
            "openings": ends.count("opens"),
            "cut_ends": ends.count("cut"),
            "control_points": self.fitted.control_points,
            "control_bytes": control_bytes,
            "marching_cubes_bytes": stack.marching_cubes_bytes,
            "compactness": stack.marching_cubes_bytes / max(control_bytes, 1),
            "vertices": len(self.mesh.vertices),
            "triangles": len(self.mesh.faces),
            "mean_error_mm": float(np.mean([fit.error for fit in self.fitted.fits])),
            "warnings": [*tubes.warnings, *stack.warnings, *violations],
            "bodies": self.mesh.count_bodies(),
        }


def join_patches(fitted: FittedTubes, stack: SliceStack, settings: LoftSettings) -> Solid:
    """Join the patches of all tubes into one closed mesh.

    Their union, holes subtracted, is blended with the slices' distances along the lines where tubes meet, and
    in part in walls (`cccd.surface.blending.blend_weights`), moved outwards or inwards by a little so that it
    holds the volume of the slices, meshed, and rid of the grid's ripples. What the scan cuts runs on beyond
    until then, and is cut by a plane at last: so its rim is sharp. The level of probabilities is not moved,
    nor is what lies between slices of which only some were drawn.

    Parameters
    ----------
    fitted : FittedTubes
        The patches.
    stack : SliceStack
        What the slices hold.
    settings : LoftSettings
        ``edge_voxels``, shortened in thin organs; how blends fade, and how far the surface may move.
    """
    tubes, blending = fitted.tubes.tubes, settings.blending
    edge = settings.mesh_edge(stack.pixel)
    reach = blend_reach(stack, blending)
    cell = float(np.clip(stack.thickness / blending.thickness_cells, edge / 2, CELL_EDGES * edge))
    ends = _cut_heights(tubes)
    meshes = [
        _running_on(tessellate(patch, cell / CELL_EDGES), tube, ends, stack.run_on)
        for patch, tube in zip(fitted.patches(), tubes, strict=True)
    ]
    united, meeting = unite_on_grid(meshes, tubes, cell)
    strayed = _strayed(points_on_surface(united), stack.target, reach / 2)
    seams = np.concatenate([meeting, fitted.jumps, strayed])
    solid = _blended(fitted, united, seams, reach, ends, cell, stack, blending)
    for _ in range(MENDING_ROUNDS):
        if solid is None:
            break
        off = [violation.places for violation in solid.violations if violation.nearer]
        if not off:
            return solid
        seams = np.concatenate([seams, *off])
        solid = _blended(fitted, united, seams, reach, ends, cell, stack, blending)
    if solid is None:  # thinner than a cell everywhere
        return Solid(between_planes(unite(meshes, tubes), *ends), fitted, 0.0, stack)
    return solid


def _blended(
    fitted: FittedTubes,
    united: ScalarGrid,
    seams: FloatArray,
    reach: float,
    ends: tuple[float, float],
    cell: float,
    stack: SliceStack,
    blending: BlendingSettings,
) -> Solid | None:
    """Blend tubes with the target around points (P, 3), mesh and check them; None where nothing is left."""
    weight = blend_weights(united, seams, reach, stack.filled, blending)
    distance = blend(united, weight, stack.target, blending.fade_cells)
    if not np.any(distance.values < 0):
        return None
    mesh, offset = _of_volume(distance, ends, cell, stack, blending)
    return Solid(mesh, fitted, offset, stack, tuple(check_surface(mesh, stack)))


def _running_on(mesh: Mesh, tube: Tube, ends: tuple[float, float], by: float) -> Mesh:
    """Lengthen a tube's mesh by some mm beyond each end at which the scan cuts the organ."""
    for way, end, section, pole in zip(
        (-1, 1), ends, (tube.sections[0], tube.sections[-1]), tube.poles, strict=True
    ):
        if pole is None and 0 <= way * (section.z - end) < by:
            mesh = run_on(mesh, section.z, end + way * by)
    return mesh


def _of_volume(
    distance: ScalarGrid,
    ends: tuple[float, float],
    cell: float,
    stack: SliceStack,
    settings: BlendingSettings,
) -> tuple[Mesh, float]:
    """Mesh a grid's zero level, moved outwards to hold the slices' volume, and by how many mm it was moved.

    It is rid of the grid's ripples, and cut where the scan ends.
    """
    rough = zero_surface(distance)
    smooth = fair(rough, cell, stack.pixel, settings, stack.of_probability)
    offset = 0.0
    if not (stack.of_probability or stack.of_some_slices):
        most = settings.most_offset_pixels * stack.pixel
        offset = float(np.clip(_missing_height(_cut(smooth, ends, cell), ends, stack.volume), -most, most))
    moved = Mesh(smooth.vertices + offset * smooth.vertex_normals, smooth.faces)
    cut = _cut(without_crossings(moved, rough), ends, cell)
    for end in ends:
        cut = even_cap(cut, end, cell / CELL_EDGES)
    return cut, offset


def _cut(mesh: Mesh, ends: tuple[float, float], cell: float) -> Mesh:
    """Cut a mesh where the scan ends; vertices next to there are moved there, so that no sliver is left."""
    if not np.isfinite(ends).any():
        return mesh
    vertices = mesh.vertices.copy()
    for end in ends:
        vertices[np.abs(vertices[:, 2] - end) < NEXT_TO_CUT * cell, 2] = end
    return between_planes(Mesh(vertices, mesh.faces), *ends)


def _strayed(points: FloatArray, target: TargetDistance, most: float) -> FloatArray:
    """Pick points (P, 3) of a surface with no boundary of the organ within ``most`` mm of them, about.

    That is in their plane and along z. Where many tubes meet on one level little is left of their trunk, and
    a spline through what is left of its sections can swing far aside: as along seams, the target takes over.
    """
    along_z = np.array([[0, 0, -most], [0, 0, 0], [0, 0, most]])
    distance = np.array([target(points + step, -np.inf)[0] for step in along_z])
    return points[(distance.min(axis=0) > most) | (distance.max(axis=0) < -most)]


def _cut_heights(tubes: Sequence[Tube]) -> tuple[float, float]:
    """Heights in mm at which the scan cuts the organ below and above; infinite where it does not."""
    low = [tube.sections[0].z for tube in tubes if tube.ends[0] == "cut"]
    high = [tube.sections[-1].z for tube in tubes if tube.ends[1] == "cut"]
    return min(low, default=-np.inf), max(high, default=np.inf)


def _missing_height(mesh: Mesh, ends: tuple[float, float], volume: float) -> float:
    """How far in mm a mesh must move outwards, but for its planar caps, to hold a volume in mm^3."""
    on_cap = np.isin(mesh.vertices[:, 2], ends)
    wall = Mesh(mesh.vertices, mesh.faces[~on_cap[mesh.faces].all(axis=1)])
    return (volume - mesh.volume) / max(wall.area, 1e-9)


def _transformed(points: FloatArray, affine: FloatArray) -> FloatArray:
    """Points (..., 3) moved by an affine (4, 4)."""
    return np.ascontiguousarray(points @ affine[:3, :3].T + affine[:3, 3])
