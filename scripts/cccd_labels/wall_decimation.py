"""Fewer triangles for surfaces of several regions: as many as their curvature needs, wall by wall."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
from scipy.spatial import cKDTree

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.distance import nearest_points
from cccd.geometry.mesh import Mesh
from cccd_labels.conforming import ConformingSurface

#: Vertices further than this from all former ones, in edges, are looked at: they lie on the wall.
NEAR = 0.75
#: A patch of more triangles, of which almost all would tear, becomes blocks. Lines between blocks stay, with
#: 1 % of the triangles. No edges of it are torn.
BLOCK, WHOLE = 60_000, np.zeros((0, 2), np.int64)
#: Patches of fewer triangles keep them.
FEWEST = 64
#: Of so many triangles of a flat wall one is left.
FLAT = 150
#: An equilateral triangle's area by its squared edge.
EQUILATERAL = 3**0.5 / 4
#: fast_simplification's quadric errors end at some .1: a length of 1 is the tolerance over the first, which
#: leaves 97 % of the points of walls within it. The second is how fast they rise to it.
UNIT, RISE = 0.04, 4.0


def simplified(surface: ConformingSurface, tolerance: float) -> ConformingSurface:
    """Collapse edges within walls by quadric error (Garland and Heckbert 1997); lines between walls stay.

    Parameters
    ----------
    surface : ConformingSurface
    tolerance : float
        How far triangles may lie off the walls.

    Returns
    -------
    ConformingSurface
        Of the same topology. Where a wall would change its own, what is around is collapsed apart from it.
    """
    if len(surface.triangles) == 0:
        return surface
    near = NEAR * (float(Mesh(surface.vertices, surface.triangles).face_areas.mean()) / EQUILATERAL) ** 0.5
    low, high = surface.regions.min(axis=1), surface.regions.max(axis=1)
    wall = low * (high.max() + 1) + high
    order = np.argsort(wall, kind="stable")
    waiting = np.split(order, np.flatnonzero(np.diff(wall[order])) + 1)
    members, fewer = list[IntArray](), list[Mesh | None]()
    patch = np.zeros(len(wall), np.int64)
    while waiting:
        for faces, keep in _pieces(surface, waiting.pop()):
            mesh = None
            if not keep:
                part = Mesh(surface.vertices, surface.triangles[faces]).compact()
                mesh, torn = (part, WHOLE) if len(faces) > BLOCK else _collapsed(part, near, tolerance)
                if torn is not None:
                    waiting += [faces[piece] for piece in _split(part, mesh.vertices[torn], near)]
                    continue
            patch[faces] = len(members)
            members.append(faces)
            fewer.append(mesh)
    return _joined(surface, members, fewer, np.flatnonzero(_of_several(surface, patch)))


def _pieces(surface: ConformingSurface, faces: IntArray) -> list[tuple[IntArray, bool]]:
    """Split triangles into connected pieces, and those of few triangles, together, that are to be kept."""
    number = Mesh(surface.vertices, surface.triangles[faces]).compact().piece_numbers
    few = np.bincount(number)[number] < FEWEST
    order = np.argsort(number[~few], kind="stable")
    large = np.split(faces[~few][order], np.flatnonzero(np.diff(number[~few][order])) + 1)
    pieces = [(piece, False) for piece in large] + [(faces[few], True)]
    return [(piece, keep) for piece, keep in pieces if len(piece)]


def _of_several(surface: ConformingSurface, patch: IntArray) -> BoolArray:
    """Whether vertices (V,) are of several patches."""
    last, several = np.zeros(len(surface.vertices), np.int64), np.zeros(len(surface.vertices), np.bool_)
    last[surface.triangles] = patch[:, None]
    several[surface.triangles[last[surface.triangles] != patch[:, None]]] = True
    return several


def _collapsed(before: Mesh, near: float, tolerance: float) -> tuple[Mesh, IntArray | None]:
    """Collapse a patch's edges but for those that touch its border.

    Where that changes the topology, the edges (K, 2) come with it that have more than two triangles then.
    """
    import fast_simplification  # pyright: ignore[reportMissingTypeStubs]

    unit = tolerance / UNIT
    vertices, faces = cast(Any, fast_simplification).simplify(
        before.vertices / unit,
        before.faces,
        target_count=len(before.faces) // FLAT,
        agg=RISE,
        preserve_border=True,
    )
    after = Mesh(np.asarray(vertices, float) * unit, np.asarray(faces, np.int64)).compact()
    (outline, _), (now, torn) = _outline(before), _outline(after)
    if now != outline:
        return after, torn
    # where a wall is flat the point of least quadric error is hardly defined, and may be far away
    far = np.flatnonzero(cKDTree(before.vertices).query(after.vertices)[0] > near)
    if len(far):
        on_wall = nearest_points(after.vertices[far], before)
        off = np.linalg.norm(on_wall - after.vertices[far], axis=1) > tolerance
        after.vertices[far[off]] = on_wall[off]
    return after, None


def _split(part: Mesh, torn: FloatArray, near: float) -> list[IntArray]:
    """Split a patch's triangles: a large one into blocks, a small one where edges (K, 2, 3) are torn.

    Apart go triangles that are as near to these as they are long, or half of all where those are not few.
    """
    middle = part.vertices[part.faces].mean(axis=1)
    if len(torn) and len(middle) <= BLOCK:
        reach = max(near, float(np.linalg.norm(torn[:, 0] - torn[:, 1], axis=1).max()))
        aside: BoolArray = np.asarray(cKDTree(torn.reshape(-1, 3)).query(middle)[0]) < reach
        if 0 < np.count_nonzero(aside) < len(aside) / 2:
            return [np.flatnonzero(aside), np.flatnonzero(~aside)]
    return _leaves(cKDTree(middle, min(BLOCK, -(-len(middle) // 2))).tree)


def _leaves(node: Any) -> list[IntArray]:
    """Gather the points of the boxes that a tree ends in."""
    whole = node.split_dim < 0
    return [np.sort(node.indices)] if whole else [*_leaves(node.lesser), *_leaves(node.greater)]


def _outline(mesh: Mesh) -> tuple[tuple[int, int, int], IntArray]:
    """Euler number, edges of the border and those (K, 2) with more than two triangles; and their number."""
    edges, uses = ConformingSurface(mesh.vertices, mesh.faces, mesh.faces).edges
    euler = len(mesh.vertices) - len(uses) + len(mesh.faces)
    return (euler, int((uses == 1).sum()), int((uses > 2).sum())), edges[uses > 2]


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
            if known is not None:  # these have not moved but by rounding
                away, nearest = known.query(mesh.vertices, distance_upper_bound=1e-9)
                place = np.where(np.isfinite(away), lines[np.minimum(nearest, len(lines) - 1)], place)
            vertices.append(mesh.vertices)
            triangles.append(place[mesh.faces])
            count += len(mesh.vertices)
        regions.append(np.repeat(surface.regions[faces[:1]], len(triangles[-1]), axis=0))
    whole = Mesh(np.concatenate(vertices), np.concatenate(triangles)).compact()
    return replace(surface, vertices=whole.vertices, triangles=whole.faces, regions=np.concatenate(regions))
