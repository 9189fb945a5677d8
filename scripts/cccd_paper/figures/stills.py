"""Figure 17 as a still: marching cubes, the spline surface and its control net from one side."""

from __future__ import annotations

import numpy as np
from matplotlib.collections import LineCollection

from cccd.geometry.subdivision import quad_edges
from cccd_workflow.report.render import VIEWS, frame_view, paint_mesh
from cccd_workflow.report.results import StructureFiles
from cccd_workflow.report.svg import axes, style, to_svg

_NET_COLOUR, _CREASE_COLOUR = "#0072b2", "#d55e00"


def draw_surface_still(key: str, files: StructureFiles) -> str | None:
    """Draw one structure's surface as the paper's Figure 17 does; None where there is none.

    Parameters
    ----------
    key : str
        Id of the figure.
    files : StructureFiles
    """
    view, bodies = files.view(), files.bodies()
    if view is None or not bodies:
        return None
    surface = view.meshes["surface"]
    edges = np.concatenate([body.vertices[quad_edges(body.quads)[0]] for body in bodies])
    creases = np.concatenate([body.vertices[body.creases] for body in bodies])
    lines = [(edges, _NET_COLOUR), (creases, _CREASE_COLOUR)]
    panels = [("b  spline surface", surface, []), ("c  control net", surface, lines)]
    if "cubes" in view.meshes:
        panels.insert(0, ("a  marching cubes", view.meshes["cubes"], []))
    side = VIEWS[0]
    up = np.array(side.up)
    across = np.stack([np.cross(up, side.towards), up], axis=1)  # (3, 2): world to picture
    with style():
        figure, grid = axes(3.0 * len(panels), 3.2, columns=len(panels))
        for axis, (title, mesh, drawn) in zip(np.atleast_1d(grid), panels, strict=True):
            centre = frame_view(axis, surface.vertices)
            paint_mesh(axis, mesh.vertices, mesh.faces, centre, side, rasterized=True)
            axis.set_title(title)
            for ends, colour in drawn:
                segments = list((ends - centre) @ across)
                axis.add_collection(
                    LineCollection(segments, colors=colour, linewidths=0.35, alpha=0.7, rasterized=True)
                )
        return to_svg(figure, key, "Marching cubes, spline surface and control net, seen from the front")
