"""Solids of organs that share their walls: neighbours have the very same faces, edges and vertices.

Faces and patches are those of a control mesh by itself (`cccd_solids.spline_shell`), found on a closed cover:
each organ's boundary apart, so that a wall between two organs is there twice. The first organ's is made.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cccd.geometry.arrays import BoolArray, IntArray, connected_parts, distinct
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh, quad_edges
from cccd.surface.surface import LoftedSurface
from cccd.tolerances import SOLID_VOLUME
from cccd_solids.bodies import nest_pieces
from cccd_solids.build import SAMPLED, Solids, build_solids
from cccd_solids.kernel import Bound, PlanarFace, SplineFace, spline_shells
from cccd_solids.spline_shell import SAMPLED as PATCH_SAMPLES
from cccd_solids.spline_shell import SplineShell, grid_triangles, spline_shell_of
from cccd_walls.complexes import split_fans
from cccd_walls.splines import WallSpline


def build_together(
    surfaces: Mapping[str, LoftedSurface], spline: WallSpline, tolerance: float
) -> dict[str, Solids]:
    """Turn the organs of a case into solids; those that touch have common faces where they do.

    Parameters
    ----------
    surfaces : mapping of str to LoftedSurface
        By organ, in mm RAS.
    spline : WallSpline
        Through the walls of those that touch; see `cccd_walls.splines.fit_organs`.
    tolerance : float
        99 % of the solids shall lie within so many mm of the meshes.

    Returns
    -------
    dict of str to Solids
        An organ with a spline of its own has that one's patches; see `cccd_solids.build.build_solids`. So
        has one whose common faces would be too far off: its report has no ``common_faces``.
    """
    shared = _share(surfaces, spline, tolerance) if spline.organs else {}
    return {name: better(shared.get(name), surface, tolerance) for name, surface in surfaces.items()}


def better(shared: Solids | None, surface: LoftedSurface, tolerance: float) -> Solids:
    """Take an organ's common faces, or a spline of its own where they are too far off or hold too little."""
    if shared is not None:
        near = shared.report["p99_mm"] <= SAMPLED * tolerance
        if near and abs(shared.report["volume_ratio"] - 1) <= SOLID_VOLUME:
            return shared
    alone = build_solids(surface, tolerance)
    return alone if shared is None or len(alone.warnings) < len(shared.warnings) else shared


def _share(surfaces: Mapping[str, LoftedSurface], spline: WallSpline, tolerance: float) -> dict[str, Solids]:
    """Make solids of organs that a spline through their walls joins."""
    cover = Cover.of(spline)
    shells, solids = cover.shells(), dict[str, Solids]()
    for number, organ in enumerate(spline.organs, 1):
        own = [shells[piece] for piece in cover.pieces_of(number)]
        bodies = [[own[n] for n in body] for body in nest_pieces([shell.mesh for shell in own])]
        solids[organ] = Solids.of(bodies, surfaces[organ].mesh, tolerance, common_faces=True)
    return solids


@dataclass(frozen=True, eq=False)
class SharedShell:
    """A closed surface of faces that others may have, too; see `cccd_solids.shells.Shell`.

    Attributes
    ----------
    cover : Cover
        Of all organs: it makes all shells at once when the first one is asked for.
    piece : int
        Which of its pieces this is.
    """

    cover: Cover
    piece: int
    mesh: Mesh
    planar: int
    smooth: bool = True

    def build(self) -> Any:
        """Make the ``TopoDS_Shell``."""
        return self.cover.made[self.piece]


