"""Which quads of a control mesh become one face of a solid, and which edges bound it.

Quads that lie in one plane within creases are one planar face: the caps where the scan cuts. Four quads
around a regular corner whose own neighbours are regular are one spline of two by two spans; meshes whose
polygons were split by their centres, or that were subdivided, consist of such fours. Others stay alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, connected_parts, unit_vectors
from cccd.geometry.subdivision import ControlMesh
from cccd.tolerances import ROUNDING
from cccd_solids.limit_patches import HalfEdges

#: Regions that lie this near to a plane, in edges of theirs, are moved there: control points are rounded.
NEARLY_FLAT = 2e-3


@dataclass(frozen=True, eq=False)
class QuadFaces:
    """Faces of whole quads, and their edges.

    Attributes
    ----------
    links : HalfEdges
        Of the control mesh.
    face : (Q,) int64
        The face of each quad: planar ones first, then those of four quads, then those of one.
    normals : (P, 3) float64
        Of the planar ones.
    fours : (B, 4) int64
        Quads of each face of four, counter-clockwise.
    first : int
        Which corner of those is the outer one.
    """

    links: HalfEdges
    face: IntArray
    normals: FloatArray
    fours: IntArray
    first: int

    @classmethod
    def of(cls, mesh: ControlMesh) -> QuadFaces:
        """Put the quads of a closed mesh together."""
        links = HalfEdges.of(mesh)
        region, normals = _flat_regions(mesh, links)
        fours, first = _fours(mesh, links, region < 0)
        face = region.copy()
        face[fours] = len(normals) + np.arange(len(fours))[:, None]
        alone = face < 0
        face[alone] = len(normals) + len(fours) + np.arange(int(alone.sum()))
        return cls(links, face, normals, fours, first)

    @cached_property
    def alone(self) -> IntArray:
        """Quads that are faces of their own, in the order of their faces."""
        return np.flatnonzero(self.face >= len(self.normals) + len(self.fours))

    @cached_property
    def planar(self) -> BoolArray:
        """Whether a half-edge (4 Q,) is of a planar face."""
        return np.repeat(self.face < len(self.normals), 4)

    @cached_property
    def _place(self) -> IntArray:
        """Corner (4 Q,) of its quad that a half-edge begins at, from the outer one on; -1 but in fours."""
        place = np.full((len(self.face), 4), -1)
        place[self.fours] = (np.arange(4) - self.first) % 4
        return place.ravel()

    @cached_property
    def inside(self) -> BoolArray:
        """Whether a half-edge (4 Q,) lies within its face."""
        return np.where(self.planar, ~self.links.sharp, (self._place == 1) | (self._place == 2))

    @cached_property
    def successor(self) -> IntArray:
        """The next half-edge (4 Q,) along the boundary of its face, for those on it."""
        found = self.links.following
        while np.any(within := ~self.inside & self.inside[found]):
            found = np.where(within, self.links.following[self.links.twin[found]], found)
        return found

    @cached_property
    def joined(self) -> BoolArray:
        """Whether the edge of a half-edge (4 Q,) goes on along its successor: within a side, off creases."""
        after = self.links.twin[self.successor]  # ends where the half-edge does, on the other side
        passes = (self._place == 0) & (self._place == 0)[after] & ~self.links.sharp
        return passes & ~self.inside & (self.successor[after] == self.links.twin)

    @cached_property
    def heads(self) -> IntArray:
        """Half-edges that edges begin with, as either face beside them has it."""
        goes_on = np.zeros(len(self.inside), np.bool_)
        goes_on[self.successor[self.joined]] = True
        return np.flatnonzero(~self.inside & ~goes_on)

    @cached_property
    def tail(self) -> IntArray:
        """The half-edge (4 Q,) that an edge ends with which begins with this one."""
        return np.where(self.joined, self.successor, np.arange(len(self.joined)))

    @cached_property
    def edges(self) -> IntArray:
        """One head (E,) of each edge."""
        return self.heads[self.heads < self.links.twin[self.tail[self.heads]]]

    def wires(self) -> Iterator[list[list[int]]]:
        """Yield the heads along each boundary of each face, face by face."""
        by_face: list[list[int]] = [[] for _ in range(int(self.face.max()) + 1)]
        for head, face in zip(self.heads.tolist(), self.face[self.heads // 4].tolist(), strict=True):
            by_face[face].append(head)
        onwards = self.successor[self.tail].tolist()
        for heads in by_face:
            left, found = dict.fromkeys(heads), list[list[int]]()
            while left:
                wire = [next(iter(left))]
                while (head := onwards[wire[-1]]) != wire[0]:
                    wire.append(head)
                found.append(wire)
                for head in wire:
                    del left[head]
            yield found

    @cached_property
    def parameters(self) -> tuple[FloatArray, FloatArray]:
        """Where half-edges (4 Q, 2) begin and end in their face's parameters, a quad being 1 wide."""
        corners = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
        starts = np.tile(corners, (len(self.face), 1)).reshape(-1, 4, 2)
        ends = np.roll(starts, -1, axis=1)
        for n in range(4):
            outer, middle, before = (
                2 * corners[n],
                corners[n] + corners[(n + 1) % 4],
                corners[n] + corners[n - 1],
            )
            starts[self.fours[:, n], self.first] = outer
            ends[self.fours[:, n], self.first] = middle
            starts[self.fours[:, n], self.first - 1] = before
            ends[self.fours[:, n], self.first - 1] = outer
        return starts.reshape(-1, 2), ends.reshape(-1, 2)


