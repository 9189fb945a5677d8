"""Ends of tubes cut square and closed by flat caps with names, as flow simulations want them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from cccd.errors import InputError
from cccd.geometry.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    concatenate_ragged,
    connected_parts,
    successors,
)
from cccd.geometry.flat_caps import fill_rim
from cccd.geometry.mesh import Mesh
from cccd.geometry.sections import cross_sections
from cccd_vessels.centrelines import Centrelines
from cccd_vessels.named import NamedMesh
from cccd_vessels.sections import Section, Slicer, across

#: Vertices keep this share of an edge away from the plane: nearer ones would make slivers along the rim.
_CLEAR = 0.15

#: Points inside a cap keep this share of the rim's edges away from the rim.
_FROM_RIM = 0.7


@dataclass(frozen=True, eq=False)
class End:
    """Where a free end is cut.

    Attributes
    ----------
    name : str
        ``inlet`` at a root, else ``outlet_1`` and so on.
    point, outward : (3,) float64
        A point of the centreline, and its direction there, out of the tube.
    radius : float
        Of the section there, in mm.
    """

    name: str
    point: FloatArray
    outward: FloatArray
    radius: float


def find_ends(found: Centrelines, location: str) -> list[End]:
    """Choose where to cut: at the last section before each free end that is complete.

    That is a radius from the surface at the end, because the round end of a tube reaches that far back.

    Parameters
    ----------
    found : Centrelines
    location : str
        What messages name.

    Raises
    ------
    InputError
        The tube has no free end.
    """
    ends: list[End] = []
    outlets = inlets = 0
    for branch in found.branches:
        at = np.flatnonzero(branch.measured)
        for kind, place, way in ((branch.start, 0, -1), (branch.end, -1, 1)):
            if kind != "end" or not len(at):
                continue
            if way < 0 and branch.parent == 0:
                inlets += 1
                name = "inlet" if inlets == 1 else f"inlet_{inlets}"
            else:
                outlets += 1
                name = f"outlet_{outlets}"
            n = at[place]
            ends.append(End(name, branch.points[n], way * branch.tangents[n], float(branch.radius[n])))
    if not ends:
        raise InputError(
            location,
            "no branch has a free end: the tube closes on itself",
            "cut the mask open where flow enters",
        )
    return ends


def clear_ends(layers: Sequence[tuple[Mesh, str]], ends: Sequence[End]) -> tuple[list[End], list[str]]:
    """Leave out ends whose cap would cross another tube, as where the walls of two merge, and name them.

    Parameters
    ----------
    layers, ends
        See `opened`.

    Returns
    -------
    list of End
    list of str
        A line for each end that stays closed.
    """
    kept = [end for end in ends if _is_clear(layers, end)]
    notes = [
        f"{end.name} stays closed: another branch runs within the wall where it would be cut"
        for end in ends
        if end not in kept
    ]
    return kept, notes


def _is_clear(layers: Sequence[tuple[Mesh, str]], end: End) -> bool:
    basis = across(end.outward)
    around: list[shapely.Polygon] = []
    others: list[shapely.Polygon] = []
    for mesh, _ in layers:
        (loops,) = cross_sections(mesh, end.outward, np.array([end.point @ end.outward]))
        polygons = [shapely.Polygon((loop - end.point) @ basis.T) for loop in loops]
        own = min((p for p in polygons if shapely.contains_xy(p, 0, 0)), key=lambda p: p.area, default=None)
        around += [] if own is None else [own]
        others += [polygon for polygon in polygons if polygon is not own]
    if not around:
        return True
    cap = around[0].difference(shapely.union_all(around[1:]))
    return not any(shapely.contains_xy(cap, *other.exterior.coords[0]) for other in others)


def opened(layers: Sequence[tuple[Mesh, str]], ends: Sequence[End], location: str) -> NamedMesh:
    """Cut a tube, or a wall between two surfaces, square at its ends, and close each cut by a flat cap.

    Parameters
    ----------
    layers : sequence of (Mesh, str)
        Closed meshes that bound the solid together, those of cavities turned inside out, and the names of
        their groups.
    ends : sequence of End
    location : str
        What messages name.

    Returns
    -------
    NamedMesh
        Closed. The cap of an end has its name.

    Raises
    ------
    InputError
        An end that bends back through the plane that would cut it.

    Examples
    --------
    >>> import trimesh
    >>> tube = trimesh.creation.cylinder(3.0, 40.0, sections=32)
    >>> ends = [End("inlet", np.array((0, 0, z)), np.array((0, 0, np.sign(z))), 3.0) for z in (-10.0, 10.0)]
    >>> cut = opened([(Mesh(tube.vertices, tube.faces), "wall")], ends[:1], "tube")
    >>> cut.names, cut.mesh.is_closed_manifold, round(float(np.ptp(cut.mesh.vertices[:, 2])), 6)
    (('wall', 'inlet'), True, 30.0)
    """
    cut = [mesh for mesh, _ in layers]
    caps: list[list[IntArray]] = []
    for end in ends:
        rims: list[IntArray] = []
        for number, mesh in enumerate(cut):
            cut[number], rim = _cut_off(mesh, end, required=number == 0, location=location)
            rims.append(rim)
        caps.append(rims)
    whole = Mesh.joined(cut)
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in cut[:-1])])
    counts = [len(mesh.faces) for mesh in cut]
    for end, rims in zip(ends, caps, strict=True):
        moved = [rim + start for rim, start in zip(rims, starts, strict=True) if len(rim)]
        inner, cap = _cap(whole.vertices, moved, end.outward)
        whole = Mesh(np.concatenate([whole.vertices, inner]), np.concatenate([whole.faces, cap]))
        counts.append(len(cap))
    names = (*(name for _, name in layers), *(end.name for end in ends))
    return NamedMesh(whole.compact(), np.repeat(np.arange(len(counts)), counts), names)


def _cut_off(mesh: Mesh, end: End, required: bool, location: str) -> tuple[Mesh, IntArray]:
    """Cut off what lies beyond an end's plane; the rest, and the vertices along its rim."""
    # The rest keeps the numbers of its vertices, so that earlier rims stay as they are.
    radii = np.array([end.radius])
    (section,) = Slicer(mesh).sections(end.point[None], end.outward[None], radii)
    if section is None:
        if required:
            raise _bent(end, location)
        return mesh, np.zeros(0, np.int64)
    mesh, height = _spread(mesh, section, end)
    beyond = _beyond(mesh.faces, height, section.faces)
    open_, rim = _clipped(mesh, beyond, height)
    if rim is None:
        raise _bent(end, location)
    return open_, rim


