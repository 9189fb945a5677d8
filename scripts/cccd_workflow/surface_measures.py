"""How well surfaces agree, how sound they are, and what ``metrics.json`` tells of a structure's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import scipy

from cccd.containers import Structure
from cccd.geometry.arrays import BoolArray, FloatArray, RealArray
from cccd.geometry.distance import nearest_faces, unsigned_to_mesh
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import dice, voxelise
from cccd.store import bodies_bytes
from cccd.surface.surface import LoftedSurface

#: A surface whose volume differs from its organ's by more than this share gets a warning.
VOLUME_BIAS = 0.05
#: Points at which normals are compared.
ANGLES = 10_000


class Gaps(NamedTuple):
    """Distances in mm from points on each of two surfaces to the other, the points uniform by area.

    Attributes
    ----------
    there, back : (count,) float64
        From the first surface, and from the second.
    farthest : float
        The largest distance of these points, and of the vertices.
    areas : tuple of float
        Areas of the two surfaces.
    """

    there: FloatArray
    back: FloatArray
    farthest: float
    areas: tuple[float, float]

    @classmethod
    def between(cls, first: Mesh, second: Mesh, rng: np.random.Generator, count: int = 50_000) -> Gaps:
        """Measure them, from ``count`` points on each mesh."""
        points, others = first.sample(count, rng), second.sample(count, rng)
        there, back = unsigned_to_mesh(points, second), unsigned_to_mesh(others, first)
        farthest = max(_farthest(first, second, points, there), _farthest(second, first, others, back))
        return cls(there, back, farthest, (first.area, second.area))

    @property
    def figures(self) -> dict[str, float]:
        """What `surface_distances` returns."""
        return {
            "assd": float(self.there.sum() + self.back.sum()) / (len(self.there) + len(self.back)),
            "hd95": float(max(np.percentile(self.there, 95), np.percentile(self.back, 95))),
            "hausdorff": self.farthest,
        }

    def surface_dice(self, tolerance: float) -> float:
        """Share of both surfaces that lies within a tolerance in mm of the other (Nikolov et al. 2021)."""
        within = [float(np.mean(part <= tolerance)) for part in (self.there, self.back)]
        return float(np.average(within, weights=self.areas))


def surface_distances(
    first: Mesh, second: Mesh, rng: np.random.Generator, count: int = 50_000
) -> dict[str, float]:
    """Distances in mm between two meshes, both ways, from area-uniform points to the other's triangles.

    Returns
    -------
    dict
        ``assd`` (average symmetric surface distance), ``hd95`` (the larger of the two 95th
        percentiles) and ``hausdorff`` (the largest distance met, vertices included).
    """
    return Gaps.between(first, second, rng, count).figures


def _farthest(mesh: Mesh, other: Mesh, points: FloatArray, distances: FloatArray) -> float:
    """Largest distance to another mesh, of points (P, 3) whose distances (P,) are known, and of vertices."""
    far = float(distances.max())
    away, nearest = scipy.spatial.cKDTree(points).query(mesh.vertices)
    further = mesh.vertices[distances[nearest] + away > far]  # no others can be: a step away is a step more
    return max(far, float(unsigned_to_mesh(further, other).max())) if len(further) else far


def normal_angles(mesh: Mesh, truth: Mesh, rng: np.random.Generator, *, is_smooth: bool = True) -> np.ndarray:
    """Angles (N,) in degrees between a mesh's normals and the true surface's at the nearest points.

    Points are uniform by area of the truth. A mesh's normal is that of the face nearest to the point; the
    true surface's is between those of its vertices, because its own faces are coarser than its shape. Where
    it is not ``is_smooth``, but a mesh like the other, its normal is its face's: equal meshes agree.
    """
    face = rng.choice(len(truth.faces), ANGLES, p=truth.face_areas / truth.area)
    weights = rng.dirichlet(np.ones(3), ANGLES)
    points = np.einsum("pc,pcx->px", weights, truth.vertices[truth.faces[face]])
    at_corners = truth.vertex_normals[truth.faces[face]] if is_smooth else truth.unit_normals[face][:, None]
    true = (weights[..., None] * at_corners).sum(axis=1)
    nearest = mesh.unit_normals[nearest_faces(points, mesh)]
    across = np.linalg.norm(np.cross(true, nearest), axis=1)
    return np.degrees(np.arctan2(across, np.einsum("px,px->p", true, nearest)))


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


def bending_per_area(mesh: Mesh) -> float:
    r"""Bending energy of the surface per area, in 1/mm^2.

    The integral of :math:`k_1^2 + k_2^2 = (k_1 + k_2)^2 - 2 k_1 k_2` over the surface, divided by its
    area. The first term is the discrete-shell energy :math:`\sum 3 \theta^2 l^2 / A` of Grinspun et
    al. (2003): each edge of length l bends by its dihedral angle :math:`\theta` between two faces of
    together area A. The second is :math:`4 \pi \chi` by Gauss and Bonnet, with the Euler
    characteristic of the mesh. Slivers count as if they were as wide as a tenth of their edge.
    """
    edge, theta, length, area, _ = mesh.dihedrals
    if len(edge) == 0:
        return 0.0
    area = np.maximum(area, 0.1 * length**2)
    shell = np.divide(3 * theta**2 * length**2, area, out=np.zeros_like(area), where=area > 0).sum()
    euler = np.count_nonzero(np.bincount(mesh.faces.ravel())) - len(edge) + len(mesh.faces)
    return float(max(shell - 4 * np.pi * euler, 0.0) / mesh.area)


def measure_mesh(
    mesh: Mesh, structure: Structure, reference: Reference | None = None, samples: int = SAMPLES
) -> dict[str, float | int | bool]:
    """Size, smoothness and soundness of one closed mesh, and its agreement with the structure.

    Those who measure many meshes make the ``reference`` of the structure once. The figures of the agreement
    are those of `measure_agreement`.
    """
    figures: dict[str, float | int | bool] = {
        "volume_ml": mesh.volume / 1000,
        "bending_per_area_mm2": bending_per_area(mesh),
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


#: What of the lofting's report is no figure, or measured anew.
_UNMEASURED = ("warnings", "vertices")


def volume_warnings(figures: Mapping[str, Any]) -> list[str]:
    """Say so when a surface holds much more or less than its organ, as one does that lost a part."""
    bias = float(figures.get("volume_bias", 0.0))
    if abs(bias) <= VOLUME_BIAS:
        return []
    return [
        f"the surface's volume is {abs(bias):.0%} {'below' if bias < 0 else 'above'} the organ's: check it"
    ]


def measure_surface(surface: LoftedSurface, structure: Structure) -> dict[str, Any]:
    """Everything for ``metrics.json``: the mesh's figures, what the lofting reported, the bytes kept."""
    reported = {key: value for key, value in surface.report.items() if key not in _UNMEASURED}
    reference = Reference.of(structure) if is_known(structure) else None
    kept = bodies_bytes(surface.bodies)
    compactness = {"compactness": reported["marching_cubes_bytes"] / kept} if kept else {}
    compared = {"reference": "mask" if structure.truth is None else "true surface"} if reference else {}
    return {
        **measure_mesh(surface.mesh, structure, reference),
        **_size_and_place(surface.mesh),
        **compared,
        **surface.band_figures,
        **reported,
        "control_bytes": kept,
        **compactness,
    }


def _size_and_place(mesh: Mesh) -> dict[str, Any]:
    """Area, bounding box (its lowest and its highest corner) and centre of mass of a closed mesh, mm RAS."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    corners = mesh.vertices[mesh.faces] - low  # of tetrahedra whose fourth corner is the box's lowest
    volumes = np.linalg.det(corners)
    return {
        "area_mm2": mesh.area,
        "bounding_box_mm": [low.tolist(), high.tolist()],
        "centroid_mm": (low + volumes @ corners.sum(axis=1) / (4 * volumes.sum())).tolist(),
    }
