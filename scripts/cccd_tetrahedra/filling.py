"""Tetrahedra through the organs of a case: one conforming mesh, a region for each organ, named boundaries.

fTetWild (Hu et al. 2020, `pytetwild`) fills the box around all surfaces at once, so that neighbours share the
faces of the wall between them; a tetrahedron is of the smallest organ that its middle lies in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np

from cccd.containers import Frame
from cccd.errors import InputError
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, unit_vectors
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import TetrahedraSettings
from cccd_tetrahedra.chords import balance_chords
from cccd_tetrahedra.own_process import call
from cccd_tetrahedra.quadratic import FACE_EDGES, curve_edges, quadratic_volumes
from cccd_tetrahedra.shapes import FACES, signed_volumes

#: Without a number of the user's, edges are at most this share of the box's diagonal, as in fTetWild, ...
EDGE_SHARE = 1 / 20
#: ... and faces lie at most this share away from the surface: half a millimetre for a brain.
TOLERANCE_SHARE = 1 / 500

#: fTetWild improves tetrahedra until the worst has this conformal energy; 3 is a regular one. At 20 the
#: smallest angles are four degrees, at 10 twenty on smooth organs; below, few improve any more.
ENERGY = 10.0

#: Rounds of improvement by fTetWild at most: what is not good by then is held by the surface.
ROUNDS = 40

#: Faces on the side of the scan's box face its way by at least this cosine.
ALONG = 0.9

#: They lie this near to it, in voxels.
AT_SIDE = 0.25


@dataclass(frozen=True, eq=False)
class Materials:
    """Which material a tetrahedron is of, and what they are.

    Attributes
    ----------
    number : (N,) int64
        Material of each tetrahedron, from 0, in the order of their moduli.
    density : (M,) float64
        g/cm^3.
    young : (M,) float64
        MPa.
    poisson : (M,) float64
    """

    number: IntArray
    density: FloatArray
    young: FloatArray
    poisson: FloatArray


@dataclass(frozen=True, eq=False)
class TetrahedralMesh:
    """Tetrahedra of several regions, and the faces between them.

    Attributes
    ----------
    vertices : (V, 3) float64
        In mm RAS.
    tetrahedra : (N, 4) int64
        The fourth vertex lies where the normal of the first three, counter-clockwise, points to.
    regions : (N,) int64
        Which of ``names`` a tetrahedron is of.
    names : tuple of str
        Of the organs.
    sides : (T, 2) int64
        The faces that bound an organ: the tetrahedron, and which of its four faces (see `FACES`). A face
        between two organs stands here once, with the tetrahedron of the organ that is named first.
    groups : (T,) int64
        Which of ``group_names`` a face is of.
    group_names : tuple of str
        ``wall``, ``cut``, with several organs ``wall_A``, ``cut_A``, and ``interface_A_B``.
    inside : (N, R) bool
        Which organs' surfaces hold a tetrahedron: several where one organ lies in another.
    middles : (N, 6) int64 or None
        Of quadratic tetrahedra the nodes in the middle of their edges (`cccd_tetrahedra.quadratic.EDGES`).
    boundary_edges, straight_edges : int
        Of quadratic tetrahedra: edges on a boundary, and how many of them could not be curved.
    grey : (N,) float64 or None
        Mean grey value of the scan in each tetrahedron.
    materials : Materials or None
        What a table makes of those.
    """

    vertices: FloatArray
    tetrahedra: IntArray
    regions: IntArray
    names: tuple[str, ...]
    sides: IntArray
    groups: IntArray
    group_names: tuple[str, ...]
    inside: BoolArray
    middles: IntArray | None = None
    boundary_edges: int = 0
    straight_edges: int = 0
    grey: FloatArray | None = None
    materials: Materials | None = None

    @cached_property
    def nodes(self) -> IntArray:
        """Corners of each tetrahedron, and its middle nodes (N, 4 or 10)."""
        return self.tetrahedra if self.middles is None else np.hstack([self.tetrahedra, self.middles])

    @cached_property
    def face_nodes(self) -> IntArray:
        """Corners of each bounding face, and its middle nodes (T, 3 or 6)."""
        if self.middles is None:
            return self.triangles
        element, side = self.sides.T
        return np.hstack([self.triangles, self.middles[element[:, None], FACE_EDGES[side]]])

    @cached_property
    def triangles(self) -> IntArray:
        """Vertices (T, 3) of the bounding faces, counter-clockwise seen from outside their tetrahedron."""
        return self.tetrahedra[self.sides[:, 0, None], FACES[self.sides[:, 1]]]

    @cached_property
    def volumes(self) -> FloatArray:
        """Volume (N,) of each tetrahedron."""
        corners = self.vertices[self.nodes]
        return signed_volumes(corners) if self.middles is None else quadratic_volumes(corners)

    def group(self, name: str) -> IntArray:
        """Return the faces (K, 3) of a group."""
        return self.triangles[self.groups == self.group_names.index(name)]


def sizes_in_mm(organs: Mapping[str, Mesh], settings: TetrahedraSettings) -> tuple[float, float]:
    """Tell the largest edge and the distance to the surface that are asked for, in mm."""
    points = np.concatenate([mesh.vertices for mesh in organs.values()])
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    return (settings.edge_mm or EDGE_SHARE * diagonal, settings.tolerance_mm or TOLERANCE_SHARE * diagonal)


def fill_organs(
    organs: Mapping[str, Mesh], settings: TetrahedraSettings, frames: Mapping[str, Frame] | None = None
) -> TetrahedralMesh:
    """Fill closed surfaces with tetrahedra.

    fTetWild shuffles by the machine's random device: two runs give two meshes, both as asked for.

    Parameters
    ----------
    organs : mapping of str to Mesh
        Closed, in mm RAS. They may share walls and lie in one another; what lies in several is of the one
        of least volume.
    settings : TetrahedraSettings
        Section ``surface.tetrahedra`` of the configuration.
    frames : mapping of str to Frame, optional
        Each organ's scan: where it ends the organ has faces ``cut``.

    Raises
    ------
    InputError
        A surface that is not closed, or an organ that is too small for the edges asked for.
    ModuleNotFoundError
        Where the extra fe is not installed.

    Examples
    --------
    >>> import trimesh
    >>> ball = trimesh.creation.icosphere(2, 10.0)
    >>> mesh = Mesh(np.array(ball.vertices), np.array(ball.faces, np.int64))
    >>> filled = fill_organs({"ball": mesh}, TetrahedraSettings(edge_mm=8, tolerance_mm=0.5))
    >>> filled.group_names, bool(abs(filled.volumes.sum() / mesh.volume - 1) < 0.05)
    (('wall',), True)
    """
    for name, mesh in organs.items():
        if not mesh.is_closed_manifold:
            raise InputError(name, "the mesh is not closed: it encloses no volume", "export another format")
    _refuse_too_many(organs, *sizes_in_mm(organs, settings), settings.most)
    vertices, tetrahedra = _fill_box(organs, settings)
    turned = signed_volumes(vertices[tetrahedra]) < 0
    tetrahedra[turned] = tetrahedra[turned][:, (0, 2, 1, 3)]
    inside = _inside(vertices[tetrahedra].mean(axis=1), organs)
    regions = _smallest_containing(inside, organs)
    missing = [name for n, name in enumerate(organs) if not np.any(regions == n)]
    if missing:
        raise InputError(
            missing[0], "it is too small for the tetrahedra", "lower surface.tetrahedra.tolerance_mm"
        )
    kept = regions >= 0
    used, tetrahedra = np.unique(tetrahedra[kept], return_inverse=True)
    tetrahedra, regions, inside = tetrahedra.reshape(-1, 4), regions[kept], inside[kept]
    quadratic = settings.elements == "tet10"
    return _bounded(vertices[used], tetrahedra, regions, inside, organs, frames or {}, quadratic)


def _refuse_too_many(organs: Mapping[str, Mesh], edge: float, tolerance: float, most: int) -> None:
    """Raise `InputError` where the sizes ask for more tetrahedra than there is time and memory for."""
    # A regular one of edge a has the volume a^3 / 6 sqrt 2. Faces are as large as the tolerance allows on a
    # ball of the organ's volume by surface, and each has about five tetrahedra behind it.
    inside = at_surface = 0.0
    for mesh in organs.values():
        radius = 3 * mesh.volume / mesh.area
        inside += 6 * 2**0.5 * mesh.volume / edge**3
        at_surface += 5 * mesh.area / (3**0.5 / 4 * min(edge**2, 8 * radius * tolerance))
    if inside + at_surface > most:
        key, size = ("edge_mm", edge) if inside > at_surface else ("tolerance_mm", tolerance)
        raise InputError(
            f"config key surface.tetrahedra.{key}",
            f"{size:.2g} mm asks for about {inside + at_surface:.1g} tetrahedra",
            "raise it, or raise surface.tetrahedra.most if you have time and memory",
        )


def _bounded(
    vertices: FloatArray,
    tetrahedra: IntArray,
    regions: IntArray,
    inside: BoolArray,
    organs: Mapping[str, Mesh],
    frames: Mapping[str, Frame],
    quadratic: bool,
) -> TetrahedralMesh:
    """Name the boundaries of regions (N,); curve them, or balance chords: no vertex leaves a scan."""
    names = tuple(organs)
    sides, beyond = _bounding_sides(tetrahedra, regions)
    triangles = tetrahedra[sides[:, 0, None], FACES[sides[:, 1]]]
    owners = regions[sides[:, 0]]
    cut = np.zeros(len(sides), bool)
    for n, frame in ((n, frames[name]) for n, name in enumerate(names) if name in frames):
        own = (owners == n) & (beyond < 0)
        cut[own] = _cut_at(frame, Mesh(vertices, triangles[own]))
    keys = zip(owners.tolist(), beyond.tolist(), cut.tolist(), strict=True)
    group_names, groups = np.unique([_group(*key, names) for key in keys], return_inverse=True)
    if quadratic:
        curved = curve_edges(vertices, tetrahedra, triangles, organs.values())
        vertices, middles, counts = curved.vertices, curved.middles, (curved.boundary, curved.straight)
    else:
        fixed = np.zeros(len(vertices), bool)
        for frame in frames.values():  # of a bevelled rim too
            fixed |= _at_ends_of(frame, vertices).any(axis=(1, 2))
        vertices = _balanced(vertices, tetrahedra, inside, organs, fixed)
        middles, counts = None, (0, 0)
    numbered = (regions, names, sides, groups, tuple(group_names.tolist()))
    return TetrahedralMesh(vertices, tetrahedra, *numbered, inside, middles, *counts)


def _balanced(
    vertices: FloatArray, tetrahedra: IntArray, inside: BoolArray, organs: Mapping[str, Mesh], held: BoolArray
) -> FloatArray:
    """Balance the chords of one organ after the other; what is held, or was moved, stays."""
    held = held.copy()
    for n, mesh in enumerate(organs.values()):
        own, _ = _bounding_sides(tetrahedra[inside[:, n]], np.zeros(inside[:, n].sum(), np.int64))
        closed = tetrahedra[inside[:, n]][own[:, 0, None], FACES[own[:, 1]]]
        vertices = balance_chords(vertices, tetrahedra, closed, mesh, held)
        held[closed] = True
    return vertices


def _fill_box(organs: Mapping[str, Mesh], settings: TetrahedraSettings) -> tuple[FloatArray, IntArray]:
    """Fill the box around all surfaces; their faces are the tetrahedra's, within the tolerance."""
    import pytetwild  # an extra

    edge, tolerance = sizes_in_mm(organs, settings)
    joined = Mesh.joined(list(organs.values()))
    vertices, faces = _deduplicated(joined.vertices, joined.faces)
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    points, tetrahedra = call(
        cast(Any, pytetwild).tetrahedralize,
        vertices=vertices,
        faces=faces.astype(np.int32),
        edge_length_abs=edge,
        epsilon=tolerance / diagonal,
        stop_energy=ENERGY,
        num_opt_iter=ROUNDS,
        num_threads=1,  # the workflow counts on it
        disable_filtering=True,
    )
    return np.asarray(points, float), np.asarray(tetrahedra, np.int64)