def _bent(end: End, location: str) -> InputError:
    x, y, z = end.point
    return InputError(
        location,
        f"{end.name} at ({x:.1f}, {y:.1f}, {z:.1f}) mm bends back through the plane that would cut it square",
        "shorten that end in the mask",
    )


def _spread(mesh: Mesh, section: Section, end: End) -> tuple[Mesh, FloatArray]:
    """Move vertices near the plane away from it along its normal; heights (V,) above it, never 0 there."""
    # Their order stays: heights up to twice the least one are mapped to what lies between the two.
    height = (mesh.vertices - end.point) @ end.outward
    cut = np.zeros(len(mesh.faces), np.bool_)
    cut[section.faces] = True
    around = np.unique(mesh.faces[mesh.with_neighbours(mesh.with_neighbours(cut))])
    edge = np.sqrt(np.median(Mesh(mesh.vertices, mesh.faces[cut]).face_areas))
    least = _CLEAR * edge
    moved = height.copy()
    away = np.abs(height[around])
    moved[around] = np.where(height[around] >= 0, 1, -1) * np.where(away < 2 * least, least + away / 2, away)
    return Mesh(mesh.vertices + (moved - height)[:, None] * end.outward, mesh.faces), moved


def _beyond(faces: IntArray, height: FloatArray, cut: IntArray) -> BoolArray:
    """Mark the faces (F,) with a vertex beyond the plane that hang together with faces ``cut`` (K,)."""
    candidates = np.flatnonzero((height[faces] > 0).any(axis=1))
    triangles = faces[candidates]
    above = height > 0
    following = np.roll(triangles, -1, axis=1)
    both = above[triangles] & above[following]
    part = connected_parts(triangles[both], following[both], len(height))
    of_face = np.where(above[triangles], part[triangles], -1).max(axis=1)
    wanted = np.unique(of_face[np.isin(candidates, cut)])
    marked = np.zeros(len(faces), bool)
    marked[candidates[np.isin(of_face, wanted)]] = True
    return marked


