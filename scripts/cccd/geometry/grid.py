"""Values on a regular grid of space, and the surface where they reach a level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, RealArray, ranks_of
from cccd.geometry.mesh import Mesh

__all__ = ["ScalarGrid"]

#: Edges of a cell: the axis along which each runs, and the node (3,) from which it does.
_EDGES = [(axis, node) for axis in (2, 1, 0) for node in product((0, 1), repeat=3) if not node[axis]]
#: Triangles of a cell, an edge's digit for each corner, by which of its nodes reach the level: node
#: ``4 a + 2 b + c`` is a bit of the number. These are Lorensen and Cline's cases as VTK has them: what could
#: be cut in two ways is cut alike in both cells that share it.
_TRIANGLES = """
- 048 095 548958 41a 01a80a 5091a4 51a5a99a8 5b1 0485b1 9b1091 14818bb89 45ba4b 05b0b88ba 40949aa9b 9b8ba8
286 204624 095862 295256654 86241a a62a21120 9508621a4 2a69a291a951 5b1862 4624205b1 9b1910862
19b169146629 45b4ba628 5ba5a252062a 2869a09baa40 2a629a9ba 927 927048 027507 827874475 9271a4 01a0a8279
0270751a4 1751871a8278 5b1927 4805b1279 7b1712210 17b471427482 ba4b45927 27905885b8ba 7027a07baa40
7827b8ba8 986796 904947746 086065567 547467 67969841a 9679169011a6 1a4085586567 a51a65675 986967b15
b15907704746 810871867b17 17b147467 987867b45ba4 70679060a5b0a0b a0ba40b07860706 a7b67a 6a3 480a36 095a36
895854a36 641361 680603301 136164095 513538589836 b1536a 5b148036a 10919b36a 36a14bb48b89 b36b65564
b365b6568580 0640b609b36b 6b368b89b 328a38 4a3430032 8a3832950 932943954a34 841812213 012213 509124132284
529512132 32838a15b 5b14a00a3032 28a2a309119b b49b14942a34243 84585383235b b05b30320 24328434b094b49
b2932b 2796a3 048279a36 7507026a3 a36824427475 641613792 927038013368 413436507702 381368185278587
927b156a3 36a5b1048279 6a37b22b1210 482427471b17a36 927b35536564 5b3536560806927 2b027b0b436b4b6
6b368b7b22b8 37939aa98 4a3043037079 08a0a70757a3 34a374754 798781713418 937903013 587508783418381 537135
5b19a798aa37 04a0a30397935b1 a78a37870b17071 34a37414bb47 5345b3438793839 b05b30907703 0847b3 b37 b73
04873b 95073b 54858973b 1a4b73 a80a01b73 0951a473b 73b51991a9a8 573153 573531480 973930031 789718731481
3a4347745 0a807a05773a 43a034073097 3973a9a89 73b286 2042463b7 50973b862 b73569546629 41a628b73
73b2162011a6 0952861a473b 95191a9a262a73b 315357286 571731420462 862970073031 694629491739193 86247a45773a
7a573a5a062a0a2 097073034a43862 3973a929669a b923b2 23b2b9048 b50b03302 8548358233b5 b92b23a41
0181a82b923b 41a0350233b5 3523b52581a585a 592521123 480591192123 021231 814821231 923934945a43
85a805a53925352 43a403023 382a83 63b6b88b9 04606b0b93b6 b6356b586508 b63b56546 1a4b83b98863
1601a60693b696b 50858656b3b61a4 a51a65b53356 531583598863 193159396049694 608630310 614316 839863935a43534
059a63 60863040aa03 63a ab76a7 ab7a76804 76a7ab509 b76b6a958854 1b7174476 801817876b71 95074b76441b
918951816b71617 a15a56657 0485615766a1 97696191016a 6176a1719481918 574476 068056576 940974764 968769
72878bb8a 72070a7aba04 0958b28abb72 b2ab72a24952425 1b7417472428 71b721201 41b4b7478287095 71b721519912
15717818a287 0a204a2a715a7a5 07109717a287a78 97214a 872847457 072570 872847970074 972 26a2a99ab
04826996a9ab 5ab52a5026a2 42548252b6a2b2a 1b9196164692 96b926b61806160 4b641b6b250b2b0 51b826 26a92a9a1915
92696a9a515a048 a26a12102 a26a12824421 259265645 259265058856 240642 268 98bb8a 4904a9ab9 0b508b8ab 4b5ab4
1841b8b98 91b019 1841b808558b 51b 5a159a98a 4904a959119a 0a18a0 4a1 584985 059 084 -
"""
_CASES = ["" if digits == "-" else digits for digits in _TRIANGLES.split()]


@dataclass(frozen=True, eq=False)
class ScalarGrid:
    """Numbers at the nodes of a grid.

    Attributes
    ----------
    values : (A, B, C) array
    affine : (4, 4) float64
        ``position = affine @ (a, b, c, 1)`` for the index of a node.
    origin : (3,) int
        Index of the first node, where the values are a block of a larger grid.
    """

    values: RealArray
    affine: FloatArray
    origin: Sequence[int] | RealArray = (0, 0, 0)

    @classmethod
    def uniform(cls, values: RealArray, origin: Sequence[float] | FloatArray, spacing: float) -> ScalarGrid:
        """Lay a grid along the axes, its first node at ``origin`` (3,), nodes ``spacing`` apart."""
        affine = np.diag([spacing, spacing, spacing, 1.0])
        affine[:3, 3] = origin
        return cls(values, affine)

    def isosurface(self, level: float) -> Mesh:
        """Mesh the surface on which linear interpolation reaches a level.

        These are marching cubes (Lorensen and Cline 1987): what two cubes share is cut alike from both
        sides, so inside the grid the mesh is closed, and no edge has more than two faces.

        Faces are counter-clockwise seen from where values are larger: outwards for signed distances, and
        inwards for masks. Nothing is closed at the border of the grid.

        Raises
        ------
        ValueError
            When no value lies below, or none above the level.

        Examples
        --------
        >>> axis = np.linspace(-1, 1, 21)
        >>> distance = np.linalg.norm(np.meshgrid(axis, axis, axis), axis=0) - 0.8
        >>> ball = ScalarGrid.uniform(distance, (-1, -1, -1), 0.1).isosurface(0.0)
        >>> ball.is_closed_manifold, round(ball.volume / (4 / 3 * np.pi * 0.8**3), 2)
        (True, 0.99)
        """
        if not np.any(self.values < level) or not np.any(self.values > level):
            raise ValueError(f"no surface: all values lie on one side of the level {level}")
        index, faces = _marching_cubes(self.values, level)
        nodes: FloatArray = index + np.asarray(self.origin)
        return Mesh(nodes, faces).transformed(self.affine)


def _marching_cubes(values: RealArray, level: float) -> tuple[FloatArray, IntArray]:
    """Vertices (P, 3) in nodes, and faces (F, 3) counter-clockwise where values (A, B, C) are larger.

    They are the very ones, in the same order, of VTK's flying edges (Schroeder et al. 2015).
    """
    above = values >= level
    found = [_crossings(values, above, level, axis) for axis in (2, 1, 0)]
    keys = np.concatenate([key for key, _ in found])
    order = np.argsort(keys, kind="stable")
    cells, triangles = _triangles(above)
    corners = [_key(axis, node, values.shape) for axis, node in _EDGES]
    faces = _key(2, cells, values.shape)[:, None] + np.array(corners)[triangles]
    vertices = np.concatenate([place for _, place in found])[order]
    return vertices, np.searchsorted(keys[order], np.asarray(faces, np.int64))


def _key(axis: int, node: Sequence[Any], shape: tuple[int, ...]) -> Any:
    """Return the number of the edge that runs from a node (3,) along an axis: by rows of nodes, then axes."""
    return ((node[0] * shape[1] + node[1]) * 3 + 2 - axis) * shape[2] + node[2]


def _crossings(values: RealArray, above: BoolArray, level: float, axis: int) -> tuple[IntArray, FloatArray]:
    """Edges (E,) along an axis on which the level is reached, and the places (E, 3) where it is."""
    first = np.moveaxis(above, axis, 0)
    near = np.nonzero(np.moveaxis(first[1:] != first[:-1], 0, axis))
    far = tuple(index + (n == axis) for n, index in enumerate(near))
    start, end = values[near].astype(float), values[far]
    place = np.stack(near, axis=1).astype(float)
    place[:, axis] += (level - start) / (end - values[near])
    return _key(axis, near, values.shape), place.astype(np.float32).astype(float)


def _triangles(above: BoolArray) -> tuple[list[IntArray], IntArray]:
    """First nodes of the cells (3, F) in which triangles lie, and the three edges (F, 3) of each."""
    case = np.zeros(np.array(above.shape) - 1, np.uint8)
    for bit, (a, b, c) in enumerate(product((0, 1), repeat=3)):
        ends = [slice(start, size - 1 + start) for start, size in zip((a, b, c), above.shape, strict=True)]
        case |= above[tuple(ends)].view(np.uint8) << np.uint8(bit)
    mixed = np.nonzero((case > 0) & (case < len(_CASES) - 1))
    counts = np.array([len(digits) // 3 for digits in _CASES])
    edges = np.array([int(digit, 16) for digit in "".join(_CASES)]).reshape(-1, 3)
    number, first = counts[case[mixed]], (np.cumsum(counts) - counts)[case[mixed]]
    return [np.repeat(index, number) for index in mixed], edges[np.repeat(first, number) + ranks_of(number)]
