"""One closed spline through a stack of slices: control mesh, fit, repair of what passes through itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from cccd.containers import Frame
from cccd.geometry.arrays import BoolArray, FloatArray
from cccd.geometry.decimation import collapse_edges, weigh_more
from cccd.geometry.distance import nearest_faces
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd.surface.booleans import between_planes
from cccd.surface.checks import check_surface
from cccd.surface.control_mesh import control_mesh, on_caps, with_caps
from cccd.surface.sampled import SampledDistance
from cccd.surface.spline_fit import Curvature, SplineFit, fit_spline
from cccd.surface.stack import CONTROL_BYTES, SliceStack
from cccd.surface.surface import Surface
from cccd.surface.told import left_out_warnings
from cccd.tolerances import CONTROL_POINT_PIXELS

__all__ = ["SplineSolid", "loft_spline"]

#: Triangles of the coarse mesh for each mm^2, times a pixel's edge and by the curvature |k1| + |k2|: with
#: their size an edge's sagitta is then some tenth of a pixel everywhere.
DENSITY = 0.1
#: The same by the square of the curvature: thin branches have as many triangles around as thick ones.
AROUND = 0.7
#: Fewest triangles of a surface.
FEWEST = 60
#: The first mesh has this many times the triangles of the coarse one: enough to choose from.
SPARE = 8
#: Band and rounds of the filter that takes pixels' steps off before curvature is taken.
CALM_BAND, CALM_ROUNDS = 0.1, 30
#: Rounds of averaging the curvature with that of the neighbours.
CURVATURE_ROUNDS = 4
#: Rounds of finer quads where the surface passes through itself, folds, or lies off the distances by so many
#: pixels.
REFINEMENTS, MOST_OFF = 2, 0.5
#: A surface folds where it turns by more than this (radians) from a triangle to the next.
FOLD = 1.6
#: The mesh has this many subdivisions: 32 triangles for each quad.
DRAWN = 2
#: mm: points so near to where the scan ends lie there.
SAME_HEIGHT = 1e-6
#: Moves that hold the volume.
VOLUME_ROUNDS = 2
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
    """

    spline: ControlMesh
    mesh: Mesh
    left_out: list[float]
    stack: SliceStack
    smallest_voxels: float

    def to_world(self, frame: Frame) -> Surface:
        """Return the splines and their mesh in mm RAS."""
        affine = self.stack.plane_to_world(frame)
        tolerance = CONTROL_POINT_PIXELS * self.stack.pixel
        spline = self.spline.transformed(affine).rounded(tolerance)
        told = [violation.line(affine) for violation in check_surface(self.mesh, self.stack)]
        return Surface([], spline.tessellate(DRAWN), frame, self.report(told), spline.pieces())

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
    bent, area = _curvature(calm)
    density = np.maximum(DENSITY * bent / distance.pixel, AROUND * bent**2)
    most = max(FEWEST, round(float(density @ area)))
    fine = collapse_edges(rough, SPARE * most, parts=on_caps(rough, distance.ends).astype(np.int64))
    tree = cKDTree(rough.vertices)
    volume = None if stack.of_probability or stack.of_some_slices else stack.volume
    spline = _fit_and_refine(fine, most, distance, volume, lambda points: bent[tree.query(points)[1]])
    return SplineSolid(spline, spline.tessellate(DRAWN), left_out, stack, smallest_voxels)


def _curvature(mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    """Sum of the principal curvatures' sizes (V,) at the vertices, in 1/mm, and their areas in mm^2."""
    edges, angles, lengths, _, _ = mesh.dihedrals
    count = len(mesh.vertices)
    total = np.bincount(edges.ravel(), np.repeat(angles * lengths / 2, 2), count).astype(float)
    area = np.bincount(mesh.faces.ravel(), np.repeat(mesh.face_areas / 3, 3), count).astype(float)
    bent, around = (mesh.averages(values, [CURVATURE_ROUNDS])[0] for values in (total, area))
    return np.divide(bent, around, out=np.zeros(count), where=around > 0), area


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


def _without_small(mesh: Mesh, least: float) -> tuple[Mesh, list[float]]:
    """Leave out pieces that hold less than so many mm^3, but for the largest; what they held."""
    pieces = sorted(mesh.pieces(), key=lambda piece: -abs(piece.volume))
    kept = [piece for n, piece in enumerate(pieces) if n == 0 or abs(piece.volume) >= least]
    starts = np.cumsum([0, *(len(piece.vertices) for piece in kept)])
    faces = [piece.faces + start for piece, start in zip(kept, starts, strict=False)]
    whole = Mesh(np.concatenate([piece.vertices for piece in kept]), np.concatenate(faces))
    return whole, [abs(piece.volume) for piece in pieces[len(kept) :]]


def _fit_and_refine(
    fine: Mesh, most: int, distance: SampledDistance, volume: float | None, curvature: Curvature
) -> ControlMesh:
    """Fit a spline; where it is amiss, with finer quads."""
    weights = np.ones(len(fine.vertices))
    wall, coarse = control_mesh(fine, most, distance.ends, weights)
    fit = fit_spline(wall, distance, curvature)
    for _ in range(REFINEMENTS):
        mesh = with_caps(fit.spline, distance.ends).tessellate(1)
        amiss = _amiss(mesh, distance)
        if not amiss.any():
            break
        places = mesh.vertices[np.unique(mesh.faces[amiss])]
        there = np.zeros(len(coarse.faces), np.bool_)
        there[nearest_faces(places, coarse)] = True
        weigh_more(weights, fine, coarse, there)
        most = len(coarse.faces) + 3 * int(there.sum())
        wall, coarse = control_mesh(fine, most, distance.ends, weights)
        fit = fit_spline(wall, distance, curvature)
    return _of_volume(fit, volume)


def _amiss(mesh: Mesh, distance: SampledDistance) -> BoolArray:
    """Which triangles (F,) pass through others, are folded, or lie off the distances' zero."""
    slope = np.maximum(1, distance.slopes(mesh.vertices, mesh.vertex_normals))
    off = np.abs(distance(mesh.vertices)) > MOST_OFF * distance.pixel * slope
    cap = _on_caps(mesh, distance.ends)
    amiss = off[mesh.faces].any(axis=1) & ~cap
    amiss[mesh.self_intersections().ravel()] = True
    _, angles, _, _, beside = mesh.dihedrals
    folded = beside[angles > FOLD]
    amiss[folded[cap[folded[:, 0]] == cap[folded[:, 1]]]] = True
    return amiss


def _on_caps(mesh: Mesh, ends: tuple[float, float]) -> BoolArray:
    """Which triangles (F,) lie on planar caps at two heights."""
    height = mesh.vertices[:, 2]
    return np.any([np.all((np.abs(height - end) < SAME_HEIGHT)[mesh.faces], axis=1) for end in ends], axis=0)


def _of_volume(fit: SplineFit, volume: float | None) -> ControlMesh:
    """Close a fitted wall, moved by a little to hold a volume in mm^3."""
    ends = fit.distance.ends
    spline = with_caps(fit.spline, ends)
    if volume is None:
        return spline
    for _ in range(VOLUME_ROUNDS):
        fit.hold_volume(volume - spline.tessellate(DRAWN).volume)
        spline = with_caps(fit.spline, ends)
    return spline
