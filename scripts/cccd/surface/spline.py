"""One closed spline through a stack of slices: control mesh, fit, repair of what passes through itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from cccd.containers import Frame
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.decimation import weigh_more
from cccd.geometry.distance import nearest_faces
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd.surface.checks import check_surface
from cccd.surface.control_mesh import (
    SAME_HEIGHT,
    control_mesh,
    fewer_triangles,
    on_caps,
    open_edges,
    with_caps,
)
from cccd.surface.rough import counts, cut_at_ends, warnings_of, without_small
from cccd.surface.sampled import SampledDistance
from cccd.surface.spline_fit import Curvature, SplineFit, fit_spline
from cccd.surface.stack import CONTROL_BYTES, SliceStack
from cccd.surface.surface import LoftedSurface
from cccd.tolerances import CONTROL_POINT_PIXELS

__all__ = ["SplineSolid", "loft_spline"]

#: Triangles of the coarse mesh for each mm^2, times a pixel's edge and by the curvature |k1| + |k2|: with
#: their size an edge's sagitta is then some tenth of a pixel everywhere.
DENSITY = 0.05
#: The same by the square of the curvature: thin branches have as many triangles around as thick ones.
AROUND = 0.65
#: ... and by the square of the height where the scan cuts on both sides: a triangle reaches from rim to rim.
ACROSS = 2.0
#: Fewest triangles of a surface.
FEWEST = 60
#: The coarse mesh has at most an nth of the triangles that the grid gives: bronchi of two pixels
#: have an eighth of them, and what needs more is noise.
COARSER = 6
#: The first mesh has this many times the triangles of the coarse one: enough to choose from.
SPARE = 8
#: Band and rounds of the filter that takes pixels' steps off before curvature is taken.
CALM_BAND, CALM_ROUNDS = 0.1, 30
#: Rounds of averaging the curvature with that of the neighbours.
CURVATURE_ROUNDS = 4
#: Rounds of finer quads where the surface passes through itself, folds, or lies off the distances by so many
#: pixels: a second one changes lungs' error by less than 1 %.
REFINEMENTS, MOST_OFF = 1, 0.5
#: ... and further ones where it still passes through itself: narrow gaps need quads no wider than they are.
CROSSING_REFINEMENTS = 3
#: A surface folds where it turns by more than this (radians) from a triangle to the next.
FOLD = 1.6
#: Area of a triangle whose edges are 1.
EQUILATERAL = np.sqrt(3) / 4
#: The mesh has this many subdivisions: 32 triangles for each quad ...
DRAWN = 2
#: ... and one less (8 for each) where there are more quads than this, which would give 2 million triangles:
#: large organs with noise at the pixel and cortices have so many, each about as small as a pixel.
LARGE = 62_500
#: Such organs begin with an nth of the grid's triangles, where these are not too few by `COARSER` already:
#: finer quads come where the fit is off, not where noise is. Rough lungs bend .85 times as much by that, and
#: a cortex's distance to its voxels grows by 2 %.
COARSER_LARGE = 12
#: Quads may be so many times more than the finest where that keeps the surface from crossing itself: an
#: airway needs 1.03. Where much crosses, as in noise, finer ones take minutes.
PAST_FINEST = 1.1
#: Moves that hold the volume.
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
    smallest_voxels : float
        Parts and cavities of less volume are left out, but for the largest.
    """

    spline: ControlMesh
    mesh: Mesh
    stack: SliceStack
    smallest_voxels: float

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
            "warnings": [*warnings_of(self.stack, self.smallest_voxels), *violations],
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
    rough = without_small(cut_at_ends(distance.zero_surface(), distance), stack)
    caps = on_caps(rough, distance.ends)
    wall = Mesh(rough.vertices, rough.faces[~caps]).compact()
    bent, area = _curvature(wall.low_passed(CALM_BAND, CALM_ROUNDS))
    # only what the scan cuts has rims
    rim = open_edges(wall.faces) if caps.any() else np.zeros((0, 2), np.int64)
    least = np.full(len(area), ACROSS / (distance.ends[1] - distance.ends[0]) ** 2)
    density = np.maximum(least, np.maximum(DENSITY * bent / distance.pixel, AROUND * bent**2))
    finest = max(FEWEST, len(rough.faces) // COARSER, _triangles(wall, rim, area, least))
    most = max(FEWEST, _triangles(wall, rim, area, density))
    if most > finest:  # thin all over
        most = finest
    else:  # two quads come of a triangle
        most = min(most, max(LARGE // 2, len(rough.faces) // COARSER_LARGE))
    fine = fewer_triangles(rough, SPARE * most, distance.ends)
    tree = cKDTree(wall.vertices)
    spline = _fit_and_refine(
        fine, (most, finest), distance, stack.held_volume, lambda points: bent[tree.query(points)[1]]
    )
    return SplineSolid(spline, spline.tessellate(_drawn(spline)), stack, smallest_voxels)


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


def _fit_and_refine(
    fine: Mesh,
    triangles: tuple[int, int],
    distance: SampledDistance,
    volume: float | None,
    curvature: Curvature,
) -> ControlMesh:
    """Fit a spline, with finer quads where it is amiss as long as it lies off the distances anywhere."""
    weights = np.ones(len(fine.vertices))
    most, finest = triangles
    best: tuple[tuple[int, int], SplineFit] | None = None
    for attempt in range(1 + REFINEMENTS + CROSSING_REFINEMENTS):
        wall, coarse = control_mesh(fine, most, distance.ends, weights)
        fit = fit_spline(wall, distance, curvature)
        mesh = with_caps(fit.spline, distance.ends).tessellate(1)
        crossing, off, folded = _amiss(mesh, distance)
        found = int(off.sum()), int(crossing.sum())
        large = len(wall.quads) > LARGE
        if best is None or found < best[0]:
            best, futile = (found, fit), False
        else:  # in noise one more fit of so many quads takes twenty seconds and rarely helps
            futile = large and attempt > REFINEMENTS
        amiss = crossing | off | folded if attempt < REFINEMENTS else crossing
        done = futile or most >= finest or not (amiss & (crossing | off)).any()
        closed = None
        # moving what crosses takes seconds, another fit of so many quads half a minute
        if done or (large and not off.any()):
            closed, simple = _of_volume(best[1], volume)
            if simple or futile or not crossing.any():
                return closed
            amiss = crossing
        there = np.zeros(len(coarse.faces), np.bool_)
        there[nearest_faces(mesh.vertices[np.unique(mesh.faces[amiss])], coarse)] = True
        if attempt >= REFINEMENTS or done:
            there = np.asarray(np.isin(coarse.faces, coarse.faces[there]).any(axis=1), np.bool_)
        weigh_more(weights, fine, coarse, there)
        finer = len(coarse.faces) + 3 * int(there.sum())
        if closed is None:
            most = min(finer, finest)
        elif finer <= PAST_FINEST * finest:
            most = finer
        else:
            return closed
    assert best is not None
    return _of_volume(best[1], volume)[0]


def _amiss(mesh: Mesh, distance: SampledDistance) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Which triangles (F,) pass through others, lie off the distances' zero, are folded."""
    cap = on_caps(mesh, distance.ends, SAME_HEIGHT)
    crossing, folded = np.zeros((2, len(mesh.faces)), np.bool_)
    crossing[mesh.self_intersections().ravel()] = True
    slope = np.maximum(1, distance.slopes(mesh.vertices, mesh.vertex_normals))
    off = np.abs(distance(mesh.vertices)) > MOST_OFF * distance.pixel * slope
    _, angles, _, _, beside = mesh.dihedrals
    sharp = beside[angles > FOLD]
    folded[sharp[cap[sharp[:, 0]] == cap[sharp[:, 1]]]] = True
    return crossing, off[mesh.faces].any(axis=1) & ~cap, folded


def _of_volume(fit: SplineFit, volume: float | None) -> tuple[ControlMesh, bool]:
    """Close a fitted wall, moved to hold a volume in mm^3, and say whether it nowhere crosses itself."""
    ends = fit.distance.ends
    if volume is not None:
        for _ in range(VOLUME_ROUNDS):
            closed = with_caps(fit.spline, ends)
            fit.hold_volume(volume - closed.tessellate(_drawn(closed)).volume)
    simple = fit.untangle(_drawn(fit.wall))
    return with_caps(fit.spline, ends), simple
