"""A spline fitted to a closed mesh that has none, such as an organ's that shares its walls."""

from __future__ import annotations

import numpy as np

from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd.surface.control_mesh import control_mesh
from cccd.surface.spline import Target, fit_spline
from cccd_solids.shells import follows

#: The spline is fitted to planes at a mesh's vertices, so its triangles are split until they are about as
#: short as this many tolerances, or until there are this many of them.
EDGE_TOLERANCES, SPLIT_TO = 2.0, 50_000
#: A mesh of fewer triangles is split before its edges collapse: it may have too few for a spline.
COARSE = 2_000
#: The first spline is made of so many triangles, each next one of twice as many.
FEWEST = 100
#: A mesh in space has no planes in which the scan ends.
NO_ENDS = (-np.inf, np.inf)


def fit_within(mesh: Mesh, tolerance: float, most: int) -> ControlMesh | None:
    """Fit a closed Catmull-Clark spline to a closed mesh in one piece.

    Parameters
    ----------
    mesh : Mesh
        A closed manifold, in mm.
    tolerance : float
        99 % of the spline lie within this many mm of the mesh.
    most : int
        Most quads of the control mesh, about.

    Returns
    -------
    ControlMesh or None
        None where that many quads do not reach the tolerance, or the surface passes through itself.

    Examples
    --------
    >>> import trimesh
    >>> ball = trimesh.creation.icosphere(3, 10.0)
    >>> spline = fit_within(Mesh(np.array(ball.vertices), np.array(ball.faces, np.int64)), 0.1, 1000)
    >>> len(spline.quads) < 500, bool(abs(spline.tessellate(2).volume / ball.volume - 1) < 0.001)
    (True, True)
    """
    split = _split(mesh, tolerance)
    target, fine = Target.of(split), split if len(mesh.faces) < COARSE else mesh
    triangles = FEWEST
    while triangles <= min(most / 2, len(fine.faces)):
        fit = fit_spline(control_mesh(fine, triangles, NO_ENDS)[0], target)
        fit.hold(mesh.volume)
        if not len(fit.untangle()) and follows(fit.spline.tessellate(), mesh, tolerance):
            return fit.spline
        triangles *= 2
    return None


def _split(mesh: Mesh, tolerance: float) -> Mesh:
    """Split every triangle in four until its edges are short."""
    split = mesh.to_trimesh()
    while len(split.faces) < SPLIT_TO and split.edges_unique_length.mean() > EDGE_TOLERANCES * tolerance:
        split = split.subdivide()
    return Mesh(np.asarray(split.vertices, float), np.asarray(split.faces, np.int64))
