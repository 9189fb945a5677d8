"""Triangle meshes and what is measured on them: volume, area, bending, soundness.

VTK's own modules are each loaded where they are needed: a tenth of a second, without PyVista.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
import scipy

from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, connected_parts, distinct, unit_vectors
from cccd.geometry.sides import opposite_sides, pinched_vertices

if TYPE_CHECKING:
    import pyvista
    import trimesh


def vtk(name: str) -> Any:
    """Load a module of VTK by its name; its types are looser than what it returns."""
    return cast(Any, import_module(f"vtkmodules.{name}"))


def triangles_of(filter_: Any) -> tuple[FloatArray, IntArray]:
    """Run a filter that makes triangles and return their vertices (V, 3) and faces (F, 3)."""
    filter_.Update()
    mesh, support = filter_.GetOutput(), vtk("util.numpy_support")
    vertices = support.vtk_to_numpy(mesh.GetPoints().GetData())
    faces = support.vtk_to_numpy(mesh.GetPolys().GetConnectivityArray())
    return vertices.astype(float), faces.reshape(-1, 3).astype(np.int64)


def xml_of(data: Any) -> str:
    """Return VTK's binary XML: VTK itself leaves an empty file on a full disk, and reports nothing."""
    kind = "PolyData" if data.IsA("vtkPolyData") else "UnstructuredGrid"
    writer = getattr(vtk("vtkIOXML"), f"vtkXML{kind}Writer")()
    writer.SetInputData(data)
    writer.SetDataModeToBinary()
    writer.WriteToOutputStringOn()
    writer.Write()
    return str(writer.GetOutputString())


#: A low-pass filter's band for the shortest waves that a mesh has.
WIDEST_BAND = 1.9


