"""One closed spline through a stack of slices: control mesh, fit, repair of what passes through itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cccd.containers import Frame
from cccd.geometry.arrays import BoolArray, IntArray
from cccd.geometry.decimation import collapse_edges, weigh_more
from cccd.geometry.distance import nearest_faces
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import SHARP, ControlMesh, quad_edges
from cccd.surface.booleans import between_planes
from cccd.surface.checks import check_surface
from cccd.surface.control_mesh import control_mesh
from cccd.surface.sampled import SampledDistance
from cccd.surface.spline_fit import SAMPLED, SplineFit, fit_spline
from cccd.surface.stack import CONTROL_BYTES, SliceStack
from cccd.surface.surface import Surface
from cccd.surface.told import left_out_warnings
from cccd.tolerances import CONTROL_POINT_PIXELS

__all__ = ["SplineSolid", "loft_spline"]

#: Triangles of the coarse mesh for each pixel of total curvature: the integral of |k1| + |k2|, as dihedral
#: angles have it, over the surface. With their size an edge's sagitta is some tenth of a pixel everywhere.
DENSITY = 0.15
#: Fewest triangles of a piece.
FEWEST = 60
#: The first mesh has this many times the triangles of the coarse one: enough to choose from.
SPARE = 8
#: Band and rounds of the filter that takes pixels' steps off before curvature is summed up.
CALM_BAND, CALM_ROUNDS = 0.02, 30
#: Rounds of finer quads where the surface passes through itself, or lies off the distances by so many pixels.
REFINEMENTS, MOST_OFF = 1, 0.5
#: Rounds in which what has creases grows, until nothing passes through itself.
CREASE_ROUNDS = 4
#: Vertices within this share of a pixel of where the scan ends are moved there before the mesh is cut.
NEXT_TO_CUT = 0.2


@dataclass(frozen=True, eq=False)
class SplineSolid:
    """A closed spline, in the plane's mm and height.

    Attributes
    ----------
    spline : ControlMesh
    mesh : Mesh
        Its limit surface at some samples, oriented outwards.
    left_out : list of float
        mm^3 of each part that is too small.
    creased : int
        Edges that were made sharp where the smooth surface would have passed through itself.
    """

    spline: ControlMesh
    mesh: Mesh
    left_out: list[float]
    creased: int
    stack: SliceStack
    smallest_voxels: float

    def to_world(self, frame: Frame) -> Surface:
        """Return the splines and their mesh in mm RAS."""
        affine = self.stack.plane_to_world(frame)
        tolerance = CONTROL_POINT_PIXELS * self.stack.pixel
        spline = self.spline.transformed(affine).rounded(tolerance)
        told = [violation.line(affine) for violation in check_surface(self.mesh, self.stack)]
        return Surface([], spline.tessellate(SAMPLED), frame, self.report(told), spline.pieces())

    def report(self, violations: Sequence[str] = ()) -> dict[str, Any]:
        """Count and measure, as plain JSON, with warnings; ``violations`` are lines for people."""
        stack, pieces = self.stack, self.mesh.pieces()
        count = len(self.spline.vertices)
        volumes = [piece.volume for piece in pieces]
        return {
            "control_points": count,
            "control_bytes": CONTROL_BYTES * count,
            "marching_cubes_bytes": stack.marching_cubes_bytes,
            "compactness": stack.marching_cubes_bytes / (CONTROL_BYTES * count),
            "vertices": len(self.mesh.vertices),
            "triangles": len(self.mesh.faces),
            "bodies": sum(volume > 0 for volume in volumes),
            "cavities": sum(volume < 0 for volume in volumes),
            "cut_ends": int(np.isfinite(stack.cut_heights).sum()),
            "creased_edges": self.creased,
            "warnings": [
                *left_out_warnings(self.left_out, self.smallest_voxels),
                *stack.warnings,
                *violations,
            ],
        }


def loft_spline(stack: SliceStack, smallest_voxels: float) -> SplineSolid:
    """Fit a closed Catmull-Clark spline to what the slices tell.

    Parameters
    ----------
    stack : SliceStack
        What the slices hold.
    smallest_voxels : float
        Parts and cavities of less volume are left out, but for the largest.
    """
    distance = SampledDistance.of(stack)
    rough = _cut(distance.zero_surface(), distance)
    rough, left_out = _without_small(rough, smallest_voxels * float(stack.voxel.prod()))
    calm = rough.low_passed(CALM_BAND, CALM_ROUNDS)
    most = max(FEWEST, round(DENSITY * calm.curvature_per_area * calm.area / distance.pixel))
    fine = collapse_edges(rough, SPARE * most, parts=_flat_parts(rough, distance.ends))
    volume = None if stack.of_probability or stack.of_some_slices else stack.volume
    fit, creased = _fit_and_refine(fine, most, distance, volume)
    spline = fit.spline.moved(fit.points)
    return SplineSolid(spline, fit.mesh, left_out, creased, stack, smallest_voxels)


def _cut(mesh: Mesh, distance: SampledDistance) -> Mesh:
    """Cut a mesh by planes where the scan ends."""
    if not np.isfinite(distance.ends).any():
        return mesh
    vertices = mesh.vertices.copy()
    for end in distance.ends:
        vertices[np.abs(vertices[:, 2] - end) < NEXT_TO_CUT * distance.level_step, 2] = end
    cut = between_planes(Mesh(vertices, mesh.faces), *distance.ends)
    for end in distance.ends:
        cut.vertices[np.abs(cut.vertices[:, 2] - end) < 1e-9, 2] = end
    return cut


def _flat_parts(mesh: Mesh, ends: tuple[float, float]) -> IntArray:
    at = np.isin(mesh.vertices[:, 2], [end for end in ends if np.isfinite(end)])
    return np.asarray(np.all(at[mesh.faces], axis=1), np.int64)


def _without_small(mesh: Mesh, least: float) -> tuple[Mesh, list[float]]:
    """Leave out pieces that hold less than so many mm^3, but for the largest; what they held."""
    pieces = sorted(mesh.pieces(), key=lambda piece: -abs(piece.volume))
    kept = [piece for n, piece in enumerate(pieces) if n == 0 or abs(piece.volume) >= least]
    starts = np.cumsum([0, *(len(piece.vertices) for piece in kept)])
    faces = [piece.faces + start for piece, start in zip(kept, starts, strict=False)]
    whole = Mesh(np.concatenate([piece.vertices for piece in kept]), np.concatenate(faces))
    return whole, [abs(piece.volume) for piece in pieces[len(kept) :]]


def _fit_and_refine(
    fine: Mesh, most: int, distance: SampledDistance, volume: float | None
) -> tuple[SplineFit, int]:
    """Fit a spline; where it strays or passes through itself with finer quads, and with creases at last."""
    weights = np.ones(len(fine.vertices))
    spline, coarse = control_mesh(fine, most, distance.ends, weights)
    fit = fit_spline(spline, distance, volume)
    for _ in range(REFINEMENTS):
        amiss = fit.strays(MOST_OFF) | _passing(fit.mesh)
        if not amiss.any():
            break
        places = fit.mesh.vertices[np.unique(fit.mesh.faces[amiss])]
        there = np.zeros(len(coarse.faces), np.bool_)
        there[nearest_faces(places, coarse)] = True
        weigh_more(weights, fine, coarse, there)
        most = len(coarse.faces) + 3 * int(there.sum())
        spline, coarse = control_mesh(fine, most, distance.ends, weights)
        fit = fit_spline(spline, distance, volume)
    return _creased(fit, _passing(fit.mesh))


def _passing(mesh: Mesh) -> BoolArray:
    """Which triangles (F,) pass through others."""
    passing = np.zeros(len(mesh.faces), np.bool_)
    passing[mesh.self_intersections().ravel()] = True
    return passing


def _creased(fit: SplineFit, passing: BoolArray) -> tuple[SplineFit, int]:
    """Go back to the first mesh's flat quads, with creases, where the spline passes through itself.

    That mesh does not pass through itself, whatever the fit makes of it.
    """
    spline = fit.spline
    marked = np.zeros(len(spline.quads), np.bool_)
    edges, side = quad_edges(spline.quads)
    points, creases = fit.points, spline.creases
    for _ in range(CREASE_ROUNDS):
        if not passing.any():
            break
        # samples of a quad follow each other by the number of quads
        marked[np.flatnonzero(passing) % len(marked)] = True
        near = np.zeros(len(points), np.bool_)
        near[spline.quads[marked]] = True
        marked |= near[spline.quads].any(axis=1)
        near[spline.quads[marked]] = True
        points = np.where(near[:, None], spline.vertices, points)
        sharp = np.unique(side[marked])
        creases = np.unique(np.sort(np.concatenate([spline.creases, edges[sharp]]), axis=1), axis=0)
        flat = ControlMesh(points, spline.quads, creases, np.full(len(creases), SHARP))
        fit = fit.with_spline(flat)
        passing = _passing(fit.mesh)
    return fit, len(creases) - len(spline.creases)
