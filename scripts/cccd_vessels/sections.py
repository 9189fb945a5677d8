"""Sections across a tube: where a plane through one of its points meets the surface around that point."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cccd.geometry.arrays import FloatArray, IntArray, connected_parts, offsets_of, ranks_of, unit_vectors
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh

#: Directions in which the width of a section is measured: a width is within 0.1 % of the extreme one.
_DIRECTIONS = 36

#: Sections are looked for within so many radii of the point: beyond that it is no tube's.
_REACH = 8.0

#: Planes that are cut at once: what they may meet takes some ten megabytes.
_AT_ONCE = 128


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
    unit = unit_vectors(normal)
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
    >>> slicer = Slicer(Mesh(tube.vertices, tube.faces))
    >>> (section,) = slicer.sections(np.zeros((1, 3)), np.array([(0.0, 0, 1)]), np.array([3.0]))
    >>> round(section.radius, 2), round(section.largest_diameter, 2)
    (3.0, 6.0)
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._known: dict[bytes, tuple[float, Section | None]] = {}
        corners = mesh.vertices[mesh.faces]
        self._middles = middles = corners.mean(axis=1)
        self._margin = margin = float(np.linalg.norm(corners - middles[:, None], axis=2).max())
        # triangles lie in cells of twice their size, so that few of them are looked at
        cells, cell = np.unique(np.floor(middles / (2 * margin)), axis=0, return_inverse=True)
        self._in_cells = np.argsort(cell.reshape(-1), kind="stable")
        self._starts = offsets_of(np.bincount(cell.reshape(-1)))
        self._cells, self._beyond = (2 * cells + 1) * margin, (1 + 3**0.5) * margin

    def around(
        self, points: FloatArray, normals: FloatArray, least: float
    ) -> tuple[FloatArray, list[Section | None]]:
        """Radii (P,) of the largest spheres around points inside the mesh, 0 outside, and `sections` there.

        Sections are looked for as if spheres had at least the radius ``least``, in mm; they are remembered.
        """
        keys = [plane.tobytes() for plane in np.hstack([points, normals])]
        new = np.array([n for n, key in enumerate(keys) if key not in self._known], np.int64)
        if len(new):
            radii = np.maximum(-to_mesh(points[new], self.mesh), 0.0)
            cut = self.sections(points[new], normals[new], np.where(radii > 0, np.maximum(radii, least), 0))
            self._known |= zip((keys[n] for n in new), zip(radii.tolist(), cut, strict=True), strict=True)
        of_points, sections = zip(*(self._known[key] for key in keys), strict=True)
        return np.array(of_points), list(sections)

    def sections(self, points: FloatArray, normals: FloatArray, radii: FloatArray) -> list[Section | None]:
        """Cut around points; None where no closed loop goes around one, or only a large one.

        Parameters
        ----------
        points, normals : (P, 3) float64
            Of the planes.
        radii : (P,) float64
            Of the largest sphere around each point inside the mesh, in mm; where it is 0 nothing is cut.
        """
        found: list[Section | None] = [None] * len(points)
        inside = np.flatnonzero(radii > 0)
        for start in range(0, len(inside), _AT_ONCE):
            here = inside[start : start + _AT_ONCE]
            for number, section in self._cut(points[here], normals[here], _REACH * radii[here]):
                found[here[number]] = section
        return found

    def _near(self, point: FloatArray, normal: FloatArray, reach: float) -> IntArray:
        """Find the triangles that a plane may meet around its point."""
        away = self._cells - point
        distance = np.linalg.norm(away, axis=1)
        close = (np.abs(away @ normal) <= self._beyond) & (distance <= reach + self._beyond)
        starts, counts = self._starts[:-1][close], np.diff(self._starts)[close]
        faces = self._in_cells[np.repeat(starts, counts) + ranks_of(counts)]
        return faces[np.abs((self._middles[faces] - point) @ normal) <= self._margin]

    def _cut(
        self, points: FloatArray, normals: FloatArray, reaches: FloatArray
    ) -> Iterator[tuple[int, Section]]:
        """Give the sections that planes have, each with its number."""
        near = [self._near(*plane) for plane in zip(points, normals, reaches, strict=True)]
        plane, faces = np.repeat(np.arange(len(near)), [len(own) for own in near]), np.concatenate(near)
        triangles = self.mesh.faces[faces]
        height = np.einsum("fkc,fc->fk", self.mesh.vertices[triangles] - points[plane, None], normals[plane])
        above = height >= 0
        cut = above.any(axis=1) & ~above.all(axis=1)
        if not cut.any():
            return
        plane, faces, triangles, height, above = (x[cut] for x in (plane, faces, triangles, height, above))
        rows, ahead = np.arange(len(faces)), np.roll(above, -1, axis=1)
        bases = np.array([across(normal) for normal in normals])
        ends, edges, size = [], [], len(self.mesh.vertices)
        for corner in ((~above & ahead).argmax(axis=1), (above & ~ahead).argmax(axis=1)):
            following = (corner + 1) % 3
            first, second = triangles[rows, corner], triangles[rows, following]
            edges.append((plane * size + np.minimum(first, second)) * size + np.maximum(first, second))
            low, high = height[rows, corner], height[rows, following]
            share = (low / (low - high))[:, None]
            met = self.mesh.vertices[first] * (1 - share) + self.mesh.vertices[second] * share
            ends.append(np.einsum("fc,fkc->fk", met - points[plane], bases[plane]))
        for loop in _surrounding(ends[0], ends[1], edges[0], edges[1], plane):
            n = int(plane[loop[0]])
            yield n, _measured(ends[0][loop], ends[1][loop], faces[loop], points[n], bases[n])


def _surrounding(
    starts: FloatArray, ends: FloatArray, entered: IntArray, left: IntArray, plane: IntArray
) -> list[IntArray]:
    """Segments of the smallest closed loop that goes around the origin of each plane that has one."""
    _, ids = np.unique(np.concatenate([entered, left]), return_inverse=True)
    risen, sunk = ids.reshape(2, -1)
    count = int(ids.max()) + 1
    of_edge = connected_parts(risen, sunk, count)
    of_segment, loops = of_edge[risen], int(of_edge.max()) + 1
    uses = np.bincount(ids.ravel(), minlength=count)
    is_open = np.bincount(of_edge, uses != 2, loops) > 0
    cross = starts[:, 0] * ends[:, 1] - starts[:, 1] * ends[:, 0]
    turn = np.arctan2(cross, np.einsum("sc,sc->s", starts, ends))
    winding = np.abs(np.bincount(of_segment, turn, loops)) / (2 * np.pi)
    area = np.abs(np.bincount(of_segment, cross, loops))
    around = np.flatnonzero(~is_open & (winding > 0.5))
    of_plane = np.empty(loops, np.int64)
    of_plane[of_segment] = plane
    around = around[np.argsort(area[around], kind="stable")]
    smallest = around[np.unique(of_plane[around], return_index=True)[1]]
    order = np.argsort(of_segment, kind="stable")
    first, last = (np.searchsorted(of_segment[order], smallest, side) for side in ("left", "right"))
    return [order[a:b] for a, b in zip(first, last, strict=True)]


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