def _deduplicated(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Leave one of points, and of triangles, that are there twice, as a shared wall is."""
    points, inverse = np.unique(vertices, axis=0, return_inverse=True)
    faces = inverse.reshape(-1)[faces]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return points, faces[np.sort(first)]


def _inside(points: FloatArray, organs: Mapping[str, Mesh]) -> BoolArray:
    """Tell of points (P, 3) which organs' surfaces they lie in (P, R)."""
    found = np.zeros((len(points), len(organs)), bool)
    for n, mesh in enumerate(organs.values()):
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        near = np.flatnonzero(np.all((points > low) & (points < high), axis=1))
        found[near, n] = to_mesh(points[near], mesh) < 0
    return found


def _smallest_containing(inside: BoolArray, organs: Mapping[str, Mesh]) -> IntArray:
    """Choose of the organs (P, R) that hold a point the one of least volume (P,), or -1."""
    volumes = np.array([mesh.volume for mesh in organs.values()])
    chosen = np.where(inside, volumes, np.inf).argmin(axis=1)
    return np.where(inside.any(axis=1), chosen, -1)


def _bounding_sides(tetrahedra: IntArray, regions: IntArray) -> tuple[IntArray, IntArray]:
    """Find faces (T, 2) where a region ends, and the region beyond (T,), or -1; between two, the first's."""
    corners = np.sort(tetrahedra[:, FACES].reshape(-1, 3), axis=1)
    order = np.lexsort(corners.T)
    same = np.all(corners[order[1:]] == corners[order[:-1]], axis=1)
    other = np.full(len(corners), -1)
    first, second = order[:-1][same], order[1:][same]
    other[first], other[second] = second, first
    own = np.repeat(regions, 4)
    beyond = np.where(other >= 0, own[other], -1)
    kept = np.flatnonzero((beyond < 0) | (own < beyond))
    return np.column_stack([kept // 4, kept % 4]), beyond[kept]


def _at_ends_of(frame: Frame, points: FloatArray) -> BoolArray:
    """Whether points (P, 3) lie on the lower and upper sides of the scan's box (P, 3, 2)."""
    frame = frame.of_file
    inverse = np.linalg.inv(frame.affine)
    index = points @ inverse[:3, :3].T + inverse[:3, 3]
    ends = np.stack([np.full(3, -0.5), np.array(frame.shape) - 0.5], axis=1)
    return np.abs(index[:, :, None] - ends) < AT_SIDE


def _cut_at(frame: Frame, faces: Mesh) -> BoolArray:
    """Whether triangles (T,) lie on a side of the scan's box, and face its way."""
    axes = np.linalg.inv(frame.of_file.affine)[:3, :3]
    along = faces.unit_normals @ unit_vectors(axes).T
    facing = np.stack([-along, along], axis=2) > ALONG
    near = _at_ends_of(frame, faces.vertices)[faces.faces].all(axis=1)
    return np.any(near & facing, axis=(1, 2))


def _group(own: int, beyond: int, cut: bool, names: tuple[str, ...]) -> str:
    if beyond >= 0:
        return f"interface_{names[own]}_{names[beyond]}"
    kind = "cut" if cut else "wall"
    return kind if len(names) == 1 else f"{kind}_{names[own]}"
