"""One closed spline through a stack of slices: control mesh, fit, repair of what passes through itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from cccd.containers import Frame
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.decimation import ahead, weigh_more
from cccd.geometry.distance import nearest_faces
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd.surface.checks import check_surface, lost_voxels
from cccd.surface.control_mesh import (
    control_mesh,
    fewer_triangles,
    on_caps,
    open_edges,
    with_caps,
)
from cccd.surface.smooth_mesh import cut_at_ends, moved_to_ends, smooth_mesh, volume_between
from cccd.surface.spline_fit import Target, fit_spline
from cccd.surface.stack import CONTROL_BYTES, SliceStack, counts, warnings_of
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
#: Triangles for each edge of a rim where the scan cuts: with fewer it bulges over the edges beside it.
RIM = 3.0
#: Fewest triangles of a surface.
FEWEST = 100
#: The coarse mesh has at most an nth of the triangles that it is made of: bronchi of two pixels have an
#: eighth of them, and what needs more is noise.
COARSER = 5
#: Triangles that are chosen from: so many times those of the coarse mesh.
SPARE = 8
#: Band and rounds of the filter that leaves the curvature of the organ alone, for the number of triangles.
CALM_BAND, CALM_ROUNDS = 0.05, 30
#: Curvature times a pixel's edge that counts at most: a thread of less than a pixel needs no more triangles.
MOST_CURVED = 2.0
#: Rounds of averaging the curvature with that of the neighbours.
CURVATURE_ROUNDS = 4
#: Rounds of finer quads where the surface loses a voxel ...
REFINEMENTS = 3
#: ... and further ones where it passes through itself: narrow gaps need quads no wider than they are.
CROSSING_REFINEMENTS = 2
#: Where it is amiss the coarse mesh may have so many times the triangles that it has at most elsewhere.
AMISS_FINER = 2
#: Edges within so many pixels of lost voxels cost so many times as much.
BESIDE_LOST, LOST_DEARER = 3.0, 256.0
#: Area of a triangle whose edges are 1.
EQUILATERAL = np.sqrt(3) / 4
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
    mesh = rounded.tessellate()
    pairs = mesh.self_intersections()
    if len(pairs):
        finer = spline.rounded(tolerance / FINER)
        fine = finer.tessellate()
        fewer = fine.self_intersections()
        if len(fewer) < len(pairs):
            return finer, fine, fewer
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
    bent, area = _curvature(mesh.low_passed(CALM_BAND, CALM_ROUNDS))
    bent = np.minimum(bent, MOST_CURVED / stack.pixel)
    area *= (mesh.vertices[:, 2] > ends[0]) & (mesh.vertices[:, 2] < ends[1])
    least = np.full(len(area), ACROSS / (ends[1] - ends[0]) ** 2)
    density = np.maximum(least, np.maximum(AROUND * bent**2, DENSITY * bent / stack.pixel))
    finest = max(FEWEST, len(mesh.faces) // COARSER, round(float(least @ area)))
    most = min(finest, max(FEWEST, round(float(density @ area))))
    target, cut = Target.of(mesh), cut_at_ends(mesh, stack.distance)
    caps = _cap_triangles(cut, ends, density, target)
    spline = _fit_and_refine(cut, target, (caps + most, caps + finest), stack)
    return SplineSolid(spline, spline.tessellate(), stack)


def _curvature(mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    """Sum of the principal curvatures' sizes (V,) at the vertices, in 1/mm, and their areas in mm^2."""
    edges, angles, lengths, _, _ = mesh.dihedrals
    count = len(mesh.vertices)
    total = np.bincount(edges.ravel(), np.repeat(angles * lengths / 2, 2), count).astype(float)
    area = mesh.vertex_areas
    bent, around = (mesh.averaged(values, CURVATURE_ROUNDS) for values in (total, area))
    return np.divide(bent, around, out=np.zeros(count), where=around > 0), area


def _cap_triangles(cut: Mesh, ends: tuple[float, float], density: FloatArray, target: Target) -> int:
    """How many triangles the caps of a mesh need, as dense (V,) as it is: some for each edge of a rim."""
    caps = on_caps(cut, ends)
    if not caps.any():
        return 0
    rim = open_edges(cut.faces[~caps])
    lengths = np.linalg.norm(cut.vertices[rim[:, 0]] - cut.vertices[rim[:, 1]], axis=1)
    there = density[target.tree.query(cut.vertices[rim].mean(axis=1))[1]]
    return round(RIM * float(lengths @ np.sqrt(EQUILATERAL * there)))


def _fit_and_refine(cut: Mesh, target: Target, triangles: tuple[int, int], stack: SliceStack) -> ControlMesh:
    """Fit a spline that begins with some triangles of a mesh, with finer quads where it is amiss."""
    ends = stack.distance.ends
    volume = volume_between(target.mesh, ends)
    most, finest = triangles
    fine = moved_to_ends(ahead(cut, SPARE * most), stack.distance)
    fine = fewer_triangles(fine, SPARE * most, ends)
    weights = np.ones(len(fine.vertices))
    best: tuple[int, ControlMesh] | None = None
    for attempt in range(1 + REFINEMENTS + CROSSING_REFINEMENTS):
        # even weights are left out: a faster collapse takes none
        start, coarse = control_mesh(fine, most, ends, weights if attempt else None)
        fit = fit_spline(start, target)
        fit.hold(volume, 1)
        places = lost = _lost(fit.spline, stack) if attempt < REFINEMENTS else np.zeros((0, 3))
        if not len(places):
            fit.hold(volume)
            places = fit.untangle()
            if best is None or len(places) < best[0]:
                best = len(places), fit.spline
            if not len(places) or most >= AMISS_FINER * finest:
                break
        if len(lost):
            if not attempt and len(lost_voxels(fine, stack)[0]):  # it is sought among more triangles
                fine = moved_to_ends(ahead(cut, max(len(cut.faces) // 2, 2 * SPARE * most)), stack.distance)
                fine = fewer_triangles(fine, SPARE * most, ends, _dearer(fine, lost, stack))
                weights = np.ones(len(fine.vertices))
            else:
                weights *= _dearer(fine, lost, stack)
        there = np.zeros(len(coarse.faces), np.bool_)
        there[nearest_faces(places, coarse)] = True
        there = coarse.with_neighbours(there)
        weigh_more(weights, fine, coarse, there)
        most = min(len(coarse.faces) + 3 * int(there.sum()), AMISS_FINER * finest)
    assert best is not None
    return with_caps(best[1], ends)


def _dearer(mesh: Mesh, lost: FloatArray, stack: SliceStack) -> FloatArray:
    """Weights (V,) for the collapse of a mesh that keep it fine beside lost voxels (P, 3)."""
    return np.where(cKDTree(lost).query(mesh.vertices)[0] < BESIDE_LOST * stack.pixel, LOST_DEARER, 1.0)


def _lost(spline: ControlMesh, stack: SliceStack) -> FloatArray:
    """Places (P, 3) of voxels that lie on the wrong side of a spline."""
    return lost_voxels(with_caps(spline, stack.distance.ends).tessellate(1), stack)[0]
