"""Sections across a tube: where a plane through one of its points meets the surface around that point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.mesh import Mesh

__all__ = ["Section", "Slicer", "across"]

#: Directions in which the width of a section is measured: a width is within 0.1 % of the extreme one.
_DIRECTIONS = 36

#: Sections are looked for within 2 radii of the point, then 4, and 8 at last: beyond that it is no tube's.
_REACHES = (2.0, 4.0, 8.0)


@dataclass(frozen=True)
class Section:
    """The loop in which a plane meets a tube around one of its points.

    Attributes
    ----------
    area : float
        In mm^2.
    centroid : (3,) float64
        Of the area.
    least_diameter, largest_diameter : float
        Its smallest and largest width, in mm.
    faces : (K,) int64
        The triangles that the plane cuts there.
    """

    area: float
    centroid: FloatArray
    least_diameter: float
    largest_diameter: float
    faces: IntArray

    @property
    def radius(self) -> float:
        """Radius of the circle of the same area."""
        return float(np.sqrt(self.area / np.pi))


def across(normal: FloatArray) -> FloatArray:
    """Two unit vectors (2, 3) that span the plane across a normal (3,), right-handed with it.

    Examples
    --------
    >>> across(np.array((0.0, 0, 2))).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    """
    unit = normal / np.linalg.norm(normal)
    helper = np.eye(3)[1 if abs(unit[1]) < abs(unit[0]) or abs(unit[2]) > 0.9 else 0]
    first = np.cross(helper, unit)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(unit, first)])


class Slicer:
    """Cuts a closed mesh by planes of any direction, each around a point inside.

    Examples
    --------
    >>> import trimesh
    >>> tube = trimesh.creation.cylinder(3.0, 40.0, sections=96)
    >>> section = Slicer(Mesh(tube.vertices, tube.faces)).section(np.zeros(3), np.array((0.0, 0, 1)), 3.0)
    >>> round(section.radius, 2), round(section.largest_diameter, 2)
    (3.0, 6.0)
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        corners = mesh.vertices[mesh.faces]
        self._middles = corners.mean(axis=1)
        self._tree = cKDTree(self._middles)
        self._margin = float(np.linalg.norm(corners - self._middles[:, None], axis=2).max())

    def section(self, point: FloatArray, normal: FloatArray, radius: float) -> Section | None:
        """Cut around a point (3,); None where no closed loop goes around it, or only a large one.

        Parameters
        ----------
        point, normal : (3,) float64
            Of the plane.
        radius : float
            Of the largest sphere around the point inside the mesh, in mm.
        """
        for reach in _REACHES:
            near = np.array(self._tree.query_ball_point(point, reach * radius + self._margin), np.int64)
            level = np.abs((self._middles[near] - point) @ normal) <= self._margin
            found = self._loop(np.sort(near[level]), point, normal)
            if found is not None:
                return found
        return None

    def _loop(self, faces: IntArray, point: FloatArray, normal: FloatArray) -> Section | None:
        triangles = self.mesh.faces[faces]
        height = (self.mesh.vertices[triangles] - point) @ normal
        above = height >= 0
        cut = above.any(axis=1) & ~above.all(axis=1)
        if not cut.any():
            return None
        faces, triangles, height, above = faces[cut], triangles[cut], height[cut], above[cut]
        rows, ahead = np.arange(len(faces)), np.roll(above, -1, axis=1)
        ends: list[FloatArray] = []
        edges: list[IntArray] = []
        basis = across(normal)
        for corner in ((~above & ahead).argmax(axis=1), (above & ~ahead).argmax(axis=1)):
            following = (corner + 1) % 3
            first, second = triangles[rows, corner], triangles[rows, following]
            edges.append(np.sort(np.column_stack([first, second]), axis=1))
            low, high = height[rows, corner], height[rows, following]
            share = (low / (low - high))[:, None]
            met = self.mesh.vertices[first] * (1 - share) + self.mesh.vertices[second] * share
            ends.append((met - point) @ basis.T)
        loop = _surrounding(ends[0], ends[1], edges[0], edges[1])
        if loop is None:
            return None
        return _measured(ends[0][loop], ends[1][loop], faces[loop], point, basis)


def _surrounding(starts: FloatArray, ends: FloatArray, entered: IntArray, left: IntArray) -> IntArray | None:
    """Segments of the smallest closed loop that goes around the origin of the plane."""
    _, ids = np.unique(np.concatenate([entered, left]), axis=0, return_inverse=True)
    risen, sunk = ids.reshape(2, -1)
    count = int(ids.max()) + 1
    links = coo_array((np.ones(len(risen), bool), (risen, sunk)), shape=(count, count))
    loops, of_edge = connected_components(links, directed=False)
    of_segment = of_edge[risen]
    uses = np.bincount(ids.ravel(), minlength=count)
    is_open = np.bincount(of_edge, uses != 2, loops) > 0
    cross = starts[:, 0] * ends[:, 1] - starts[:, 1] * ends[:, 0]
    turn = np.arctan2(cross, np.einsum("sc,sc->s", starts, ends))
    winding = np.abs(np.bincount(of_segment, turn, loops)) / (2 * np.pi)
    area = np.abs(np.bincount(of_segment, cross, loops))
    around = np.flatnonzero(~is_open & (winding > 0.5))
    if not len(around):
        return None
    return np.flatnonzero(of_segment == around[area[around].argmin()])


def _measured(
    starts: FloatArray, ends: FloatArray, faces: IntArray, point: FloatArray, basis: FloatArray
) -> Section:
    """Measure a loop of segments in the plane that a basis (2, 3) at a point spans."""
    cross = starts[:, 0] * ends[:, 1] - starts[:, 1] * ends[:, 0]
    twice = cross.sum()
    centre = ((starts + ends) * cross[:, None]).sum(axis=0) / (3 * twice)
    angle = np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    widths = np.ptp(starts @ np.array([np.cos(angle), np.sin(angle)]), axis=0)
    return Section(
        float(abs(twice)) / 2, point + centre @ basis, float(widths.min()), float(widths.max()), faces
    )
