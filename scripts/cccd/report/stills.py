"""Figure 17 as a still: marching cubes, the spline surface and its control net from one side."""

from __future__ import annotations

import numpy as np
from matplotlib.collections import LineCollection

from cccd.geometry.bsplines import Patch
from cccd.geometry.ply import read_ply
from cccd.report.meshes import simplify, voxel_surface
from cccd.report.render import VIEWS, frame_view, paint_mesh
from cccd.report.results import StructureFiles
from cccd.report.svg import axes, style, to_svg

__all__ = ["draw_surface_still"]

#: Painting is slow: each mesh is simplified to this many triangles, about one per pixel.
_TRIANGLES = 60_000

_NET_COLOUR = "#0072b2"


def draw_surface_still(key: str, files: StructureFiles) -> str | None:
    """Draw one structure's surface as the paper's Figure 17 does; None where there is none.

    Parameters
    ----------
    key : str
        Id of the figure.
    files : StructureFiles
    """
    structure, patches = files.structure(), files.patches()
    if structure is None or patches is None or not files.mesh.is_file():
        return None
    surface = read_ply(files.mesh)
    cubes = voxel_surface(structure)
    panels = [("c  control net", surface, patches)]
    panels.insert(0, ("b  spline surface", surface, []))
    if cubes is not None:
        panels.insert(0, ("a  marching cubes", cubes, []))
    view = VIEWS[0]
    up = np.array(view.up)
    across = np.stack([np.cross(up, view.towards), up], axis=1)  # (3, 2): world to picture
    with style():
        figure, grid = axes(3.0 * len(panels), 3.2, columns=len(panels))
        for axis, (title, mesh, nets) in zip(np.atleast_1d(grid), panels, strict=True):
            centre = frame_view(axis, surface.vertices)
            small = simplify(mesh, _TRIANGLES)
            paint_mesh(axis, small.vertices, small.faces, centre, view, rasterized=True)
            lines = [(line - centre) @ across for patch in nets for line in _net_lines(patch)]
            axis.add_collection(
                LineCollection(lines, colors=_NET_COLOUR, linewidths=0.35, alpha=0.7, rasterized=True)
            )
            axis.set_title(title)
        return to_svg(figure, key, "Marching cubes, spline surface and control net, seen from the front")


def _net_lines(patch: Patch) -> list[np.ndarray]:
    """Polylines (n, 3) of a control net in world mm, both ways, closed where the patch is."""
    points = patch.control_points
    if patch.closed_u:
        points = np.concatenate([points, points[:1]])
    if patch.closed_v:
        points = np.concatenate([points, points[:, :1]], axis=1)
    return [*points, *points.transpose(1, 0, 2)]