@dataclass(frozen=True, eq=False)
class Cover:
    """Closed control meshes of all organs, side by side.

    Attributes
    ----------
    shell : SplineShell
        Of all of them.
    vertex : (V,) int64
        The control point of the walls' spline that each one is.
    quad : (Q,) int64
        The quad of that spline that each one is ...
    forward : (Q,) bool
        ... and whether it is its organ's that comes first of the wall's two.
    organ : (Q,) int64
    """

    shell: SplineShell
    vertex: IntArray
    quad: IntArray
    forward: BoolArray
    organ: IntArray

    @classmethod
    def of(cls, spline: WallSpline) -> Cover:
        """Cover the walls of a spline."""
        control, regions = spline.control, spline.regions[spline.wall]
        second = np.flatnonzero(regions[:, 1] > 0)
        quad = np.concatenate([np.arange(len(regions)), second])
        forward = np.arange(len(quad)) < len(regions)
        organ = np.concatenate([regions[:, 0], regions[second, 1]])
        corners = np.concatenate([control.quads, control.quads[second][:, [0, 3, 2, 1]]])
        known, numbered = distinct(organ[:, None] * len(control.vertices) + corners)
        quads, fan = split_fans(numbered)
        vertex = known[fan] % len(control.vertices)
        edges, _ = quad_edges(quads)
        count = len(control.vertices)
        creased = np.isin(
            np.sort(vertex[edges], axis=1) @ [count, 1], np.sort(control.creases, axis=1) @ [count, 1]
        )
        mesh = ControlMesh(
            control.vertices[vertex],
            quads,
            edges[creased],
            np.full(int(creased.sum()), control.sharpness.max(initial=0.0)),
            np.flatnonzero(np.isin(vertex, control.corners)),
        )
        return cls(spline_shell_of(mesh, SplineShell.exactly), vertex, quad, forward, organ)

    @cached_property
    def piece(self) -> IntArray:
        """Which closed piece each quad (Q,) is of."""
        quads = self.shell.control.quads
        part = connected_parts(quads.ravel(), np.roll(quads, 1, axis=1).ravel(), len(self.vertex))
        return np.unique(part[quads[:, 0]], return_inverse=True)[1]

    def pieces_of(self, organ: int) -> list[int]:
        """Pieces of an organ."""
        return np.unique(self.piece[self.organ == organ]).tolist()

    def shells(self) -> list[SharedShell]:
        """Give the shell of each piece."""
        finer = 4**self.shell.halved
        samples, planar = self.shell.patches.samples(PATCH_SAMPLES), self.shell.faces.planar[::4]
        found: list[SharedShell] = []
        for piece in range(int(self.piece.max()) + 1):
            own = np.tile(self.piece == piece, finer)
            mesh = grid_triangles(self.shell.quads[own], samples[own]).compact()
            flat = np.unique(self.shell.faces.face[(self.piece == piece) & planar])
            found.append(SharedShell(self, piece, mesh, len(flat)))
        return found

    @cached_property
    def made(self) -> list[Any]:
        """Shells of OpenCASCADE, piece by piece; of walls that two have only the first organ's faces."""
        face, curves = self.shell.faces.face, self.shell.curves()
        heads = self.shell.faces.edges
        tails = self.shell.faces.tail[heads]
        links = self.shell.faces.links
        places = [links.origin[heads], links.origin[tails], links.origin[links.twin[tails]]]
        ends = np.column_stack([self.vertex[place] for place in places])
        turned = ends[:, 0] > ends[:, 2]
        keys = np.where(turned[:, None], ends[:, ::-1], ends)
        # an edge of a single quad begins where its tail does
        keys[heads == tails, 1] = -1
        _, first, same = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        renumbered = same.ravel().tolist()
        point = np.full(int(self.vertex.max()) + 1, -1)
        point[self.vertex[::-1]] = np.arange(len(self.vertex))[::-1]
        kept = [
            curves[n]._replace(start=int(point[ends[n, 0]]), end=int(point[ends[n, 2]]))
            for n in first.tolist()
        ]
        flips = (turned != turned[first[renumbered]]).tolist()
        primary = np.unique(face[self.forward])
        number = np.full(int(face.max()) + 1, -1)
        number[primary] = np.arange(len(primary))
        bounded = self.shell.bounded_faces()
        faces = [_renumbered(bounded[n], renumbered, flips) for n in primary.tolist()]
        of_quad = np.full(int(self.quad.max()) + 1, -1)
        of_quad[self.quad[self.forward]] = number[face[self.forward]]
        both = np.unique(np.column_stack([self.piece, of_quad[self.quad], self.forward]), axis=0)
        shells = [
            [(n, bool(same_side)) for _, n, same_side in both[both[:, 0] == piece].tolist()]
            for piece in range(int(self.piece.max()) + 1)
        ]
        return spline_shells(self.shell.patches.corners, kept, faces, shells)


def _renumbered(
    face: SplineFace | PlanarFace, number: list[int], flips: list[bool]
) -> SplineFace | PlanarFace:
    """Give a face's edges other numbers, and turn those that run the other way."""
    wires = [
        [
            Bound(number[edge], forward != flips[edge], way[::-1] if flips[edge] else way)
            for edge, forward, way in wire
        ]
        for wire in face.wires
    ]
    return face._replace(wires=wires)
