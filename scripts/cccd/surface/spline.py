"""One closed spline through a stack of slices: control mesh, fit, repair of what passes through itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cccd.containers import Frame
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.decimation import weigh_more
from cccd.geometry.distance import nearest_faces
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd.surface.checks import check_surface, lost_voxels
from cccd.surface.control_mesh import (
    SAME_HEIGHT,
    control_mesh,
    fewer_triangles,
    on_caps,
    open_edges,
    with_caps,
)
from cccd.surface.rough import counts, warnings_of
from cccd.surface.smooth_mesh import smooth_mesh
from cccd.surface.spline_fit import Target, fit_spline
from cccd.surface.stack import CONTROL_BYTES, SliceStack
from cccd.surface.surface import LoftedSurface
from cccd.tolerances import CONTROL_POINT_PIXELS

__all__ = ["SplineSolid", "loft_spline"]

#: Triangles of the coarse mesh for each mm^2, times a pixel's edge and by the curvature |k1| + |k2|. The
#: spline then is some .02 pixels off the mesh (rms) and as near to the truth as the mesh or nearer; with half
#: as many it is 5 to 9 % farther.
DENSITY = 0.1
#: The same by the square of the curvature: thin branches have as many triangles around as thick ones.
AROUND = 1.3
#: ... and by the square of the height where the scan cuts on both sides: a triangle reaches from rim to rim.
ACROSS = 2.0
#: Fewest triangles of a surface.
FEWEST = 60
#: The coarse mesh has at most an nth of the triangles that it is made of: bronchi of two pixels have an
#: eighth of them, and what needs more is noise.
COARSER = 5
#: Triangles that are chosen from: so many times those of the coarse mesh.
SPARE = 8
#: Band and rounds of the filter that leaves the curvature of the organ alone, for the number of triangles.
CALM_BAND, CALM_ROUNDS = 0.05, 30
#: Rounds of averaging the curvature with that of the neighbours.
CURVATURE_ROUNDS = 4
#: Rounds of finer quads where the surface lies off the mesh by so many pixels, loses a voxel or folds ...
REFINEMENTS, MOST_OFF = 1, 0.25
#: ... and further ones where it passes through itself: narrow gaps need quads no wider than they are.
CROSSING_REFINEMENTS = 2
#: A surface folds where it turns by more than this (radians) from a triangle to the next.
FOLD = 1.6
#: Area of a triangle whose edges are 1.
EQUILATERAL = np.sqrt(3) / 4
#: The mesh that is written has this many subdivisions: 32 triangles for each quad ...
DRAWN = 2
#: ... and one less (8 for each) where there are more quads than this, which would give 2 million triangles.
LARGE = 62_500
#: Moves that give the spline the mesh's volume.
VOLUME_ROUNDS = 2
#: Control points are rounded so many times finer where that keeps the surface from crossing itself.
FINER = 64


@dataclass(frozen=True, eq=False)
class SplineSolid:
    """A closed spline, in the plane's mm and height.

    Attributes
    ----------
    spline : ControlMesh
    mesh : Mesh
        Its limit surface at some samples, oriented outwards.
    stack : SliceStack
        What the slices hold.
    """

    spline: ControlMesh
    mesh: Mesh
    stack: SliceStack

    def to_world(self, frame: Frame) -> LoftedSurface:
        """Return the splines and their mesh in mm RAS."""
        affine = self.stack.plane_to_world(frame)
        spline, mesh, pairs = self.rounded(frame)
        # what is written is checked: rounding alone may make a surface pass through itself
        found = check_surface(mesh.transformed(np.asarray(np.linalg.inv(affine), float)), self.stack, pairs)
        told = [violation.line(affine) for violation in found]
        return LoftedSurface(spline.pieces(), mesh, frame, self.report(told))

    def rounded(self, frame: Frame) -> tuple[ControlMesh, Mesh, IntArray]:
        """Return the spline in mm RAS as it is stored, its mesh, and pairs (K, 2) of triangles that cross."""
        spline = self.spline.transformed(self.stack.plane_to_world(frame))
        return _rounded(spline, CONTROL_POINT_PIXELS * self.stack.pixel)

    def report(self, violations: Sequence[str] = ()) -> dict[str, Any]:
        """Count and measure, as plain JSON, with warnings; ``violations`` are lines for people."""
        count = len(self.spline.vertices)
        return {
            "control_points": count,
            "control_bytes": CONTROL_BYTES * count,
            "marching_cubes_bytes": self.stack.marching_cubes_bytes,
            "compactness": self.stack.marching_cubes_bytes / (CONTROL_BYTES * count),
            **counts(self.mesh, self.stack),
            "warnings": [*warnings_of(self.stack), *violations],
        }


def _rounded(spline: ControlMesh, tolerance: float) -> tuple[ControlMesh, Mesh, IntArray]:
    """Round control points, finer where the surface would pass through itself.

    Returns the tessellation too, and the pairs (K, 2) of its triangles that still do.
    """
    rounded = spline.rounded(tolerance)
    mesh = rounded.tessellate(_drawn(rounded))
    pairs = mesh.self_intersections()
    if len(pairs):
        finer = spline.rounded(tolerance / FINER)
        fine = finer.tessellate(_drawn(finer))
        none = fine.self_intersections()
        if not len(none):
            return finer, fine, none
    return rounded, mesh, pairs


def loft_spline(stack: SliceStack, wave: float | None = None) -> SplineSolid:
    """Fit a closed Catmull-Clark spline to what the slices tell.

    Parameters
    ----------
    stack : SliceStack
        What the slices hold.
    wave : float, optional
        Length in mm of the longest waves that are taken off; see `cccd.surface.smooth_mesh`.
    """
    mesh, ends = smooth_mesh(stack, wave), stack.distance.ends
    caps = on_caps(mesh, ends)
    wall = Mesh(mesh.vertices, mesh.faces[~caps]).compact()
    bent, area = _curvature(wall.low_passed(CALM_BAND, CALM_ROUNDS))
    # only what the scan cuts has rims
    rim = open_edges(wall.faces) if caps.any() else np.zeros((0, 2), np.int64)
    least = np.full(len(area), ACROSS / (ends[1] - ends[0]) ** 2)
    density = np.maximum(least, np.maximum(DENSITY * bent / stack.pixel, AROUND * bent**2))
    finest = max(FEWEST, len(mesh.faces) // COARSER, _triangles(wall, rim, area, least))
    most = min(finest, max(FEWEST, _triangles(wall, rim, area, density)))
    spline = _fit_and_refine(mesh, wall, (most, finest), stack)
    return SplineSolid(spline, spline.tessellate(_drawn(spline)), stack)


def _drawn(spline: ControlMesh) -> int:
    """How many subdivisions the mesh of a spline has."""
    return DRAWN - 1 if len(spline.quads) > LARGE else DRAWN


def _curvature(mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    """Sum of the principal curvatures' sizes (V,) at the vertices, in 1/mm, and their areas in mm^2."""
    edges, angles, lengths, _, _ = mesh.dihedrals
    count = len(mesh.vertices)
    total = np.bincount(edges.ravel(), np.repeat(angles * lengths / 2, 2), count).astype(float)
    area = mesh.vertex_areas
    bent, around = (mesh.averages(values, [CURVATURE_ROUNDS])[0] for values in (total, area))
    return np.divide(bent, around, out=np.zeros(count), where=around > 0), area


