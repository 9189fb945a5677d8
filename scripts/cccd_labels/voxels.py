"""Surfaces and the voxels of their map: which they hold, and whether they lie near their own."""

from __future__ import annotations

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from cccd.containers import Structure
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, RealArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import voxelise
from cccd.inputs.annotation import fill_mask
from cccd.surface.checks import Violation


def block_of(
    mesh: Mesh, affine: FloatArray, shape: tuple[int, int, int]
) -> tuple[IntArray, tuple[int, int, int]]:
    """First voxel (3,) and shape of the block of a grid (affine (4, 4), shape) that a mesh reaches."""
    index = np.linalg.solve(affine[:3, :3], (mesh.vertices - affine[:3, 3]).T).T
    low = np.clip(np.floor(index.min(axis=0)).astype(np.int64), 0, shape)
    high = np.clip(np.ceil(index.max(axis=0)).astype(np.int64) + 1, low, shape)
    a, b, c = (int(size) for size in high - low)
    return low, (a, b, c)


def voxels_within(mesh: Mesh, affine: FloatArray, shape: tuple[int, int, int]) -> IntArray:
    """Flat indices (N,) of the voxels of a grid whose centres a closed mesh holds; see `voxelise`."""
    low, size = block_of(mesh, affine, shape)
    if 0 in size:
        return np.zeros(0, np.int64)
    inside = np.argwhere(voxelise(mesh, affine, size, low)) + low
    return np.asarray(np.ravel_multi_index(tuple(inside.T), shape), np.int64)


def check_walls(mesh: Mesh, structure: Structure) -> list[str]:
    """Find what is wrong with a surface whose walls are shared: lines for people.

    It is closed, and nowhere further from the organ's voxels than their diagonal.

    Parameters
    ----------
    mesh : Mesh
        mm RAS.
    structure : Structure
        With the organ's mask; where only some slices are annotated, the surface's own voxels count as well.
    """
    found: list[Violation] = []
    if not mesh.is_closed_manifold:
        found.append(Violation("the surface is not a closed manifold"))
    mask = structure.mask if structure.annotation is None else fill_mask(structure, mesh)
    if mask is not None:
        found += _off_voxels(mesh, mask, structure.frame.affine, structure.origin)
    return [violation.line(np.eye(4)) for violation in found]


def _off_voxels(mesh: Mesh, mask: BoolArray, affine: FloatArray, origin: RealArray) -> list[Violation]:
    """Find where the surface is further from a mask's voxels than their diagonal."""
    index = np.linalg.solve(affine[:3, :3], (mesh.vertices - affine[:3, 3]).T).T - origin
    cell = np.rint(index).astype(np.int64)
    outside: BoolArray = np.asarray(((cell < 0) | (cell >= mask.shape)).any(axis=1), np.bool_)
    outside[~outside] = ~mask[tuple(cell[~outside].T)]
    border, beyond = np.argwhere(mask & ~ndimage.binary_erosion(mask)), index[outside]
    nearest = cKDTree(border @ affine[:3, :3].T).query(beyond @ affine[:3, :3].T)[1]
    aside = np.maximum(np.abs(beyond - border[nearest]) - 0.5, 0)  # from the voxel, not its centre
    far = np.zeros(len(index))
    far[outside] = np.linalg.norm(aside @ affine[:3, :3].T, axis=1)
    most = float(np.linalg.norm(np.linalg.norm(affine[:3, :3], axis=0)))
    if far.max(initial=0) <= most:
        return []
    order = np.argsort(-far, kind="stable")
    text = f"the surface is {far.max():.2g} mm away from the organ's voxels, farthest"
    return [Violation(text, mesh.vertices[order[far[order] > most]])]
