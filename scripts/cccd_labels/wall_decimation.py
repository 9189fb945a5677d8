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
    edge = (area / EQUILATERAL) ** 0.5
    density = _needed(surface, tolerance, edge)
    for shift in SHIFTS:
        patch = _patches(surface, ACROSS * edge, shift)
        surface, density = _with_fewer(surface, patch, density, NEAR * edge, tolerance)
    return surface


def _with_fewer(
    surface: ConformingSurface, patch: IntArray, density: FloatArray, near: float, tolerance: float
) -> tuple[ConformingSurface, FloatArray]:
    """Collapse edges of patches, of which each triangle (T,) has a number, to as many by area as are needed.

    Returns the walls and how many triangles by area each one's patch needs.
    """
    order = np.argsort(patch, kind="stable")
    members = np.split(order, np.flatnonzero(np.diff(patch[order])) + 1)
    border = _of_several(surface, patch)
    area = Mesh(surface.vertices, surface.triangles).face_areas
    needed = np.bincount(patch, area * density)
    target = np.bincount(patch, np.where(border[surface.triangles].any(axis=1), 1.0, area * density))
    fewer = [
        _collapsed(Mesh(surface.vertices, surface.triangles[faces]), int(target[number]), near, tolerance)
        for number, faces in enumerate(members)
    ]
    sizes = [len(faces if mesh is None else mesh.faces) for faces, mesh in zip(members, fewer, strict=True)]
    of_patch = needed / np.maximum(np.bincount(patch, area), 1e-12)
    return _joined(surface, members, fewer, np.flatnonzero(border)), np.repeat(of_patch, sizes)


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


def _needed(surface: ConformingSurface, tolerance: float, edge: float) -> FloatArray:
    """Triangles (T,) by area that a wall needs there, none smaller than of an edge."""
    pair, count = np.sort(surface.regions, axis=1), len(surface.triangles)
    bends = Mesh(surface.vertices, surface.triangles).dihedrals
    within = (pair[bends.faces[:, 0]] == pair[bends.faces[:, 1]]).all(axis=1)
    faces, areas = bends.faces[within], np.maximum(bends.areas[within], 1e-12)
    curvature = 1.5 * bends.lengths[within] * bends.angles[within] / areas
    square = np.bincount(faces.ravel(), np.repeat(curvature**2, 2), count)
    curvature = np.sqrt(square / np.maximum(np.bincount(faces.ravel(), minlength=count), 1))
    length = np.sqrt(8 * tolerance / np.maximum(curvature, 1e-9))
    return 1 / (EQUILATERAL * np.clip(length, edge, LONGEST * edge) ** 2)


def _collapsed(patch: Mesh, target: int, near: float, tolerance: float) -> Mesh | None:
    """Collapse a patch's edges but for those that touch its border; None where that changes the topology."""
    if len(patch.faces) < FEWEST or target >= len(patch.faces):
        return None
    import fast_simplification  # pyright: ignore[reportMissingTypeStubs]

    before = patch.compact()
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
    used: BoolArray = np.zeros(len(points), np.bool_)
    used[faces] = True
    place = np.cumsum(used) - 1
    return replace(surface, vertices=points[used], triangles=place[faces], regions=np.concatenate(regions))