def _clipped(mesh: Mesh, beyond: BoolArray, height: FloatArray) -> tuple[Mesh, IntArray | None]:
    """Clip marked faces at height 0; the rest, and its rim, None where that is not one loop."""
    faces = mesh.faces[beyond]
    above = height[faces] > 0
    ahead = np.roll(above, -1, axis=1)
    crossing = above != ahead
    low = np.where(above, np.roll(faces, -1, axis=1), faces)[crossing]
    high = np.where(above, faces, np.roll(faces, -1, axis=1))[crossing]
    edges, ids = np.unique(np.column_stack([low, high]), axis=0, return_inverse=True)
    share = (height[edges[:, 0]] / (height[edges[:, 0]] - height[edges[:, 1]]))[:, None]
    points = mesh.vertices[edges[:, 0]] * (1 - share) + mesh.vertices[edges[:, 1]] * share
    met = np.full(faces.shape, -1)
    met[crossing] = len(mesh.vertices) + ids.ravel()
    kept = np.concatenate([_one_above(faces, above, met), _one_below(faces, above, met)])
    rest = Mesh(np.concatenate([mesh.vertices, points]), np.concatenate([mesh.faces[~beyond], kept]))
    return rest, _rim(rest, len(mesh.vertices))


def _one_above(faces: IntArray, above: BoolArray, met: IntArray) -> IntArray:
    """Parts below the plane of faces with one vertex above it: quadrilaterals, as two triangles each."""
    rows = np.flatnonzero(above.sum(axis=1) == 1)
    first = above[rows].argmax(axis=1)
    b, c = faces[rows, (first + 1) % 3], faces[rows, (first + 2) % 3]
    leaving, entering = met[rows, first], met[rows, (first + 2) % 3]
    return np.concatenate([np.column_stack([leaving, b, c]), np.column_stack([leaving, c, entering])])


def _one_below(faces: IntArray, above: BoolArray, met: IntArray) -> IntArray:
    """Parts below the plane of faces with one vertex below it."""
    rows = np.flatnonzero(above.sum(axis=1) == 2)
    first = (~above[rows]).argmax(axis=1)
    return np.column_stack([faces[rows, first], met[rows, first], met[rows, (first + 2) % 3]])


def _rim(mesh: Mesh, first: int) -> IntArray | None:
    """Loop of the vertices from ``first`` on, along open edges, against their triangles' direction."""
    start, end = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    count = len(mesh.vertices)
    ours = (start >= first) & (end >= first)
    start, end = start[ours], end[ours]
    open_ = ~np.isin(start * count + end, end * count + start)
    following = dict(zip(end[open_].tolist(), start[open_].tolist(), strict=True))
    if len(following) != np.count_nonzero(open_) or not following:
        return None
    rim = [next(iter(following))]
    while (n := following.get(rim[-1])) is not None and n != rim[0]:
        rim.append(n)
    return np.array(rim, np.int64) if len(rim) == len(following) else None


def _cap(vertices: FloatArray, rims: Sequence[IntArray], outward: FloatArray) -> tuple[FloatArray, IntArray]:
    """Points inside a cap (n, 3), numbered after the vertices, and its triangles; the first rim is outer."""
    basis = across(outward)
    origin = vertices[rims[0][0]]
    flat = [(vertices[rim] - origin) @ basis.T for rim in rims]
    edge = float(np.mean(np.linalg.norm(np.diff(flat[0], axis=0), axis=1)))
    points, offsets = concatenate_ragged(flat)
    sides = np.column_stack([np.arange(len(points)), successors(offsets)])
    inner, triangles = fill_rim(points, sides, _lattice(shapely.Polygon(flat[0], flat[1:]), edge))
    ids = np.concatenate([*rims, len(vertices) + np.arange(len(inner))])
    return origin + inner @ basis, ids[triangles]


def _lattice(polygon: shapely.Polygon, edge: float) -> FloatArray:
    """Points (n, 2) of a triangular lattice inside a polygon, not near its rims."""
    low_x, low_y, high_x, high_y = polygon.bounds
    rows = np.arange(low_y, high_y, edge * np.sqrt(0.75))
    columns = np.arange(low_x - edge, high_x, edge)
    x = columns[None] + (np.arange(len(rows)) % 2)[:, None] * edge / 2
    points = np.column_stack([x.ravel(), np.repeat(rows, len(columns))])
    inside = shapely.contains_xy(polygon.buffer(-_FROM_RIM * edge), points[:, 0], points[:, 1])
    return points[inside]
