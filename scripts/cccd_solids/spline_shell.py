"""A control mesh as a shell of splines: its own patches, put together in faces, and planes for its caps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd_solids.kernel import Bound, Curve, PlanarFace, SplineFace, spline_shells
from cccd_solids.limit_patches import LimitPatches, settled
from cccd_solids.quad_faces import QuadFaces, flattened

#: Control points are rounded to this many mm: it takes a third off a STEP file.
STEP_MM = 1e-5
#: Samples along an edge of a patch for its triangles.
SAMPLED = 5
#: Quads are halved, so many times at most, until the normals jump over the faces' edges by at most so many
#: degrees on the mean and at 99 % of them.
HALVED, MEAN_JUMP, MOST_JUMP = 2, 0.3, 3.0


@dataclass(frozen=True, eq=False)
class SplineShell:
    """A shell whose faces are splines of one or four quads, or planes.

    Attributes
    ----------
    control : ControlMesh
    faces : QuadFaces
        Of the control mesh's quads.
    halved : int
        How often each quad was halved for its patches.
    patches : LimitPatches
        A Bezier patch for each of those.
    quads : (Q, 4) int64
        The corners of the patches.
    """

    control: ControlMesh
    faces: QuadFaces
    halved: int
    patches: LimitPatches
    quads: IntArray
    smooth: bool = True

    @classmethod
    def of(cls, mesh: ControlMesh, halved: int = 0) -> SplineShell:
        """Make the shell of a closed mesh, with patches of quads that were halved so often."""
        shell = cls.exactly(flattened(settled(mesh)), halved)
        on_plane = np.zeros(int(shell.quads.max()) + 1, np.bool_)
        on_plane[shell.quads[_of_halves(shell.faces.planar, halved).reshape(-1, 4).any(axis=1)]] = True
        return replace(shell, patches=shell.patches.rounded(STEP_MM, on_plane))

    @classmethod
    def exactly(cls, mesh: ControlMesh, halved: int = 0) -> SplineShell:
        """Make the shell of a closed mesh, whose creases are sharp for ever, without rounding."""
        finer = mesh.subdivided(halved)
        return cls(mesh, QuadFaces.of(mesh), halved, LimitPatches.of(finer).eased(), finer.quads)

    @property
    def planar(self) -> int:
        """How many of its faces are planes."""
        return len(self.faces.normals)

    @property
    def mesh(self) -> Mesh:
        """Triangles through points of the patches, closed as the patches are."""
        return self._triangles

    @cached_property
    def _triangles(self) -> Mesh:
        return grid_triangles(self.quads, self.patches.samples(SAMPLED))

    @property
    def limit(self) -> Mesh:
        """The limit surface, sampled at the same parameters as ``mesh``."""
        return self.control.tessellate(self.halved + SAMPLED.bit_length() - 1)

    @cached_property
    def jumps(self) -> FloatArray:
        """Degrees (E, n) between the normals along the faces' edges, but for creases."""
        on_edges = _on_sides(~self.faces.inside, self.halved)
        return self.patches.jumps(of=on_edges)

    @cached_property
    def _grids(self) -> FloatArray:
        """Control points (Q, n, n, 3) of the control mesh's quads: Bezier patches side by side."""
        grids = self.patches.nets
        for _ in range(self.halved):
            grids = _assembled(np.reshape(grids, (4, -1, *grids.shape[1:])))
        return grids

    def build(self) -> Any:
        """Make the ``TopoDS_Shell``."""
        faces = self.bounded_faces()
        whole = [(n, True) for n in range(len(faces))]
        return spline_shells(self.patches.corners, self.curves(), faces, [whole])[0]

    def curves(self) -> list[Curve]:
        """Give the edges of its faces, in the order of ``faces.edges``."""
        faces, links = self.faces, self.faces.links
        sides = [np.rot90(self._grids, k, axes=(1, 2))[:, 0] for k in range(4)]
        rows = np.stack(sides, axis=1).reshape(-1, *sides[0].shape[1:])
        heads, tails = faces.edges, faces.tail[faces.edges]
        ends = links.origin[heads], links.origin[links.twin[tails]]
        short = _smooth(rows[heads], 1)
        long = _smooth(np.concatenate([rows[heads], rows[tails][:, 1:]], axis=1), 1)
        width = np.where(heads == tails, 1, 2).tolist()
        return [
            Curve(start, end, long[n] if width[n] == 2 else short[n], width[n])
            for n, (start, end) in enumerate(zip(*(part.tolist() for part in ends), strict=True))
        ]

    def bounded_faces(self) -> list[SplineFace | PlanarFace]:
        """Give its faces within their edges, in the order of ``faces``."""
        faces, links = self.faces, self.faces.links
        number = np.full(len(links.twin), -1)
        number[faces.edges] = np.arange(len(faces.edges))
        backwards = number < 0
        number = np.where(backwards, number[links.twin[faces.tail]], number)
        starts, ends = faces.parameters[0], faces.parameters[1][faces.tail]
        ways = np.where(backwards[:, None, None], np.stack([ends, starts], 1), np.stack([starts, ends], 1))
        bounds = list(zip(number.tolist(), (~backwards).tolist(), ways.tolist(), strict=True))
        wires = [[[Bound(*bounds[h]) for h in wire] for wire in face] for face in faces.wires()]
        return [
            *(PlanarFace(wires[n], normal) for n, normal in enumerate(faces.normals)),
            *(SplineFace(wires[self.planar + n], net, width) for n, (net, width) in enumerate(self._nets())),
        ]

    def _nets(self) -> list[tuple[FloatArray, int]]:
        """Control nets of the splines, and how many quads wide they are."""
        faces = self.faces
        outer = np.rot90(self._grids, faces.first, axes=(1, 2))
        fours, alone = _assembled(outer[faces.fours.T]), self._grids[faces.alone]
        return [
            (net, width) for grids, width in ((fours, 2), (alone, 1)) for net in _smooth(_smooth(grids, 1), 2)
        ]


