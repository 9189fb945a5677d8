"""What a surface is worth: agreement with the mask or the phantom's truth, soundness, and size."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from cccd.containers import Structure
from cccd.geometry.arrays import BoolArray, FloatArray, RealArray
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import voxelise
from cccd.metrics import dice, normal_angles, surface_distances
from cccd.surface.surface import LoftedSurface

#: Points on each of two surfaces by which their distances are measured.
SAMPLES = 50_000


def mask_surface(structure: Structure) -> Mesh:
    """Marching cubes at one half on the mask of a structure that has one, in mm RAS."""
    if structure.mask is None:
        raise ValueError("the structure has no mask")
    frame = structure.frame
    mesh = voxel_surface(structure.mask, frame.affine, structure.origin)
    if frame.copied_to is None:
        return mesh
    height = (mesh.vertices - frame.affine[:3, 3]) @ frame.normal
    beyond = height - np.clip(height, *frame.ends)
    return Mesh(mesh.vertices - beyond[:, None] * frame.normal, mesh.faces)


def voxel_volume(structure: Structure) -> float:
    """Volume in mm^3 of the voxels of a structure's mask, as far as they lie within the file's grid."""
    frame, counts = structure.frame, np.count_nonzero(structure.required_stack("mask"), axis=(1, 2))
    if frame.copied_to is None:
        return float(counts.sum() * np.prod(frame.spacing))
    faces = (np.arange(len(counts) + 1) + int(structure.stack_origin[0]) - 0.5) * frame.slice_spacing
    return float(counts @ np.diff(np.clip(faces, *frame.ends)) * np.prod(frame.pixel_spacing))


def voxel_surface(mask: BoolArray, affine: FloatArray, origin: RealArray) -> Mesh:
    """Marching cubes at one half on a mask (a, b, c), of which ``origin`` (3,) is the first voxel's index."""
    padded = np.pad(mask, 1).astype(np.float32)
    return ScalarGrid(padded, affine, origin - 1).isosurface(0.5).outwards()


class Reference(NamedTuple):
    """What a structure's surfaces are measured against: the truth's mesh, or marching cubes on the mask."""

    mesh: Mesh
    volume: float  # mm^3: the truth's, or that of the mask's voxels

    @classmethod
    def of(cls, structure: Structure) -> Reference:
        """Take it from a structure that has a mask or a truth."""
        if structure.truth is not None:
            return cls(structure.truth, structure.truth.volume)
        return cls(mask_surface(structure), voxel_volume(structure))


def measure_mesh(
    mesh: Mesh, structure: Structure, reference: Reference | None = None, samples: int = SAMPLES
) -> dict[str, float | int | bool]:
    """Size, smoothness and soundness of one closed mesh, and its agreement with the structure.

    Those who measure many meshes make the ``reference`` of the structure once. The figures of the agreement
    are those of `measure_agreement`.
    """
    figures: dict[str, float | int | bool] = {
        "volume_ml": mesh.volume / 1000,
        "bending_per_area_mm2": mesh.bending_per_area,
        "curvature_per_area_mm": mesh.curvature_per_area,
        "triangles": len(mesh.faces),
        "bytes": 12 * len(mesh.vertices) + 13 * len(mesh.faces),
        "closed_manifold": mesh.is_closed_manifold,
        "self_intersections": len(mesh.self_intersections()),
    }
    if figures["closed_manifold"]:
        figures["genus"] = mesh.genus
    if structure.truth is not None:
        figures["genus_true"] = structure.truth.genus
    return figures | measure_agreement(mesh, structure, reference, samples)


def measure_agreement(
    mesh: Mesh, structure: Structure, reference: Reference | None = None, samples: int = SAMPLES
) -> dict[str, float]:
    """Dice, volume bias, distances in mm and angles between normals, as far as there is a mask or a truth.

    The volume is compared with the phantom's where there is a truth, with what drawn contours enclose,
    and with the voxels' otherwise; distances are to the truth's surface, or to marching cubes on the mask,
    from so many ``samples`` of each surface.
    """
    figures: dict[str, float] = {}
    if structure.mask is not None:
        figures["dice_3d"] = voxel_dice(mesh, structure)
    if reference is None and is_known(structure):
        reference = Reference.of(structure)
    whole = None
    if reference is not None:
        whole = reference.volume
    elif structure.contours is not None and structure.annotation is None:
        voxel = float(np.prod(structure.frame.spacing))
        whole = float(structure.contours.polygons.signed_areas.sum()) * voxel
    if whole is not None:
        figures["volume_bias"] = mesh.volume / whole - 1
    if reference is not None:
        distances = surface_distances(mesh, reference.mesh, np.random.default_rng(0), samples)
        figures |= {f"{name}_mm": value for name, value in distances.items()}
    return figures | _normals(mesh, structure)


def is_known(structure: Structure) -> bool:
    """Whether there is a surface to measure against: a mask of some slices has none between them."""
    return structure.truth is not None or (structure.mask is not None and structure.annotation is None)


def voxel_dice(mesh: Mesh, structure: Structure) -> float:
    """Dice of the voxels that a closed mesh holds with those of the mask, on the slices that were drawn."""
    if structure.mask is None:
        raise ValueError("the structure has no mask")
    block = voxelise(mesh, structure.frame.affine, structure.mask.shape, structure.origin)
    if structure.annotation is not None:
        axis = structure.frame.slice_axis
        drawn = structure.annotation.slices - int(structure.origin[axis])
        return float(dice(structure.mask.take(drawn, axis), block.take(drawn, axis)))
    return float(dice(structure.mask, block))


def measure_band(surface: LoftedSurface) -> dict[str, Any]:
    """Measure the volume's interval in ml and the band's mean width in mm; whether it is extrapolated."""
    band, interval, area = surface.band, surface.volume_interval, surface.mesh.vertex_areas
    if band is None or interval is None:
        return {}
    low, high = interval
    return {
        "band": band.share,
        "volume_low_ml": low / 1000,
        "volume_high_ml": high / 1000,
        "inner_mean_mm": float(area @ band.inner / area.sum()),
        "outer_mean_mm": float(area @ band.outer / area.sum()),
        "band_extrapolated": band.extrapolated,
    }


def _normals(mesh: Mesh, structure: Structure) -> dict[str, float]:
    """Angles to the true surface's normals in degrees, where there is a true surface."""
    if structure.truth is None:
        return {}
    return normal_figures(normal_angles(mesh, structure.truth, np.random.default_rng(0)))


def normal_figures(angles: FloatArray) -> dict[str, float]:
    """Median and 90th percentile of angles (P,) between normals, in degrees."""
    return {
        "normals_median_deg": float(np.median(angles)),
        "normals_p90_deg": float(np.percentile(angles, 90)),
    }
