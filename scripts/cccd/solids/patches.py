"""Bicubic B-spline patches on a quad layout: one per quad, control points of common edges shared."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.bsplines import DEGREE, basis, open_knots
from cccd.geometry.decimation import collapse_edges, weigh_more
from cccd.geometry.mesh import Mesh
from cccd.solids.kernel import patch_shell
from cccd.solids.layout import Footpoints, Layout, grid_ids, grid_triangles, lay_flat, lay_quads, with_flat
from cccd.solids.shells import follows
from cccd.tolerances import TINY

__all__ = ["Patches", "creased", "fit_patches", "patches_within"]

#: Control points along an edge of a patch, and how often a quad is halved for its samples: 9 for 6.
CONTROL_POINTS, SUBDIVISIONS = 6, 3

#: Samples along an edge at which a patch is looked at for folds, and for its triangles.
CHECKED = 9

#: Control points are rounded to so many digits of a mm; it takes a quarter off a STEP file.
DIGITS = 4

#: Triangles of the decimated mesh are evened out by this much: needles make needles of quads.
EVENNESS = 1e-2


#: Decimated meshes are made of one with so many triangles for each that there may be in the end.
FINEST = 8

#: Where patches neither fold nor lie off, and still do not follow, there are so many times as many.
LEAST_GROWTH = 1.125

#: Where the patches of more than this share of the triangles fold they are not flattened: it would show.
MOST_FOLDED = 0.12

#: Nor where more than this share of the samples lies beyond the tolerance.
MOST_OFF = 0.02

#: Times that triangles are flattened whose patches fold.
FLATTENING_ROUNDS = 12


@dataclass(frozen=True)
class Patches:
    """A shell of bicubic B-spline patches.

    Attributes
    ----------
    quads : (Q, 4) int64
        Corners of the patches, counter-clockwise from outside.
    control_points : (K, 3) float64
        In mm, numbered as ``grid_ids(quads, CONTROL_POINTS)`` has them.
    planar : int
        How many of them are planes: where others would fold.
    """

    quads: IntArray
    control_points: FloatArray
    planar: int = 0
    smooth: bool = True

    @cached_property
    def nets(self) -> IntArray:
        """Numbers (Q, n, n) of each patch's control points."""
        return grid_ids(self.quads, CONTROL_POINTS)

    @cached_property
    def samples(self) -> FloatArray:
        """Points (Q, m, m, 3) on the patches."""
        at = _basis(CHECKED)
        return np.einsum("ia,qabc,jb->qijc", at, self.control_points[self.nets], at, optimize=True)

    @property
    def mesh(self) -> Mesh:
        """Triangles through points of the patches, closed as the patches are."""
        return self._triangles

    @cached_property
    def _triangles(self) -> Mesh:
        return grid_triangles(self.quads, self.samples)

    def normals(self, count: int = CHECKED) -> FloatArray:
        """Return normals (Q, m, m, 3) at even samples, not of unit length; zero where a patch is singular."""
        at, slope = _basis(count), _basis(count, 1)
        net = self.control_points[self.nets]
        down = np.einsum("ia,qabc,jb->qijc", slope, net, at, optimize=True)
        across = np.einsum("ia,qabc,jb->qijc", at, net, slope, optimize=True)
        return np.cross(across, down)

    def build(self) -> Any:
        """Make the ``TopoDS_Shell``, a spline surface for each patch."""
        return patch_shell(self.quads, self.control_points[self.nets])


def _basis(count: int, derivative: int = 0) -> FloatArray:
    """Basis functions (count, CONTROL_POINTS), or a derivative, at even parameters."""
    return basis(np.linspace(0, 1, count), open_knots(CONTROL_POINTS, 1.0), DEGREE, False, derivative)


def _fitting(count: int) -> FloatArray:
    """Operator (CONTROL_POINTS, count) from samples to control points: least squares, ends interpolated."""
    at = _basis(count)
    operator = np.zeros((CONTROL_POINTS, count))
    operator[0, 0] = operator[-1, -1] = 1
    inner = np.linalg.pinv(at[1:-1, 1:-1])
    operator[1:-1, 1:-1] = inner
    operator[1:-1, 0] = -inner @ at[1:-1, 0]
    operator[1:-1, -1] = -inner @ at[1:-1, -1]
    return operator