def _smooth(points: FloatArray, axis: int) -> FloatArray:
    """Control points (2 n + 2 along an axis) of a spline of cubics (3 n + 1) that join smoothly."""
    last = points.shape[axis] - 1
    kept = [n for n in range(last + 1) if n % 3 or n in {0, last}]
    return np.take(points, kept, axis=axis)


def _assembled(parts: FloatArray) -> FloatArray:
    """Put four grids (4, B, n, n, 3) together (B, 2 n - 1, 2 n - 1, 3): each begins at its outer corner."""
    size = parts.shape[2]
    whole = np.empty((parts.shape[1], 2 * size - 1, 2 * size - 1, 3))
    for k in range(4):
        np.rot90(whole, k, axes=(1, 2))[:, :size, :size] = parts[k]
    return whole


def _on_sides(marked: BoolArray, halved: int) -> BoolArray:
    """Which half-edges of halved quads lie on half-edges (4 Q,) that are marked."""
    for _ in range(halved):
        sides = marked.reshape(-1, 4)
        finer = np.zeros((4, len(sides), 4), np.bool_)
        for k in range(4):
            finer[k, :, 0], finer[k, :, 3] = sides[:, k], sides[:, k - 1]
        marked = finer.ravel()
    return marked


def _of_halves(marked: BoolArray, halved: int) -> BoolArray:
    """Mark the half-edges of halved quads as those (4 Q,) of their quads are."""
    return np.tile(marked.reshape(-1, 4), (4**halved, 1)).ravel()


def spline_shell_of(
    mesh: ControlMesh, make: Callable[[ControlMesh, int], SplineShell] = SplineShell.of
) -> SplineShell:
    """Make the shell of a closed mesh; quads are halved where normals would jump too far over edges."""
    halved = 0
    while True:
        shell = make(mesh, halved)
        jumps = shell.jumps
        even = jumps.size == 0 or (jumps.mean() <= MEAN_JUMP and np.percentile(jumps, 99) <= MOST_JUMP)
        if even or halved == HALVED:
            return shell
        halved += 1


def grid_ids(quads: IntArray, count: int) -> IntArray:
    """Return a number for each point of a grid on every quad; neighbours share those of their common edge.

    Parameters
    ----------
    quads : (Q, 4) int64
        Corners; no two edges may have the same two ends.
    count : int
        Points along an edge, its ends included.

    Returns
    -------
    (Q, count, count) int64
        Corners keep their numbers, which are the lowest; then come the edges', then the inner points'.

    Examples
    --------
    >>> two = np.array([(0, 1, 2, 3), (1, 4, 5, 2)])
    >>> first, second = grid_ids(two, 4)
    >>> bool(np.array_equal(first[:, -1], second[:, 0])), int(max(first.max(), second.max()))
    (True, 27)
    """
    inner = count - 2
    ends = np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, edge = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    first = int(quads.max()) + 1
    along = first + edge.reshape(-1, 1) * inner + np.arange(inner)
    backwards = ends[:, 0] > ends[:, 1]
    along[backwards] = along[backwards, ::-1]
    along = along.reshape(len(quads), 4, inner)
    ids = np.empty((len(quads), count, count), np.int64)
    ids[:, 0, 0], ids[:, 0, -1], ids[:, -1, -1], ids[:, -1, 0] = quads.T
    ids[:, 0, 1:-1], ids[:, 1:-1, -1] = along[:, 0], along[:, 1]
    ids[:, -1, 1:-1], ids[:, 1:-1, 0] = along[:, 2, ::-1], along[:, 3, ::-1]
    rest = first + len(edges) * inner
    ids[:, 1:-1, 1:-1] = rest + np.arange(len(quads) * inner**2).reshape(len(quads), inner, inner)
    return ids


def grid_triangles(quads: IntArray, samples: FloatArray) -> Mesh:
    """Triangles through samples (Q, n, n, 3) of quads (Q, 4), closed where those are."""
    ids = grid_ids(quads, samples.shape[1])
    points = np.empty((int(ids.max()) + 1, 3))
    points[ids] = samples
    low, high = slice(-1), slice(1, None)
    a, b, c, d = (
        ids[:, rows, columns].ravel()
        for rows, columns in ((low, low), (low, high), (high, high), (high, low))
    )
    return Mesh(points, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))
