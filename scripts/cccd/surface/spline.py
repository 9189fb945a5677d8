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
from cccd.surface.checks import check_surface, places_off_slices
from cccd.surface.control_mesh import control_mesh, fewer_triangles, with_caps
from cccd.surface.smooth_mesh import cut_at_ends, moved_to_ends, smooth_mesh, volume_between
from cccd.surface.spline_fit import Target, fit_spline
from cccd.surface.stack import CONTROL_BYTES, SliceStack, counts, warnings_of
from cccd.surface.surface import LoftedSurface
from cccd.tolerances import CONTROL_POINT_PIXELS

#: The coarse mesh begins with one triangle for so many of the mesh that it is made of, and has at most one
#: for so many: what needs more is noise.
COARSEST, COARSER = 150, 5
#: Fewest triangles of a surface.
FEWEST = 100
#: Triangles that are chosen from: so many times those that are left.
SPARE = 8
#: The spline shall be off the mesh by so many pixels (rms): with .03 it is 4 % farther from the truth, with
#: .01 no nearer. A triangle that is n times as far off becomes n.
OFF_PIXELS = 0.024
#: Where the surface is amiss a triangle becomes so many.
AMISS_SPLIT = 4.0
#: Rounds of finer quads where the surface loses a voxel ...
REFINEMENTS = 3
#: ... and further ones where it passes through itself: narrow gaps need quads no wider than they are.
CROSSING_REFINEMENTS = 2
#: Where it is amiss the coarse mesh may have so many times the triangles that it has at most elsewhere.
AMISS_FINER = 2
#: Edges within so many pixels of lost voxels cost so many times as much.
BESIDE_LOST, LOST_DEARER = 3.0, 256.0


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
    crossing : (K, 2) int64, optional
        Pairs of the mesh's triangles that pass through each other as the spline is written; None: not known.
    """

    spline: ControlMesh
    mesh: Mesh
    stack: SliceStack
    crossing: IntArray | None = None

    def to_world(self, frame: Frame) -> LoftedSurface:
        """Return the splines and their mesh in mm RAS."""
        spline = _as_written(self.spline, self.stack)
        mesh = spline.tessellate()
        to_plane = np.asarray(np.linalg.inv(self.stack.to_world), float)
        found = check_surface(mesh.transformed(to_plane), self.stack, self.crossing)
        told = [violation.line(self.stack.to_world) for violation in found]
        return LoftedSurface(spline.pieces(), mesh, frame, self.report(told))

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


def _as_written(spline: ControlMesh, stack: SliceStack) -> ControlMesh:
    """Return a spline in mm RAS, its control points rounded: rounding alone may make it cross itself."""
    return spline.transformed(stack.to_world).rounded(CONTROL_POINT_PIXELS * stack.pixel)


def loft_spline(stack: SliceStack, wave: float | None = None) -> SplineSolid:
    """Fit a closed Catmull-Clark spline to what the slices tell.

    Parameters
    ----------
    stack : SliceStack
        What the slices hold.
    wave : float, optional
        Length in mm of the longest waves that are taken off; see `cccd.surface.smooth_mesh`.
    """
    mesh = smooth_mesh(stack, wave)
    wall, crossing = _fit_and_refine(cut_at_ends(mesh, stack.distance), Target.of(mesh), stack)
    spline = with_caps(wall, stack.distance.ends)
    return SplineSolid(spline, spline.tessellate(), stack, crossing if spline is wall else None)


def _fit_and_refine(cut: Mesh, target: Target, stack: SliceStack) -> tuple[ControlMesh, IntArray]:
    """Fit a spline without caps, with finer quads where it is amiss; and its triangles (K, 2) that cross."""
    ends = stack.distance.ends
    volume = volume_between(target.mesh, ends)
    finest = max(FEWEST, len(target.mesh.faces) // COARSER)
    fine, weights, most = _evened(cut, target, finest, stack)
    best: tuple[ControlMesh, IntArray] | None = None
    for attempt in range(1 + REFINEMENTS + CROSSING_REFINEMENTS):
        start, coarse = control_mesh(fine, most, ends, weights)
        fit = fit_spline(start, target)
        fit.hold(volume, 1)
        places = lost = _lost(fit.spline, stack) if attempt < REFINEMENTS else np.zeros((0, 3))
        if not len(places):
            fit.hold(volume)
            crossing = fit.untangle(lambda spline: _as_written(spline, stack).vertices)
            if best is None or len(crossing) < len(best[1]):
                best = fit.spline, crossing
            if not len(crossing) or most >= AMISS_FINER * finest:
                break
            drawn = fit.spline.tessellate()
            places = drawn.vertices[drawn.faces[crossing[:, 0], 0]]
        if len(lost):
            if attempt == 1:  # it is sought among more triangles
                fine = _spared(cut, most, stack, lost)
                weights = np.ones(len(fine.vertices))
            else:
                weights *= _dearer(fine, lost, stack)
        there = np.zeros(len(coarse.faces), np.bool_)
        there[nearest_faces(places, coarse)] = True
        there = coarse.with_neighbours(there)
        weigh_more(weights, fine, coarse, np.where(there, AMISS_SPLIT, 1.0))
        most = min(len(coarse.faces) + 3 * int(there.sum()), AMISS_FINER * finest)
    assert best is not None
    return best


def _evened(cut: Mesh, target: Target, finest: int, stack: SliceStack) -> tuple[Mesh, FloatArray, int]:
    """Fit a first spline to see where quads have to be finer.

    Returns the mesh whose edges collapse, weights (V,) of its vertices, and how many triangles shall be left.
    """
    most = max(FEWEST, len(target.mesh.faces) // COARSEST)
    start, coarse = control_mesh(_spared(cut, most, stack), most, stack.distance.ends)
    places, off = fit_spline(start, target).off()
    near, count = nearest_faces(places, coarse), len(coarse.faces)
    mean = np.bincount(near, off**2, count) / np.maximum(np.bincount(near, minlength=count), 1)
    times = np.clip(np.sqrt(mean) / (OFF_PIXELS * stack.pixel), 1.0, COARSEST / COARSER)
    most = min(round(float(times.sum())), finest)
    fine = _spared(cut, most, stack)
    weights = np.ones(len(fine.vertices))
    weigh_more(weights, fine, coarse, times)
    return fine, weights, most


def _spared(cut: Mesh, most: int, stack: SliceStack, lost: FloatArray | None = None) -> Mesh:
    """Collapse edges of a mesh until so many triangles can be chosen from it, later beside places (P, 3)."""
    left = SPARE * most
    first = left if lost is None else max(len(cut.faces) // 2, 2 * left)
    fine = moved_to_ends(ahead(cut, first), stack.distance)
    weights = None if lost is None else _dearer(fine, lost, stack)
    return fewer_triangles(fine, left, stack.distance.ends, weights)


def _dearer(mesh: Mesh, lost: FloatArray, stack: SliceStack) -> FloatArray:
    """Weights (V,) for the collapse of a mesh that keep it fine beside lost voxels (P, 3)."""
    return np.where(cKDTree(lost).query(mesh.vertices)[0] < BESIDE_LOST * stack.pixel, LOST_DEARER, 1.0)


def _lost(spline: ControlMesh, stack: SliceStack) -> FloatArray:
    """Places (P, 3) where a spline leaves the slices' outlines or has voxels on its wrong side."""
    return places_off_slices(with_caps(spline, stack.distance.ends).tessellate(1), stack)[0]
