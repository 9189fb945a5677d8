"""Solids from tubes: union of what is solid, minus cavities, plus what floats inside them.

The booleans are manifold3d's. What they leave sharp, the lines along which tubes meet, is faired; where a
surface passes through itself it is relaxed until it does not.
"""

from __future__ import annotations

from collections.abc import Sequence

import manifold3d
import numpy as np
from manifold3d import Manifold, OpType
from scipy.ndimage import gaussian_filter
from scipy.sparse import csr_array
from skimage.measure import marching_cubes

from cccd.containers import Frame
from cccd.metrics import dihedrals, mesh_volume, self_intersections, voxelise

__all__ = ["combine", "fair_creases", "remesh", "solid", "swelling", "triangles", "untangle"]

#: Rings of vertices to either side of a crease that are faired, and rounds of fairing.
CREASE_RINGS, CREASE_ROUNDS = 2, 15
#: Faces that meet at more than this angle (radians) make a crease.
SHARP = np.deg2rad(55)
#: Taubin's steps towards and away from the neighbours' mean.
TAUBIN = (0.60, -0.62)
#: Rounds of undoing, then of relaxing, where the surface passes through itself; the patch grows by a
#: ring every round, then every other.
RETURN_ROUNDS, RELAX_ROUNDS = 5, 20


def solid(vertices: np.ndarray, faces: np.ndarray) -> Manifold:
    """Turn a closed mesh (V, 3), (F, 3) into a solid that remembers which faces are its own."""
    mesh = manifold3d.Mesh64(
        np.ascontiguousarray(vertices, float),
        np.ascontiguousarray(faces, np.uint64),
        run_index=np.array([0, faces.size], np.uint64),
        run_original_id=np.array([Manifold.reserve_ids(1)], np.uint32),
    )
    return Manifold(mesh)


