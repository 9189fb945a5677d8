"""Meshes of organs that touch, as one complex: each wall between two of them once, and the seams of walls.

A wall is what two regions have in common, the outside being one; where the scan cuts an organ its plane is a
wall of its own. Walls end in seams, edges along which three of them meet or more (or two, along the rim of a
plane), and seams end in corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cccd.containers import Frame
from cccd.geometry.arrays import FloatArray, IntArray, connected_parts, distinct, offsets_of, unit_vectors
from cccd.geometry.decimation import Collapsing, Seams, quadrics_of
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import quad_edges
from cccd.surface.control_mesh import EVENNESS, caps_of

#: mm: vertices so near to where the scan ends lie there; files have them in single precision.
SAME_PLANE = 1e-3


@dataclass(frozen=True, eq=False)
class WallComplex:
    """Triangles of walls.

    Attributes
    ----------
    vertices : (V, 3) float64
        In the slices' plane and height, mm.
    triangles : (T, 3) int64
        Counter-clockwise seen from the second region of their wall.
    wall : (T,) int64
    regions : (W, 2) int64
        Numbers from 1 of the organs that each wall is of, the smaller first, or the organ and 0.

    Examples
    --------
    Two tetrahedra on one triangle:

    >>> points = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1)])
    >>> upper = np.array([(0, 1, 3), (1, 2, 3), (0, 3, 2), (0, 2, 1)])
    >>> lower = np.array([(0, 1, 2), (0, 2, 4), (0, 4, 1), (1, 4, 2)])
    >>> both = WallComplex.welded([Mesh(points, upper).compact(), Mesh(points, lower).compact()])
    >>> len(both.triangles), both.regions.tolist(), np.bincount(both.seams.kinds).tolist()
    (7, [[1, 0], [1, 2], [2, 0]], [2, 3])
    """

    vertices: FloatArray
    triangles: IntArray
    wall: IntArray
    regions: IntArray

    @classmethod
    def welded(cls, meshes: Sequence[Mesh], frame: Frame | None = None) -> WallComplex:
        """Put closed meshes together that have the very same vertices where they touch.

        Parameters
        ----------
        meshes : sequence of Mesh
            Organ by organ, oriented outwards; in mm RAS with a frame.
        frame : Frame, optional
            Of the slices; without one the meshes lie in their plane, and no end of the scan cuts them.
        """
        points = np.concatenate([mesh.vertices for mesh in meshes])
        vertices, number = np.unique(points, axis=0, return_inverse=True)
        starts = offsets_of([len(mesh.vertices) for mesh in meshes])
        corners = np.concatenate([mesh.faces + n for mesh, n in zip(meshes, starts, strict=False)])
        whole, cap = _in_plane(Mesh(vertices, number.ravel()[corners]), frame)
        organ = np.repeat(np.arange(1, len(meshes) + 1), [len(mesh.faces) for mesh in meshes])
        keys = np.sort(whole.faces, axis=1)
        _, first, same = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        other = np.zeros(len(first), np.int64)
        later = np.flatnonzero(first[same.ravel()] != np.arange(len(organ)))
        other[same.ravel()[later]] = organ[later]
        kinds = np.column_stack([organ[first], other, cap[first]])
        walls, wall = np.unique(kinds, axis=0, return_inverse=True)
        triangles, vertex = split_fans(whole.faces[first])
        return cls(whole.vertices[vertex], triangles, wall.ravel(), walls[:, :2])

    def without_specks(self, volume: float) -> WallComplex:
        """Leave out what hangs together with nothing else in a box of less than so many mm^3."""
        count = len(self.vertices)
        part = connected_parts(self.triangles[:, :2].ravel(), self.triangles[:, 1:].ravel(), count)
        low, high = np.full((part.max() + 1, 3), np.inf), np.full((part.max() + 1, 3), -np.inf)
        np.minimum.at(low, part, self.vertices)
        np.maximum.at(high, part, self.vertices)
        kept = ((high - low).prod(axis=1) >= volume)[part[self.triangles[:, 0]]]
        used, triangles = distinct(self.triangles[kept])
        return WallComplex(self.vertices[used], triangles, self.wall[kept], self.regions)

    def collapsed(self, most: int, weights: FloatArray | None = None) -> WallComplex:
        """Collapse edges, cheapest first, to at most so many triangles, or what keeps the topology.

        Edges cost as many times more as ``weights`` (V,) say. Vertices of seams are some of those before.
        """
        collapsing = Collapsing.of(self.mesh, self.wall, weights)
        collapsing.quadrics += self._beside_seams(weights)
        collapsing.collapse(most, EVENNESS)
        return WallComplex(collapsing.points, collapsing.faces, collapsing.part, self.regions)

    def _beside_seams(self, weights: FloatArray | None) -> FloatArray:
        """Quadrics (V, 11) of triangles that stand on the walls along seams, without their areas.

        Without these a seam may go anywhere on walls that are one plane (Garland and Heckbert 1997).
        """
        count, ends = len(self.vertices), self.seams.ends
        edges, side = quad_edges(self.triangles)
        face, corner = np.nonzero(np.isin(edges @ [count, 1], ends @ [count, 1])[side])
        a, b = self.triangles[face, corner], self.triangles[face, (corner + 1) % 3]
        length = np.linalg.norm(self.vertices[a] - self.vertices[b], axis=1, keepdims=True)
        tips = self.vertices[b] + length * unit_vectors(self.mesh.face_normals[face])
        upright = np.column_stack([a, b, count + np.arange(len(a))])
        found = quadrics_of(Mesh(np.concatenate([self.vertices, tips]), upright), None)[:count]
        found[:, 10] = 0
        return found if weights is None else found * weights[:, None]

    @cached_property
    def seams(self) -> Seams:
        """Where its walls end."""
        return Seams.of(self.triangles, self.wall, len(self.vertices))

    @property
    def mesh(self) -> Mesh:
        """Its triangles."""
        return Mesh(self.vertices, self.triangles)

    @cached_property
    def apart(self) -> tuple[Mesh, IntArray, IntArray]:
        """The walls without their seams: their mesh, and the vertex and the wall of each of its vertices."""
        walls = len(self.regions)
        keys, faces = distinct(self.triangles * walls + self.wall[:, None])
        vertex, wall = np.divmod(keys, walls)
        return Mesh(self.vertices[vertex], faces), vertex, wall


def _in_plane(mesh: Mesh, frame: Frame | None) -> tuple[Mesh, IntArray]:
    """Turn a mesh in mm RAS into the slices' plane and height, and say at which end (F,) the scan cuts it."""
    if frame is None:
        return mesh, np.zeros(len(mesh.faces), np.int64)
    moved = mesh.transformed(np.linalg.inv(frame.plane_to_world(np.zeros(2))))
    vertices = moved.vertices.copy()
    for end in frame.ends:
        vertices[np.abs(vertices[:, 2] - end) < SAME_PLANE, 2] = end
    flat = Mesh(vertices, moved.faces)
    return flat, caps_of(flat, frame.ends)


def split_fans(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Give polygons (F, n) that meet at a vertex alone, without a common edge there, vertices of their own.

    Returns the polygons (F, n), and the vertex (V,) that each new one was.
    """
    edges, side = quad_edges(faces)
    before = np.roll(side, 1, axis=1)
    at_end, at_start = (2 * edge + (edges[edge, 1] == faces) for edge in (side, before))
    fan = connected_parts(at_end.ravel(), at_start.ravel(), 2 * len(edges))
    found, corners = distinct(fan[at_end])
    vertex = np.empty(len(found), np.int64)
    vertex[corners] = faces
    return corners, vertex
