"""What the page's viewer shows of one structure, computed once: meshes made small, and what colours them.

The surface's vertices carry their distance to the reference, the mean curvature and the error band's width;
boundary pixels and curve points carry whether a greedy chain code gets stuck on them.
"""

from __future__ import annotations

import numpy as np
import shapely

from cccd.bands import Band
from cccd.chaincode import changed_pixels, isolated_corners, junction_pixels, on_pixel_chain
from cccd.containers import Boundaries, Curves, Frame, Structure, View
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.curvature import mean_curvature
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh
from cccd.geometry.polygons import RaggedPolygons
from cccd.geometry.sections import cross_sections
from cccd.surface.measure import mask_surface

__all__ = [
    "lines_on_slices",
    "make_view",
    "reference_surface",
    "sort_spatially",
    "voxel_surface",
]

#: Lines of the error band on slices are kept to this share of a pixel.
_LINE_PX = 0.05

#: A mesh is simplified to at most this many triangles: then a structure takes some 1.5 MB of its page.
VIEWER_TRIANGLES = 80_000


def voxel_surface(structure: Structure) -> Mesh | None:
    """Run marching cubes on the mask, as the surface stage measures against; None without a whole mask."""
    if structure.mask is None or structure.annotation is not None or not structure.mask.any():
        return None
    return mask_surface(structure)


def reference_surface(structure: Structure) -> tuple[Mesh, str] | None:
    """Find what the surface is measured against, and its name: analytic truth, else the mask's voxels."""
    if structure.truth is not None:
        return structure.truth.outwards(), "the analytic surface"
    voxels = voxel_surface(structure)
    return None if voxels is None else (voxels, "the mask's voxel surface")


def sort_spatially(mesh: Mesh) -> tuple[Mesh, np.ndarray]:
    """Sort triangles along a Morton curve and vertices by first use, so that differences are small.

    Returns
    -------
    mesh : Mesh
    order : (V,) int
        Where each vertex stood before; unused vertices are dropped.
    """
    centroids = mesh.vertices[mesh.faces].mean(axis=1)
    low, extent = centroids.min(axis=0), np.ptp(centroids, axis=0).max() or 1.0
    cells = ((centroids - low) * (1023 / extent)).astype(np.uint32)
    key = np.zeros(len(cells), np.uint32)
    for bit in range(10):
        for axis in range(3):
            key |= ((cells[:, axis] >> bit) & 1) << np.uint32(3 * bit + axis)
    faces = mesh.faces[np.argsort(key, kind="stable")]
    used, first, inverse = np.unique(faces, return_index=True, return_inverse=True)
    by_use = np.argsort(first)
    rank = np.empty_like(by_use)
    rank[by_use] = np.arange(len(by_use))
    order = used[by_use]
    return Mesh(mesh.vertices[order], rank[inverse].reshape(-1, 3)), order


def make_view(
    structure: Structure,
    boundaries: Boundaries | None,
    curves: Curves,
    surface: Mesh,
    band: Band | None = None,
) -> View:
    """Make what the viewer shows of one structure.

    Parameters
    ----------
    structure : Structure
        Its truth or its mask is the reference; without either no distance is measured.
    boundaries : Boundaries or None
        The boundary's pixels as they were found, if there are any.
    curves : Curves
        The ordered curves.
    surface : Mesh
        In mm RAS.
    band : Band, optional
        How far off the surface may be.
    """
    whole, cubes = surface.outwards(), voxel_surface(structure)
    shown, _ = sort_spatially(whole.simplified(VIEWER_TRIANGLES))
    values = {"curvature": mean_curvature(whole, shown.vertices)}
    lines: dict[str, Curves] = {}
    if band is not None:
        moved = band.moved_to(surface.vertices, shown.vertices)
        values["band"] = moved.inner + moved.outer
        slices = np.arange(curves.slice.min(), curves.slice.max() + 1)
        sides = {"inner": band.inner_mesh(surface), "outer": band.outer_mesh(surface)}
        lines = {name: lines_on_slices(side, curves.frame, slices) for name, side in sides.items()}
    reference, name = reference_surface(structure) or (None, "")
    if reference is not None:
        values["distance"] = to_mesh(shown.vertices, reference)
    meshes = {"surface": shown}
    if cubes is not None:
        meshes["cubes"] = sort_spatially(cubes.simplified(VIEWER_TRIANGLES))[0]
    return View(meshes, values, len(whole.faces), name, _stuck(boundaries, curves), lines)


def lines_on_slices(mesh: Mesh, frame: Frame, slices: IntArray) -> Curves:
    """Cut a closed mesh in mm RAS by slices (S,) of a frame; points lie within `_LINE_PX` of the cuts."""
    indices = (
        np.column_stack([mesh.vertices, np.ones(len(mesh.vertices))]) @ np.linalg.inv(frame.stack_affine).T
    )
    cuts = cross_sections(Mesh(indices[:, :3], mesh.faces), np.array([0.0, 0, 1]), slices.astype(float))
    loops = [_thinned(loop[:, :2]) for on_slice in cuts for loop in on_slice]
    owner = np.repeat(slices, [len(on_slice) for on_slice in cuts]).astype(np.int32)
    lines = RaggedPolygons.of(loops)
    return Curves(lines.points, lines.offsets, owner, lines.signed_areas < 0, frame)


def _thinned(loop: FloatArray) -> FloatArray:
    """Leave out points (n, 2) by the algorithm of Douglas and Peucker (1973)."""
    return shapely.get_coordinates(shapely.simplify(shapely.linearrings(loop), _LINE_PX))[:-1]


def _stuck(boundaries: Boundaries | None, curves: Curves) -> dict[str, np.ndarray]:
    """Flag the boundary's junction pixels and isolated corners (P,), and what ordering changed (P,), (Q,)."""
    if boundaries is None:
        return {}
    flags = {"junctions": junction_pixels(boundaries), "isolated_corners": isolated_corners(boundaries)}
    if on_pixel_chain(curves.points, curves.offsets).any():  # contours as given have no chain code
        flags["dropped"], flags["bridged"] = changed_pixels(boundaries, curves)
    return flags