class Dihedrals(NamedTuple):
    """The inner edges of a mesh and how its faces bend along them."""

    edges: IntArray  # (E, 2)
    angles: FloatArray  # (E,) between the normals of the two faces, in radians
    lengths: FloatArray  # (E,)
    areas: FloatArray  # (E,) of the two faces together
    faces: IntArray  # (E, 2)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, counter-clockwise seen from outside.

    Attributes
    ----------
    vertices : (V, 3) float64
        Mostly in world mm (RAS).
    faces : (F, 3) int64

    Examples
    --------
    >>> corner = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    >>> tetrahedron = Mesh(corner, np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]))
    >>> round(6 * tetrahedron.volume, 9), tetrahedron.is_closed_manifold
    (1.0, True)
    """

    vertices: FloatArray
    faces: IntArray

    @classmethod
    def empty(cls) -> Mesh:
        """Return the mesh without triangles."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3), np.int64))

    # Measures

    @property
    def volume(self) -> float:
        """Volume inside a closed mesh by the divergence theorem; positive when it is oriented outwards."""
        if len(self.faces) == 0:
            return 0.0
        a, opposite = self._spanned()
        return float(np.einsum("fc,fc->", a, opposite)) / 6

    @property
    def area(self) -> float:
        """Area of all faces."""
        return float(self.face_areas.sum())

    @cached_property
    def face_normals(self) -> FloatArray:
        """Normals (F, 3), as long as twice the area of their face."""
        a, b, c = (self.vertices[self.faces[:, corner]] for corner in range(3))
        b -= a  # in place: meshes of label maps have millions of faces
        c -= a
        return np.cross(b, c)

    @property
    def face_areas(self) -> FloatArray:
        """Area (F,) of each face."""
        return 0.5 * np.linalg.norm(self.face_normals, axis=1)

    @property
    def vertex_areas(self) -> FloatArray:
        """Area (V,) of each vertex: a third of its faces'."""
        shares = np.repeat(self.face_areas / 3, 3)
        return np.bincount(self.faces.ravel(), shares, len(self.vertices)).astype(float)

    @property
    def unit_normals(self) -> FloatArray:
        """Normals (F, 3) of unit length; zero for a face without area."""
        return unit_vectors(self.face_normals)

    @cached_property
    def vertex_normals(self) -> FloatArray:
        """Normals (V, 3) of unit length, of a vertex's faces by their areas; zero without any."""
        total = np.zeros_like(self.vertices)
        for corner, axis in np.ndindex(3, 3):
            total[:, axis] += np.bincount(self.faces[:, corner], self.face_normals[:, axis], len(total))
        return unit_vectors(total)

    @cached_property
    def dihedrals(self) -> Dihedrals:
        """Angles between the normals of faces that share an edge."""
        faces, unit = self.faces, self.unit_normals
        size = np.linalg.norm(self.face_normals, axis=1)
        edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
        key = edges[:, 0] * (int(faces.max()) + 1) + edges[:, 1]
        order = np.argsort(key, kind="stable")
        pair = np.flatnonzero(key[order][1:] == key[order][:-1])
        first, second = order[pair] // 3, order[pair + 1] // 3
        edge = edges[order[pair]]
        cosine = np.einsum("ec,ec->e", unit[first], unit[second])
        sine = np.linalg.norm(np.cross(unit[first], unit[second]), axis=1)
        angle = np.where((size[first] > 0) & (size[second] > 0), np.arctan2(sine, cosine), 0.0)
        length = np.linalg.norm(self.vertices[edge[:, 1]] - self.vertices[edge[:, 0]], axis=1)
        area = (size[first] + size[second]) / 2
        return Dihedrals(edge, angle, length, area, np.column_stack([first, second]))

    @property
    def curvature_per_area(self) -> float:
        r"""Mean absolute curvature in 1/mm: the sum of :math:`|\theta| l` over all edges, by the area.

        The dihedral angles of a mesh measure its total curvature without dividing by small faces, so this
        figure is the one to compare between meshes of different make.
        """
        theta, length = self.dihedrals.angles, self.dihedrals.lengths
        return float(np.sum(np.abs(theta) * length) / self.area)

    # Soundness

    @property
    def is_closed_manifold(self) -> bool:
        """Whether every edge belongs to two faces that run along it in opposite directions.

        That is: closed, without edges of three faces, and consistently oriented. A vertex where two sheets
        touch is not found by looking at edges, so the faces around each vertex must also form one fan.
        """
        faces = self.faces
        if len(faces) == 0 or np.any(faces == np.roll(faces, 1, axis=1)):
            return False
        opposite = opposite_sides(faces)
        return bool((opposite >= 0).all() and not pinched_vertices(faces, opposite).any())

    def self_intersections(self) -> IntArray:
        """Pairs (K, 2) of triangles that pass through each other; see `cccd.geometry.collisions`."""
        from cccd.geometry.collisions import passing_pairs  # loads libigl

        return passing_pairs(self.vertices, self.faces)

    @property
    def genus(self) -> int:
        r"""Handles of all pieces of a closed manifold together: :math:`\sum (1 - \chi / 2)`.

        A ball has none, nor has a shell, whose inner and outer surface have none each; a torus has one, and
        so has a solid letter A.
        """
        euler = self._used() - len(self.faces) // 2  # closed: three edges to two faces
        return self.count_pieces() - euler // 2

    def count_pieces(self) -> int:
        """Count the connected pieces."""
        return int(self.piece_numbers.max(initial=-1)) + 1

    def count_bodies(self) -> int:
        """Count the connected pieces that are not the inside of a cavity: those of positive volume."""
        return int(np.count_nonzero(self.piece_volumes > 0))

    @property
    def piece_volumes(self) -> FloatArray:
        """Volumes (N,) of the connected pieces of a closed mesh; less than zero for a cavity's."""
        return np.bincount(self.piece_numbers, np.einsum("fc,fc->f", *self._spanned())).astype(float) / 6

    # Other meshes and points from this one

    @classmethod
    def joined(cls, parts: Sequence[Mesh]) -> Mesh:
        """Put meshes into one, in their order; nothing is merged.

        Examples
        --------
        >>> two = [Mesh(np.eye(3), np.array([[0, 1, 2]])), Mesh(np.eye(3) + 5, np.array([[2, 1, 0]]))]
        >>> Mesh.joined(two).faces.tolist(), Mesh.joined([]).faces.shape
        ([[0, 1, 2], [5, 4, 3]], (0, 3))
        """
        if not parts:
            return cls.empty()
        starts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
        faces = [part.faces + start for part, start in zip(parts, starts, strict=True)]
        return cls(np.concatenate([part.vertices for part in parts]), np.concatenate(faces))

    def pieces(self) -> list[Mesh]:
        """Split the mesh into its connected pieces, without unused vertices."""
        piece = self.piece_numbers
        order = np.argsort(piece, kind="stable")
        parts = np.split(self.faces[order], np.flatnonzero(np.diff(piece[order])) + 1)
        return [Mesh(self.vertices, faces).compact() for faces in parts if len(faces)]

    def compact(self) -> Mesh:
        """Leave out the vertices that no face has."""
        used, faces = distinct(self.faces)
        return Mesh(self.vertices[used], faces)

    def with_neighbours(self, faces: BoolArray) -> BoolArray:
        """Mark (F,) the faces that are marked, and all that have a vertex of one."""
        ends = np.zeros(len(self.vertices), np.bool_)
        ends[self.faces[faces]] = True
        return np.any(ends[self.faces], axis=1)

    def reversed(self) -> Mesh:
        """Turn all faces round."""
        return Mesh(self.vertices, np.ascontiguousarray(self.faces[:, ::-1]))

    def outwards(self) -> Mesh:
        """Turn a closed mesh's faces round when the volume that they enclose comes out negative."""
        return self.reversed() if self.volume < 0 else self

    def transformed(self, affine: FloatArray) -> Mesh:
        """Apply an affine (4, 4); faces keep their outer side, also when it mirrors."""
        moved = Mesh(self.vertices @ affine[:3, :3].T + affine[:3, 3], self.faces)
        return moved.reversed() if np.linalg.det(affine[:3, :3]) < 0 else moved

    def simplified(self, most: int) -> Mesh:
        """Collapse edges by quadric error (Garland and Heckbert 1997) to at most ``most`` triangles."""
        if len(self.faces) <= most:
            return self
        import fast_simplification  # pyright: ignore[reportMissingTypeStubs]

        vertices, faces = cast(Any, fast_simplification).simplify(
            self.vertices.astype(np.float32), self.faces.astype(np.int32), target_count=most
        )
        return Mesh(np.asarray(vertices, float), np.asarray(faces, np.int64))

    def low_passed(self, band: float, rounds: int) -> Mesh:
        """Smooth by a windowed sinc filter (Taubin et al. 1996), which keeps the volume.

        Parameters
        ----------
        band : float
            Share of the mesh's spectrum that passes: of 2, about the square of the angle in radians that an
            edge is of a wave.
        rounds : int
            Degree of the filter's polynomial.
        """
        filter_ = vtk("vtkFiltersCore").vtkWindowedSincPolyDataFilter()
        filter_.SetInputData(self.to_vtk())
        filter_.SetNumberOfIterations(rounds)
        filter_.SetPassBand(band)
        filter_.NormalizeCoordinatesOn()
        filter_.FeatureEdgeSmoothingOff()
        filter_.BoundarySmoothingOn()  # an open edge as a line by itself
        filter_.NonManifoldSmoothingOff()
        return Mesh(triangles_of(filter_)[0], self.faces)

    def mean_curvature(self, at: FloatArray) -> FloatArray:
        """Estimate the mean curvature (P,) in 1/mm near the points ``at`` (P, 3); positive is convex.

        The median of the twelve nearest vertices: one by one they are noisy at the scale of the triangles.
        """
        filter_ = vtk("vtkFiltersGeneral").vtkCurvatures(curvature_type=1)  # the mean
        found = filter_(self.to_vtk()).GetPointData().GetScalars()
        values: FloatArray = vtk("util.numpy_support").vtk_to_numpy(found)
        _, nearest = scipy.spatial.cKDTree(self.vertices).query(at, k=min(12, len(self.vertices)))
        return np.median(values[nearest.reshape(len(at), -1)], axis=1)

    def averaged(self, values: FloatArray, rounds: int) -> FloatArray:
        """Average values (V,) of a closed mesh's vertices with their neighbours' mean, so many times."""
        for _ in range(rounds):
            values = (values + self._means @ values) / 2
        return values

    @cached_property
    def _means(self) -> scipy.sparse.csr_array:
        """Matrix (V, V) of the mean of each vertex's neighbours."""
        ends, starts = self.faces.ravel(), np.roll(self.faces, 1, axis=1).ravel()
        count = len(self.vertices)
        degree = np.bincount(ends, minlength=count)
        return scipy.sparse.coo_array((1 / degree[ends], (ends, starts)), shape=(count, count)).tocsr()

    def sample(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Draw points (count, 3) uniformly by area."""
        areas = self.face_areas
        chosen = rng.choice(len(self.faces), size=count, p=areas / areas.sum())
        r, s = np.sqrt(rng.random(count)), rng.random(count)
        weights = np.column_stack([1 - r, r * (1 - s), r * s])
        return np.einsum("pc,pcx->px", weights, self.vertices[self.faces[chosen]])

    def to_trimesh(self) -> trimesh.Trimesh:
        """Return the same vertices and faces as a ``trimesh.Trimesh``; nothing is merged."""
        import trimesh  # loads half of SciPy

        return trimesh.Trimesh(self.vertices, self.faces, process=False)

    def to_vtk(self) -> Any:
        """Return the mesh as a ``vtkPolyData``; needs no PyVista."""
        data, support = vtk("vtkCommonDataModel"), vtk("util.numpy_support")
        mesh, points, cells = data.vtkPolyData(), vtk("vtkCommonCore").vtkPoints(), data.vtkCellArray()
        points.SetData(support.numpy_to_vtk(np.ascontiguousarray(self.vertices)))
        corners = np.ascontiguousarray(self.faces, np.int64).ravel()
        # a copy: before VTK 9.6 the cells refer to the array's memory and do not keep it
        cells.SetData(3, support.numpy_to_vtkIdTypeArray(corners, deep=1))
        mesh.SetPoints(points)
        mesh.SetPolys(cells)
        return mesh

    def to_polydata(self) -> pyvista.PolyData:
        """Return the mesh as PyVista's ``PolyData``."""
        import pyvista  # VTK takes a second to load

        return cast(Any, pyvista.PolyData).from_regular_faces(self.vertices, self.faces)

    def _used(self) -> int:
        """Count the vertices that faces have."""
        return int(np.count_nonzero(np.bincount(self.faces.ravel())))

    @cached_property
    def piece_numbers(self) -> IntArray:
        """Give each face (F,) the number, from 0, of the connected piece that it is of."""
        piece = connected_parts(self.faces[:, :2].ravel(), self.faces[:, 1:].ravel(), len(self.vertices))
        return distinct(piece[self.faces[:, 0]])[1]

    def _spanned(self) -> tuple[FloatArray, FloatArray]:
        """First corners (F, 3) of the faces, seen from the mean of the vertices, and the others' product.

        Their scalar product is six times the signed volume that a face spans with the mean.
        """
        middle: FloatArray = self.vertices.mean(axis=0)
        a, b, c = (self.vertices[self.faces[:, corner]] - middle for corner in range(3))
        return a, np.cross(b, c)
