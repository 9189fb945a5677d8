"""A surface in a number of triangles of one size: its tessellation, with fewer, evenly spread vertices."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray, IntArray, connected_parts
from cccd.geometry.decimation import WITHIN, Seams, at_corners, collapse_apart, collapse_edges
from cccd.geometry.distance import nearest_faces, nearest_points, unsigned_to_mesh
from cccd.geometry.mesh import Mesh
from cccd.surface.surface import LoftedSurface
from cccd.tolerances import TINY

#: The tessellation has at least this many times the triangles asked for: enough to choose from.
SPARE = 8

#: Times that the spline is subdivided for it, at least and at most.
FEWEST_TIMES, MOST_TIMES = 2, 6

#: Most triangles: more take minutes and gigabytes.
MOST = 2_000_000

#: Fewest triangles of a body: with less even a ball is a block.
FEWEST = 60

#: Weight of even edges beside the distance to the surface: edges decide, wherever they cost anything.
EVENNESS = 10.0

#: Rounds in which vertices move to the middle of their triangles; after five little changes.
ROUNDS = 5

#: A tip stays: a vertex whose triangles have their middle so far inside, by the root of their area.
TIP = 0.2

#: Triangles that meet at more than this angle have a ridge between them, where the scan cuts an organ.
SHARP_DEG = 40.0

#: Triangles lower than the first share of their longest edge are slivers; lower than the second they are but
#: this edge. What bends less than so many degrees lies in a plane.
SLIVER, NEEDLE, FLAT_DEG = 0.15, 0.05, 5.0

#: Triangles of one size are this much longer, on the average, than equilateral ones of their mean area.
UNEVEN = 1.015

#: The number of triangles is as asked for to this share.
EXACT = 0.02


def with_uniform_triangles(
    surface: LoftedSurface, triangles: int | None = None, edge_mm: float | None = None
) -> LoftedSurface:
    """Return the surface with a mesh of triangles of about one size.

    Parameters
    ----------
    surface : LoftedSurface
        With the splines that its mesh was made of.
    triangles : int, optional
        How many, to 2 %.
    edge_mm : float, optional
        Or how long their edges are on the average.

    Returns
    -------
    LoftedSurface
        Vertices lie on the tessellated spline, within .05 voxels of it, and sharp rims stay.
        ``report["uniform"]`` has the number of ``triangles``, their edges' ``edge_mm`` (least, mean, largest)
        and ``chord_error_mm``, the largest distance between triangles and spline. Intervals stay those of
        the spline.

    Raises
    ------
    InputError
        Neither or both are given, the surface shares its walls, or so few or so many triangles cannot be.
    """
    if (triangles is None) == (edge_mm is None):
        raise InputError("--triangles", "one of --triangles and --edge-mm is needed", "name one of them")
    option, value = ("--triangles", triangles) if edge_mm is None else ("--edge-mm", edge_mm)
    if value is None or not value > 0:
        raise InputError(option, f"{value} is not positive", "give a number above 0")
    if not surface.bodies:
        raise InputError(
            option,
            "neighbours that share a wall keep its triangles",
            "choose one --label, or set surface.shared_walls: false",
        )
    count = (
        round(surface.mesh.area / (3**0.5 / 4 * (edge_mm / UNEVEN) ** 2)) if edge_mm else int(triangles or 0)
    )
    if count > MOST:
        raise InputError(option, f"{value:g} makes {count:.2g} triangles", f"ask for {MOST} at most")
    least = FEWEST * len(surface.bodies)
    if count < least:
        hint = f"ask for {least} at least"
        raise InputError(option, f"{value:g} makes {count} triangles, too few for the shape", hint)
    quads = sum(len(body.quads) for body in surface.bodies)
    times = int(np.ceil(np.log2(max(1.0, SPARE * count / (2 * quads))) / 2))
    fine = Mesh.joined(
        [body.tessellate(int(np.clip(times, FEWEST_TIMES, MOST_TIMES))) for body in surface.bodies]
    )
    mesh = uniform_mesh(fine, count)
    made, hint = len(mesh.faces), "raise --triangles" if edge_mm is None else "give a shorter --edge-mm"
    if abs(made / count - 1) > EXACT:
        hint = f"ask for {made} at most" if made < count else hint
        raise InputError(option, f"the surface would have {made} triangles, not {count}", hint)
    if len(mesh.self_intersections()):
        raise InputError(option, f"{made} triangles would pass through each other", hint)
    band = surface.band and surface.band.moved_to(surface.vertices, mesh.vertices)
    whole = surface.whole or surface
    uniform = _measured(mesh, fine) | {"spline_ml": whole.mesh.volume / 1000}
    report = surface.report | {"uniform": uniform}
    return replace(surface, mesh=mesh, band=band, report=report, whole=whole)


def uniform_mesh(fine: Mesh, count: int) -> Mesh:
    """Make a closed mesh of so many triangles of about one size of one with many more.

    Parameters
    ----------
    fine : Mesh
        A closed manifold, oriented.
    count : int
        Triangles; more where the topology needs them.

    Returns
    -------
    Mesh
        A closed manifold of the same genus, whose vertices lie on ``fine``. Its ridges stay.

    Examples
    --------
    >>> import trimesh
    >>> ball = trimesh.creation.icosphere(4, 10.0)
    >>> even = uniform_mesh(Mesh(np.array(ball.vertices), np.array(ball.faces, np.int64)), 500)
    >>> len(even.faces), even.is_closed_manifold, even.genus
    (500, True, 0)
    """
    parts = _parts(fine)
    coarse = collapse_edges(fine, count, EVENNESS, parts=parts)
    even = _relaxed(coarse, fine, parts)
    if len(even.self_intersections()) == 0:
        return even
    apart = collapse_apart(fine, count)
    return Mesh(nearest_points(apart.vertices, fine), apart.faces)


def _parts(mesh: Mesh) -> IntArray:
    """Tell which part between ridges each face (F,) is of."""
    bends = mesh.dihedrals
    first, second = bends.faces[np.degrees(bends.angles) < SHARP_DEG].T
    return connected_parts(first, second, len(mesh.faces))


def _relaxed(coarse: Mesh, fine: Mesh, parts: IntArray) -> Mesh:
    """Move vertices to the middle of their triangles along the surface; those of ridges stay."""
    mesh = Mesh(nearest_points(coarse.vertices, fine), coarse.faces)
    part = parts[nearest_faces(mesh.vertices[mesh.faces].mean(axis=1), fine)]
    fixed = Seams.of(mesh.faces, part, len(mesh.vertices)).kinds > WITHIN
    for _ in range(ROUNDS):
        normal, step = mesh.vertex_normals, _middles(mesh) - mesh.vertices
        inwards = np.einsum("vc,vc->v", step, normal)
        tips = inwards < -TIP * np.sqrt(mesh.vertex_areas)
        step = np.where(tips[:, None], 0, step - inwards[:, None] * normal)  # else tips would be lost
        moved = nearest_points(mesh.vertices + step, fine)
        mesh = Mesh(np.where(fixed[:, None], mesh.vertices, moved), coarse.faces)
    return _without_slivers(mesh)


def _without_slivers(mesh: Mesh) -> Mesh:
    """Turn the longest edge of slivers that lie in a plane with what is beside them, or on that edge."""
    faces, bends = mesh.faces.copy(), mesh.dihedrals
    known, done = {(int(a), int(b)) for a, b in bends.edges}, set[int]()
    height, longest = _heights(mesh.vertices[faces]), np.zeros(len(faces))
    np.maximum.at(longest, bends.faces, bends.lengths[:, None])
    least = np.where(np.degrees(bends.angles) < FLAT_DEG, SLIVER, NEEDLE)[:, None]
    turned = (height[bends.faces] < least) & (bends.lengths[:, None] == longest[bends.faces])
    for n in np.flatnonzero(turned.any(axis=1)):
        pair = bends.faces[n]
        one, other = (int(np.setdiff1d(faces[face], bends.edges[n])[0]) for face in pair)
        first = np.roll(faces[pair[0]], -int(np.flatnonzero(faces[pair[0]] == one)[0]))
        made = np.array([[one, first[1], other], [one, other, first[2]]])
        new = (min(one, other), max(one, other))
        better = _heights(mesh.vertices[made]).min() > _heights(mesh.vertices[faces[pair]]).min()
        if better and new not in known and done.isdisjoint(pair.tolist()):
            faces[pair] = made
            known.add(new)
            done.update(pair.tolist())
    return Mesh(mesh.vertices, faces)


def _heights(corners: FloatArray) -> FloatArray:
    """Heights (F,) of triangles (F, 3, 3) above their longest edges, by these."""
    sides = corners - np.roll(corners, 1, axis=1)
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return area / np.maximum(np.einsum("fkc,fkc->fk", sides, sides).max(axis=1), TINY)


def _middles(mesh: Mesh) -> FloatArray:
    """Means (V, 3) of the centres of the triangles around each vertex, by their areas."""
    areas, centres = mesh.face_areas[:, None], mesh.vertices[mesh.faces].mean(axis=1)
    total = at_corners(mesh, np.column_stack([areas * centres, areas]))
    return total[:, :3] / np.maximum(total[:, 3:], TINY)


def _measured(mesh: Mesh, fine: Mesh) -> dict[str, Any]:
    edges, _, lengths, *_ = mesh.dihedrals
    tried = np.concatenate([mesh.vertices[some].mean(axis=1) for some in (mesh.faces, edges)])
    return {
        "triangles": len(mesh.faces),
        "edge_mm": [float(lengths.min()), float(lengths.mean()), float(lengths.max())],
        "chord_error_mm": float(
            max(unsigned_to_mesh(tried, fine).max(), unsigned_to_mesh(fine.vertices, mesh).max())
        ),
    }
