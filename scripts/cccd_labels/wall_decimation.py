"""Fewer triangles for surfaces of several regions: as many as their curvature needs, wall by wall."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
from scipy.spatial import cKDTree

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.conforming import ConformingSurface
from cccd.geometry.distance import nearest_points
from cccd.geometry.mesh import Mesh

__all__ = ["simplified"]

#: Walls are parted into patches of so many edges across, so that what goes wrong stays small ...
ACROSS = 40.0
#: ... twice, by grids that are shifted by this share of it: what was a border is none the second time.
SHIFTS = (0.0, 0.5)
#: Vertices further than this from all former ones, in edges, are looked at: they lie on the wall.
NEAR = 0.75
#: Patches of fewer triangles keep them.
FEWEST = 64
#: Edges become at most so many times as long as they are: flat walls keep some triangles.
LONGEST = 12.0
#: An equilateral triangle's area by its squared edge.
EQUILATERAL = 3**0.5 / 4


def simplified(surface: ConformingSurface, tolerance: float) -> ConformingSurface:
    r"""Collapse edges within walls by quadric error (Garland and Heckbert 1997); lines between walls stay.

    Parameters
    ----------
    surface : ConformingSurface
    tolerance : float
        How far a triangle may lie off a wall: where the curvature is :math:`c`, an edge of length :math:`l`
        lies :math:`c l^2 / 8` off.

    Returns
    -------
    ConformingSurface
        Of the same topology. A patch that would change its own is as it was.
    """
    if len(surface.triangles) == 0:
        return surface
    area = float(Mesh(surface.vertices, surface.triangles).face_areas.mean())
    edge, density = (area / EQUILATERAL) ** 0.5, None
    for shift in SHIFTS:
        patch = _patches(surface, ACROSS * edge, shift)
        surface, density = _with_fewer(surface, patch, density, edge, tolerance)
    return surface


def _with_fewer(
    surface: ConformingSurface, patch: IntArray, density: FloatArray | None, edge: float, tolerance: float
) -> tuple[ConformingSurface, FloatArray]:
    """Collapse edges of patches, of which each triangle (T,) has a number, to as many by area as are needed.

    Returns the walls, and how many each triangle's patch needs: ``density`` (T,), or what curvature says.
    """
    order = np.argsort(patch, kind="stable")
    members = np.split(order, np.flatnonzero(np.diff(patch[order])) + 1)
    border = _of_several(surface, patch)
    fewer: list[Mesh | None] = []
    needed: list[FloatArray] = []
    for faces in members:
        part = Mesh(surface.vertices, surface.triangles[faces]).compact()
        area = part.face_areas
        dense = _needed(part, tolerance, edge) if density is None else density[faces]
        kept = border[surface.triangles[faces]].any(axis=1)
        target = int(np.where(kept, 1.0, area * dense).sum())
        fewer.append(_collapsed(part, target, NEAR * edge, tolerance))
        needed.append(np.full(len((fewer[-1] or part).faces), (area @ dense) / max(float(area.sum()), 1e-12)))
    return _joined(surface, members, fewer, np.flatnonzero(border)), np.concatenate(needed)


def _of_several(surface: ConformingSurface, patch: IntArray) -> BoolArray:
    """Whether vertices (V,) are of several patches."""
    count = len(surface.vertices)
    low, high = np.full(count, len(patch)), np.full(count, -1)
    np.minimum.at(low, surface.triangles, patch[:, None])
    np.maximum.at(high, surface.triangles, patch[:, None])
    return low < high


def _patches(surface: ConformingSurface, width: float, shift: float) -> IntArray:
    """Give each triangle (T,) the number of its patch: of one wall, in one cell of a grid."""
    cell = np.floor(surface.vertices[surface.triangles[:, 0]] / width + shift).astype(np.int64)
    groups = np.column_stack([np.sort(surface.regions, axis=1), cell - cell.min(axis=0)])
    keys = np.ravel_multi_index(tuple(groups.T), tuple(groups.max(axis=0) + 1))
    return np.asarray(np.unique(keys, return_inverse=True)[1], np.int64)


def _needed(patch: Mesh, tolerance: float, edge: float) -> FloatArray:
    """Triangles (T,) by area that a patch of a wall needs, none smaller than of an edge."""
    bends, count = patch.dihedrals, len(patch.faces)
    curvature = 1.5 * bends.lengths * bends.angles / np.maximum(bends.areas, 1e-12)
    square = np.bincount(bends.faces.ravel(), np.repeat(curvature**2, 2), count)
    curvature = np.sqrt(square / np.maximum(np.bincount(bends.faces.ravel(), minlength=count), 1))
    length = np.sqrt(8 * tolerance / np.maximum(curvature, 1e-9))
    return 1 / (EQUILATERAL * np.clip(length, edge, LONGEST * edge) ** 2)


def _collapsed(before: Mesh, target: int, near: float, tolerance: float) -> Mesh | None:
    """Collapse a patch's edges but for those that touch its border; None where that changes the topology."""
    if len(before.faces) < FEWEST or target >= len(before.faces):
        return None
    import fast_simplification  # pyright: ignore[reportMissingTypeStubs]

    vertices, faces = cast(Any, fast_simplification).simplify(
        before.vertices, before.faces, target_count=target, preserve_border=True
    )
    after = Mesh(np.asarray(vertices, float), np.asarray(faces, np.int64)).compact()
    if _outline(after) != _outline(before):
        return None
    # where a wall is flat the point of least quadric error is hardly defined, and may be far away
    far = np.flatnonzero(cKDTree(before.vertices).query(after.vertices)[0] > near)
    if len(far):
        on_wall = nearest_points(after.vertices[far], before)
        off = np.linalg.norm(on_wall - after.vertices[far], axis=1) > tolerance
        after.vertices[far[off]] = on_wall[off]
    return after


def _outline(mesh: Mesh) -> tuple[int, int, bool]:
    """Euler number, edges of the border, and whether no edge has more than two triangles."""
    sides = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    uses = np.unique(sides[:, 0] * len(mesh.vertices) + sides[:, 1], return_counts=True)[1]
    euler = len(mesh.vertices) - len(uses) + len(mesh.faces)
    return euler, int((uses == 1).sum()), bool(uses.max() <= 2)


def _joined(
    surface: ConformingSurface, members: list[IntArray], fewer: list[Mesh | None], lines: IntArray
) -> ConformingSurface:
    """Put patches together again, along the vertices that are of several."""
    vertices, triangles, regions = [surface.vertices], list[IntArray](), list[IntArray]()
    count = len(surface.vertices)
    known = cKDTree(surface.vertices[lines]) if len(lines) else None
    for faces, mesh in zip(members, fewer, strict=True):
        if mesh is None:
            triangles.append(surface.triangles[faces])
        else:
            place = count + np.arange(len(mesh.vertices))
            if known is not None:  # these have not moved at all
                away, nearest = known.query(mesh.vertices, distance_upper_bound=1e-9)
                place = np.where(away == 0, lines[np.minimum(nearest, len(lines) - 1)], place)
            vertices.append(mesh.vertices)
            triangles.append(place[mesh.faces])
            count += len(mesh.vertices)
        regions.append(np.repeat(surface.regions[faces[:1]], len(triangles[-1]), axis=0))
    points, faces = np.concatenate(vertices), np.concatenate(triangles)
    used: BoolArray = np.bincount(faces.ravel(), minlength=len(points)) > 0
    place = np.cumsum(used) - 1
    return replace(surface, vertices=points[used], triangles=place[faces], regions=np.concatenate(regions))
