"""Bicubic B-spline patches on a quad layout: one per quad, control points of common edges shared."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.bsplines import DEGREE, basis, open_knots
from cccd.geometry.mesh import Mesh
from cccd.solids.decimation import collapse_edges
from cccd.solids.kernel import patch_shell
from cccd.solids.layout import Footpoints, Layout, grid_ids, lay_quads, links
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


#: Where more than this share of the patches fold smoothing leaves folds: more patches are tried at once.
MOST_FOLDED = 0.1

#: Where more than this share fold twice in a row, handles and thin walls abound: facets need less.
HOPELESS = 1 / 3

#: Rounds of smoothing that may leave as many folds as there were.
PATIENCE = 4


@dataclass(frozen=True)
class Patches:
    """A shell of bicubic B-spline patches.

    Attributes
    ----------
    quads : (Q, 4) int64
        Corners of the patches, counter-clockwise from outside.
    control_points : (K, 3) float64
        In mm, numbered as ``grid_ids(quads, CONTROL_POINTS)`` has them.
    """

    quads: IntArray
    control_points: FloatArray
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
        ids = grid_ids(self.quads, CHECKED)
        points = np.empty((int(ids.max()) + 1, 3))
        points[ids] = self.samples
        a, b, c, d = (
            ids[:, rows, columns].ravel()
            for rows, columns in (
                (slice(-1), slice(-1)),
                (slice(-1), slice(1, None)),
                (slice(1, None), slice(1, None)),
                (slice(1, None), slice(-1)),
            )
        )
        return Mesh(points, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))

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


def patches_within(mesh: Mesh, tolerance: float, first: int, most: int, rounds: int) -> Patches | None:
    """Fit patches to a closed mesh in one piece, twice as many until they follow it and do not fold.

    Parameters
    ----------
    mesh : Mesh
        A closed manifold.
    tolerance : float
        In mm, of 99 % of the surface.
    first, most : int
        Patches to begin with, and to end with.
    rounds : int
        How often folds are smoothed.

    Returns
    -------
    Patches or None
        None where folds are left or the tolerance is not reached with so many.
    """
    target = Footpoints(mesh)
    steps = [first]
    while steps[-1] * 2 <= min(most, len(mesh.faces)):
        steps.append(steps[-1] * 2)
    coarse = [mesh]
    for patches in reversed(steps):
        coarse.append(collapse_edges(coarse[-1], max(4, patches // 3), EVENNESS))
    before = 0.0
    for layer in reversed(coarse[1:]):
        fitted, folded = _unfolded(lay_quads(layer, target, SUBDIVISIONS), target, rounds)
        if fitted is not None and follows(fitted.mesh, mesh, tolerance):
            return fitted
        if min(folded, before) > HOPELESS:
            break
        before = folded
    return None


def _unfolded(layout: Layout, target: Footpoints, rounds: int) -> tuple[Patches | None, float]:
    """Smooth the samples of patches that fold until none does; None where some still do, and their share."""
    mean = links(layout.ids, len(layout.points))
    fewest, since, bad = len(layout.quads), 0, np.zeros(0, np.bool_)
    for turn in range(rounds + 1):
        fitted = fit_patches(layout)
        bad = _folded(fitted, target)
        if not bad.any():
            return fitted, 0.0
        fewest, since = (int(bad.sum()), 0) if bad.sum() < fewest else (fewest, since + 1)
        if bad.mean() > MOST_FOLDED or since > PATIENCE:
            break
        near = turn >= rounds // 3  # what alone did not unfold has its neighbours in the way
        layout = replace(layout, points=_smoothed(layout, bad, mean, 2 + turn, near))
    return None, float(bad.mean())


def _smoothed(layout: Layout, bad: BoolArray, mean: csr_array, times: int, near: bool) -> FloatArray:
    """Move the samples of bad patches, and those ``near`` them, half of the way to their neighbours' mean."""
    weight = np.zeros(len(layout.points))
    weight[layout.ids[bad]] = 0.5
    if near:
        weight[(mean @ (mean @ weight)) > 0] = 0.5
    points = layout.points
    for _ in range(times):
        points = points + weight[:, None] * (mean @ points - points)
    return points


def _folded(fitted: Patches, target: Footpoints) -> BoolArray:
    """Which patches turn away from the mesh somewhere, or pass through others."""
    normals = fitted.normals().reshape(-1, 3)
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    _, there = target.nearest(fitted.samples.reshape(-1, 3), normals / np.maximum(size, TINY))
    against = np.einsum("pc,pc->p", there, normals) <= 0
    bad = against.reshape(len(fitted.quads), -1).any(axis=1)
    bad |= creased(fitted.normals(4 * CHECKED - 3))
    pairs = fitted.mesh.self_intersections()
    cells = (CHECKED - 1) ** 2
    bad[np.unique(pairs % (len(fitted.quads) * cells)) // cells] = True
    return bad


def creased(normals: FloatArray) -> BoolArray:
    """Which patches turn by more than a right angle from one sample (Q, m, m, 3) to the next."""
    down = np.einsum("qijc,qijc->qij", normals[:, 1:], normals[:, :-1])
    across = np.einsum("qijc,qijc->qij", normals[:, :, 1:], normals[:, :, :-1])
    return (down <= 0).any(axis=(1, 2)) | (across <= 0).any(axis=(1, 2))