def triangles(body: Manifold) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (V, 3) float64 and faces (F, 3) int64 of a solid, and which original each face is from."""
    mesh = body.to_mesh64()
    faces = np.array(mesh.tri_verts, np.int64)
    bounds = np.array(mesh.run_index, np.int64) // 3
    origin = np.repeat(np.array(mesh.run_original_id, np.int64), np.diff(bounds))
    return np.array(mesh.vert_properties[:, :3], float), faces, origin


def fair_creases(
    vertices: np.ndarray, faces: np.ndarray, origin: np.ndarray, fixed: np.ndarray
) -> np.ndarray:
    """Round off the lines along which tubes meet, and other sharp folds; gives the vertices (V, 3).

    Parameters
    ----------
    vertices, faces : (V, 3) float64, (F, 3) int64
        A closed mesh.
    origin : (F,) int64
        The tube that each face comes from.
    fixed : (V,) bool
        Vertices that stay, such as those of flat lids.

    Notes
    -----
    Vertices within a few rings of a crease are smoothed the more the nearer they are, by Taubin's pair
    of steps (1995), which does not shrink.
    """
    edge, theta, _, _ = dihedrals(vertices, faces)
    low, high = np.full(len(vertices), origin.max() + 1), np.full(len(vertices), origin.min() - 1)
    for corner in range(3):
        np.minimum.at(low, faces[:, corner], origin)
        np.maximum.at(high, faces[:, corner], origin)
    crease = low < high
    crease[edge[theta > SHARP]] = True
    crease &= ~fixed
    if not crease.any():
        return vertices
    neighbours = _neighbours(faces, len(vertices))
    weight = crease.astype(float)
    reached = crease
    for ring in range(1, CREASE_RINGS + 1):
        wider = reached | (neighbours @ reached > 0)
        weight[wider & ~reached] = 1 - ring / (CREASE_RINGS + 1)
        reached = wider
    weight[fixed] = 0
    for _ in range(CREASE_ROUNDS):
        vertices = _relax(vertices, neighbours, weight, *TAUBIN)
    return vertices


def swelling(
    vertices: np.ndarray, faces: np.ndarray, axis: np.ndarray, volume: float
) -> tuple[np.ndarray, float]:
    """Find how to move a mesh's vertices square to ``axis`` (3,) for it to have a volume in mm^3.

    Returns
    -------
    direction : (V, 3) float64
        The part of the unit normals that is square to the axis.
    amount : float
        mm to move along it.
    """
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    direction = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(direction, faces[:, corner], normal)
    size = np.linalg.norm(direction, axis=1, keepdims=True)
    direction = np.divide(direction, size, out=np.zeros_like(direction), where=size > 0)
    direction -= np.outer(direction @ axis, axis)
    gain = float(np.einsum("fc,fc->", normal, direction[faces].mean(axis=1)))  # mm^3 per mm
    return direction, (volume - mesh_volume(vertices, faces)) / gain if gain > 0 else 0.0


def untangle(
    vertices: np.ndarray, faces: np.ndarray, before: np.ndarray | None = None
) -> tuple[np.ndarray, int, int]:
    """Move a mesh's vertices where it passes through itself, until it does not.

    Parameters
    ----------
    vertices, faces : (V, 3) float64, (F, 3) int64
        A closed mesh.
    before : (V, 3) float64, optional
        Where the vertices were before they were smoothed: the first thing to try.

    Returns
    -------
    vertices : (V, 3) float64
    found, left : int
        Pairs of triangles that passed through each other, and that still do.
    """
    pairs = self_intersections(vertices, faces)
    found = len(pairs)
    if found == 0:
        return vertices, 0, 0
    neighbours = _neighbours(faces, len(vertices))
    returns = 0 if before is None else RETURN_ROUNDS
    for turn in range(returns + RELAX_ROUNDS):
        moving = np.zeros(len(vertices), bool)
        moving[faces[pairs].ravel()] = True
        for _ in range(1 + (turn if turn < returns else (turn - returns) // 2)):
            moving |= neighbours @ moving > 0
        if turn < returns:
            vertices = np.where(moving[:, None], before, vertices)
        else:
            vertices = _relax(vertices, neighbours, moving.astype(float), *(4 * (0.5,)))
        around = moving | (neighbours @ moving > 0)
        near = np.flatnonzero(around[faces].any(axis=1))
        pairs = near[self_intersections(vertices, faces[near])]
        if len(pairs) == 0:  # the rest of the mesh is looked at only when the patch looks sound
            pairs = self_intersections(vertices, faces)
        if len(pairs) == 0:
            break
    return vertices, found, len(pairs)


def remesh(vertices: np.ndarray, faces: np.ndarray, cell: float) -> tuple[np.ndarray, np.ndarray]:
    """Mesh the solid anew on a grid of ``cell`` mm: closed and free of self-intersections by construction.

    What the mesh winds around is smoothed over a cell and cut at one half by marching cubes
    (Lewiner et al. 2003): the last resort for surfaces that could not be untangled.
    """
    low, high = vertices.min(axis=0) - 4 * cell, vertices.max(axis=0) + 4 * cell
    shape = tuple(int(size) for size in np.ceil((high - low) / cell))
    affine = np.diag([cell, cell, cell, 1.0])
    affine[:3, 3] = low
    inside = voxelise(vertices, faces, Frame(affine, 2, shape), np.zeros(3), shape)
    field = gaussian_filter(inside.astype(np.float32), 1.2)
    index, faces, _, _ = marching_cubes(field, 0.5 + 1e-4)
    return low + cell * index.astype(float), np.ascontiguousarray(faces[:, ::-1].astype(np.int64))


def _neighbours(faces: np.ndarray, count: int) -> csr_array:
    """Adjacency (V, V) of a closed mesh's vertices."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    ones = np.ones(len(start), np.float64)
    return csr_array((ones, (start, end)), shape=(count, count))


def _relax(vertices: np.ndarray, neighbours: csr_array, weight: np.ndarray, *steps: float) -> np.ndarray:
    """Move vertices by shares ``steps`` of their weight (V,) towards the mean of their neighbours."""
    moving = np.flatnonzero(weight)
    rows = neighbours[moving]
    degree = np.maximum(rows.sum(axis=1), 1)[:, None]
    share = weight[moving][:, None]
    vertices = vertices.copy()
    for step in steps:
        vertices[moving] += step * share * (rows @ vertices / degree - vertices[moving])
    return vertices


def combine(bodies: Sequence[Manifold], holes: Sequence[bool], depths: Sequence[int]) -> Manifold:
    """Union and difference in the order in which the rings nest.

    Outlines (depth 0) are joined, their holes (depth 1) taken away, islands in holes (depth 2) added,
    and so on.
    """
    whole = Manifold()
    for depth in sorted(set(depths)):
        for hole in (False, True):
            layer = [
                body
                for body, is_hole, its_depth in zip(bodies, holes, depths, strict=True)
                if its_depth == depth and is_hole == hole
            ]
            if layer:
                joined = Manifold.batch_boolean(layer, OpType.Add)
                whole = whole - joined if hole else whole + joined
    return whole
