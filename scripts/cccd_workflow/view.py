"""What the page's viewer shows of one structure, computed once: meshes made small, and what colours them.

The surface's vertices carry their distance to the reference, the mean curvature and the error band's width;
boundary pixels and curve points carry whether the ordering dropped or added them.
"""

from __future__ import annotations

import numpy as np
import shapely

from cccd.bands import Band
from cccd.chaincode import changed_pixels, on_pixel_chain
from cccd.containers import Boundaries, Curves, Frame, Structure
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh
from cccd.geometry.polygons import RaggedPolygons
from cccd.geometry.sections import cross_sections
from cccd_viewers.page_files import View
from cccd_workflow.surface_measures import mask_surface

#: Lines of the error band on slices are kept to this share of a pixel.
_LINE_PX = 0.05

#: A mesh is simplified to at most this many triangles: then a structure takes some .7 MB of its page.
VIEWER_TRIANGLES = 30_000


def voxel_surface(structure: Structure) -> Mesh | None:
    """Run marching cubes on the mask, as the surface stage measures against; None without a whole mask."""
    if structure.mask is None or structure.annotation is not None or not structure.mask.any():
        return None
    return mask_surface(structure)


def reference_surface(structure: Structure, voxels: Mesh | None) -> tuple[Mesh, str] | None:
    """Choose what the surface is measured against, and its name: analytic truth, else the mask's voxels."""
    if structure.truth is not None:
        return structure.truth.outwards(), "the analytic surface"
    return None if voxels is None else (voxels, "the mask's voxel surface")


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
    shown = whole.simplified(VIEWER_TRIANGLES)
    values = {"curvature": whole.mean_curvature(shown.vertices)}
    lines: dict[str, Curves] = {}
    if band is not None:
        moved = band.moved_to(surface.vertices, shown.vertices)
        values["band"] = moved.inner + moved.outer
        slices = np.arange(curves.slice.min(), curves.slice.max() + 1)
        sides = band.sides(surface).items()
        lines = {name: lines_on_slices(side, curves.frame, slices) for name, side in sides}
    reference, name = reference_surface(structure, cubes) or (None, "")
    if reference is not None:
        values["distance"] = to_mesh(shown.vertices, reference)
    meshes = {"surface": shown}
    if cubes is not None:
        meshes["cubes"] = cubes.simplified(VIEWER_TRIANGLES)
    return View(meshes, values, len(whole.faces), name, _changed(boundaries, curves), lines)


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


def _changed(boundaries: Boundaries | None, curves: Curves) -> dict[str, np.ndarray]:
    """Flag the boundary's pixels (P,) that are on no curve, and the curves' points (Q,) that bridge gaps."""
    if boundaries is None or not on_pixel_chain(curves.points, curves.offsets).any():
        return {}  # contours as given have no chain code
    dropped, bridged = changed_pixels(boundaries, curves)
    return {"dropped": dropped, "bridged": bridged}