def fit_patches(layout: Layout) -> Patches:
    """Fit a patch to the samples of each quad.

    The outer control points of an edge depend on the edge's samples alone, so neighbours agree on them.
    """
    operator = _fitting(layout.ids.shape[1])
    nets = np.einsum("ai,qijc,bj->qabc", operator, layout.points[layout.ids], operator, optimize=True)
    ids = grid_ids(layout.quads, CONTROL_POINTS)
    points = np.empty((int(ids.max()) + 1, 3))
    points[ids] = nets
    return Patches(layout.quads, np.round(points, DIGITS))


def patches_within(mesh: Mesh, tolerance: float, first: int, most: int) -> Patches | None:
    """Fit patches to a closed mesh in one piece, more where they fold or lie off, until they follow it.

    Parameters
    ----------
    mesh : Mesh
        A closed manifold.
    tolerance : float
        In mm, of 99 % of the surface.
    first, most : int
        Patches to begin with, and to end with.

    Returns
    -------
    Patches or None
        None where folds are left or the tolerance is not reached with so many.
    """
    target = Footpoints(mesh)
    most = min(most, len(mesh.faces))
    fine = collapse_edges(mesh, FINEST * most // 3)
    weights = np.ones(len(fine.vertices))
    wanted = max(4, first // 3)
    while True:
        coarse = collapse_edges(fine, wanted, EVENNESS, weights)
        fitted, marked = _fitted(coarse, target, tolerance)
        if fitted is not None and follows(fitted.mesh, mesh, tolerance):
            return fitted
        count = len(coarse.faces)
        if max(wanted, count) >= most // 3:
            return None
        wanted = min(max(count + 3 * int(marked.sum()), round(LEAST_GROWTH * count)), 2 * count, most // 3)
        weigh_more(weights, fine, coarse, marked)


def _fitted(coarse: Mesh, target: Footpoints, tolerance: float) -> tuple[Patches | None, BoolArray]:
    """Fit patches to a layout on a decimated mesh, and mark its triangles (F,) that should be smaller."""
    # Triangles whose patches fold stay as flat as in the decimated mesh, until none folds. That mesh does
    # not pass through itself, so there are patches that do not: those that are all flat. None where it does,
    # or where too many patches fold or lie off.
    flat = np.zeros(len(coarse.faces), np.bool_)
    pairs = coarse.self_intersections()
    if len(pairs):
        flat[pairs.ravel()] = True
        return None, coarse.with_neighbours(flat)
    layout, planar = lay_quads(coarse, target, SUBDIVISIONS), lay_flat(coarse, SUBDIVISIONS)
    marked = flat
    for _ in range(FLATTENING_ROUNDS):
        fitted = fit_patches(with_flat(layout, planar, flat) if flat.any() else layout)
        folded, distance = _inspect(fitted, target, flat)
        off = distance > tolerance
        marked = marked | folded | off.any(axis=1)
        if folded.mean() > MOST_FOLDED or off.mean() > MOST_OFF:
            break
        if not folded.any():
            return replace(fitted, planar=3 * int(flat.sum())), marked
        beside = np.all(flat[folded])  # flat ones pass through those beside them
        flat = flat | (coarse.with_neighbours(folded) if beside else folded)
    return None, marked


def _inspect(fitted: Patches, target: Footpoints, flat: BoolArray) -> tuple[BoolArray, FloatArray]:
    """Whether the patches of triangles (F,) fold, and how far (F, S) their samples lie from the mesh."""
    # They fold where they turn away from the mesh, unless they are flat, or pass through others.
    normals = fitted.normals().reshape(-1, 3)
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    samples = fitted.samples.reshape(-1, 3)
    near, there = target.nearest(samples, normals / np.maximum(size, TINY))
    against = np.einsum("pc,pc->p", there, normals) <= 0
    bad = against.reshape(len(fitted.quads), -1).any(axis=1)
    bad |= creased(fitted.normals(4 * CHECKED - 3))
    bad &= ~np.tile(flat, 3)
    pairs = fitted.mesh.self_intersections()
    cells = (CHECKED - 1) ** 2
    bad[np.unique(pairs % (len(fitted.quads) * cells)) // cells] = True
    distance = np.linalg.norm(near - samples, axis=1).reshape(3, len(flat), -1)
    return bad.reshape(3, -1).any(axis=0), np.moveaxis(distance, 0, 1).reshape(len(flat), -1)


def creased(normals: FloatArray) -> BoolArray:
    """Which patches turn by more than a right angle from one sample (Q, m, m, 3) to the next."""
    down = np.einsum("qijc,qijc->qij", normals[:, 1:], normals[:, :-1])
    across = np.einsum("qijc,qijc->qij", normals[:, :, 1:], normals[:, :, :-1])
    return (down <= 0).any(axis=(1, 2)) | (across <= 0).any(axis=(1, 2))