def flattened(mesh: ControlMesh) -> ControlMesh:
    """Move what lies next to a plane within creases onto it: large regions decide over their corners."""
    links = HalfEdges.of(mesh)
    regions = _Regions.of(mesh, links)
    flat = np.flatnonzero(regions.height <= NEARLY_FLAT * regions.edge)
    vertices = mesh.vertices.copy()
    for n in flat[np.argsort(np.linalg.norm(regions.area[flat], axis=1), kind="stable")]:
        at = np.unique(mesh.quads[regions.label == n])
        normal = regions.normals[n]
        vertices[at] -= ((vertices[at] - vertices[at].mean(axis=0)) @ normal)[:, None] * normal
    return mesh.moved(vertices)


@dataclass(frozen=True, eq=False)
class _Regions:
    """Quads within creases: each one's region (Q,), and the regions' area vectors, heights and edges."""

    label: IntArray
    area: FloatArray
    height: FloatArray
    edge: FloatArray

    @property
    def normals(self) -> FloatArray:
        return unit_vectors(self.area)

    @classmethod
    def of(cls, mesh: ControlMesh, links: HalfEdges) -> _Regions:
        count = len(mesh.quads)
        open_ = np.flatnonzero(~links.sharp)
        label = connected_parts(open_ // 4, links.twin[open_] // 4, count)
        number = int(label.max(initial=-1)) + 1
        points = mesh.vertices[mesh.quads]
        area, middle = np.zeros((number, 3)), np.zeros((number, 3))
        np.add.at(area, label, np.cross(points[:, 2] - points[:, 0], points[:, 3] - points[:, 1]) / 2)
        np.add.at(middle, label, points.mean(axis=1))
        quads = np.bincount(label)
        found = cls(np.asarray(label, np.int64), area, np.zeros(number), np.zeros(number))
        away = points - (middle / quads[:, None])[label][:, None]
        heights = np.abs(np.einsum("qkc,qc->qk", away, found.normals[label])).max(axis=1)
        np.maximum.at(found.height, label, heights)
        sides = np.linalg.norm(points - np.roll(points, 1, axis=1), axis=2).mean(axis=1)
        np.add.at(found.edge, label, sides / quads[label])
        return found


def _flat_regions(mesh: ControlMesh, links: HalfEdges) -> tuple[IntArray, FloatArray]:
    """Find the number of each quad's planar region (Q,), -1 elsewhere, and the regions' normals."""
    regions = _Regions.of(mesh, links)
    size = float(np.abs(mesh.vertices).max())
    sheet = np.linalg.norm(regions.area, axis=1) > ROUNDING * size**2
    flat = (regions.height <= ROUNDING * size) & sheet
    number = np.where(flat, np.cumsum(flat) - 1, -1)
    return number[regions.label], regions.normals[flat]


def _fours(mesh: ControlMesh, links: HalfEdges, free: BoolArray) -> tuple[IntArray, int]:
    """Fours (B, 4) of free quads that are one spline, and which of their corners is the outer one."""
    complete = [np.bincount(mesh.quads[free, k], minlength=len(mesh.vertices)) == 4 for k in range(4)]
    common = int(np.argmax([found.sum() for found in complete]))
    beside_crease = links.sharp[links.around] & links.sharp[links.back]
    middle = (links.valence == 4) & ((links.creases == 0) | (links.creases == 2) & beside_crease)
    spoke = links.regular & (links.creases == 0) & middle[links.twin]
    good = np.bincount(links.origin, ~spoke, minlength=len(mesh.vertices)) == 0
    centre = mesh.quads[:, common]
    chosen = np.flatnonzero(free & (good & complete[common])[centre])
    _, lowest = np.unique(centre[chosen], return_index=True)
    fours = [chosen[lowest]]
    for _ in range(3):
        fours.append(links.twin[4 * fours[-1] + (common - 1) % 4] // 4)
    return np.column_stack(fours), (common + 2) % 4
