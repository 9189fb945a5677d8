"""What a surface is worth: agreement with the mask or the phantom's truth, soundness, and size."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cccd.chaincode import signed_areas
from cccd.containers import Structure
from cccd.metrics import (
    bending_per_area,
    count_self_intersections,
    curvature_per_area,
    dice,
    is_closed_manifold,
    mesh_volume,
    surface_distances,
    voxelise,
)
from cccd.surface.surface import Surface
from cccd.tolerances import VOLUME_BIAS

__all__ = ["mask_surface", "measure_mesh", "measure_surface", "volume_warnings"]


def mask_surface(structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """Marching cubes at one half on a structure's mask: vertices (V, 3) mm RAS, faces (F, 3)."""
    from skimage.measure import marching_cubes  # loaded where there is a mask to measure against

    padded = np.pad(structure.mask, 1).astype(np.float32)
    index, faces, _, _ = marching_cubes(padded, 0.5)
    affine = structure.frame.affine
    vertices = (index - 1 + structure.origin) @ affine[:3, :3].T + affine[:3, 3]
    faces = np.asarray(faces, np.int64)
    if mesh_volume(vertices, faces) < 0:
        faces = faces[:, ::-1]
    return vertices, np.ascontiguousarray(faces)


def measure_mesh(
    vertices: np.ndarray, faces: np.ndarray, structure: Structure, seed: int = 0
) -> dict[str, float | int | bool]:
    """Figures of one closed mesh; those that need a mask or a truth are absent without one.

    The volume is compared with the phantom's where there is a truth, with what drawn contours enclose,
    and with the voxels' otherwise; distances are to the truth's surface, or to marching cubes on the mask.
    """
    figures: dict[str, float | int | bool] = {
        "volume_ml": mesh_volume(vertices, faces) / 1000,
        "bending_per_area_mm2": bending_per_area(vertices, faces),
        "curvature_per_area_mm": curvature_per_area(vertices, faces),
        "triangles": len(faces),
        "bytes": 12 * len(vertices) + 13 * len(faces),
        "closed_manifold": is_closed_manifold(faces),
        "self_intersections": count_self_intersections(vertices, faces),
    }
    if structure.mask is not None:
        block = voxelise(vertices, faces, structure.frame, structure.origin, structure.mask.shape)
        figures["dice_3d"] = float(dice(structure.mask, block))
    reference, whole = structure.truth, None
    voxel = float(np.prod(structure.frame.spacing))
    if reference is not None:
        whole = mesh_volume(*reference)
    elif structure.mask is not None:
        reference = mask_surface(structure)
        whole = np.count_nonzero(structure.mask) * voxel
    elif structure.contours is not None:
        whole = float(signed_areas(structure.contours.points, structure.contours.offsets).sum()) * voxel
    if whole is not None:
        figures["volume_bias"] = mesh_volume(vertices, faces) / whole - 1
    if reference is not None:
        distances = surface_distances((vertices, faces), reference, np.random.default_rng(seed))
        figures |= {f"{name}_mm": value for name, value in distances.items()}
    return figures


def volume_warnings(figures: Mapping) -> list[str]:
    """Say so when a surface holds much more or less than its organ, as one does that lost a part."""
    bias = figures.get("volume_bias", 0.0)
    if abs(bias) <= VOLUME_BIAS:
        return []
    return [f"the surface holds {abs(bias):.0%} {'less' if bias < 0 else 'more'} than the organ: look at it"]


def measure_surface(surface: Surface, structure: Structure) -> dict:
    """Everything for ``metrics.json``: the mesh's figures and what the lofting reported."""
    return {
        **measure_mesh(surface.vertices, surface.faces, structure),
        **{key: value for key, value in surface.report.items() if key not in ("warnings", "vertices")},
    }