def _triangles(wall: Mesh, rim: IntArray, area: FloatArray, density: FloatArray) -> int:
    """How many triangles so dense a wall has, with its caps: one for each edge (E, 2) of their rims."""
    lengths = np.linalg.norm(wall.vertices[rim[:, 0]] - wall.vertices[rim[:, 1]], axis=1)
    return round(float(density @ area + lengths @ np.sqrt(EQUILATERAL * density[rim].mean(axis=1))))


def _fit_and_refine(mesh: Mesh, wall: Mesh, triangles: tuple[int, int], stack: SliceStack) -> ControlMesh:
    """Fit a spline to a mesh, without its caps a wall, with finer quads where it is amiss."""
    ends = stack.distance.ends
    most, finest = triangles
    fine = fewer_triangles(mesh, min(len(mesh.faces), SPARE * most), ends)
    weights, target = np.ones(len(fine.vertices)), Target.of(wall)
    best: tuple[int, ControlMesh] | None = None
    for attempt in range(1 + REFINEMENTS + CROSSING_REFINEMENTS):
        start, coarse = control_mesh(fine, most, ends, weights)
        fit = fit_spline(start, target)
        refined = attempt >= REFINEMENTS or most >= finest
        drawn = with_caps(fit.spline, ends).tessellate(1)
        wrong = _amiss(drawn, target, stack) if not refined else np.zeros(len(drawn.faces), np.bool_)
        if not wrong.any():
            for _ in range(VOLUME_ROUNDS):  # caps do not move, and rims only within their planes
                closed = with_caps(fit.spline, ends).tessellate(_drawn(start))
                fit.move((mesh.volume - closed.volume) / wall.area)
            simple = fit.untangle(_drawn(start))
            spline = with_caps(fit.spline, ends)
            if simple:
                return spline
            drawn = spline.tessellate(1)
            wrong[drawn.self_intersections().ravel()] = True
            if best is None or wrong.sum() < best[0]:
                best = int(wrong.sum()), spline
            if most >= finest:
                break
        there = np.zeros(len(coarse.faces), np.bool_)
        there[nearest_faces(drawn.vertices[np.unique(drawn.faces[wrong])], coarse)] = True
        weigh_more(weights, fine, coarse, there)
        most = min(len(coarse.faces) + 3 * int(there.sum()), finest)
    assert best is not None
    return best[1]


def _amiss(drawn: Mesh, target: Target, stack: SliceStack) -> BoolArray:
    """Which triangles (F,) lie off the mesh that they were fitted to, are folded, or are near lost voxels."""
    ends = stack.distance.ends
    cap = on_caps(drawn, ends, SAME_HEIGHT)
    off = np.abs(target.away(drawn.vertices, drawn.vertex_normals)[0]) > MOST_OFF * stack.pixel
    amiss = off[drawn.faces].any(axis=1) & ~cap
    _, angles, _, _, beside = drawn.dihedrals
    sharp = beside[angles > FOLD]
    amiss[sharp[cap[sharp[:, 0]] == cap[sharp[:, 1]]]] = True
    places, _ = lost_voxels(drawn, stack)
    if len(places):
        amiss[nearest_faces(places, drawn)] = True
    return amiss
