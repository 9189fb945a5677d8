"""What must hold of every surface, whatever it was made from: found by looking at the surface and the slices.

Nothing here knows how the surface was made, and nothing switches it off.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from cccd.bands import Slices
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.distance import unsigned_to_mesh
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import voxelise
from cccd.surface.distances import sampled
from cccd.surface.stack import SliceStack
from cccd.tolerances import SHRUNK_PART

#: On a slice the surface lies within so many pixels of the slice's outline.
ON_SLICE = 0.75
#: The surface holds the slices' volume but for this share.
VOLUME = 0.005


@dataclass(frozen=True, eq=False)
class Violation:
    """Where a surface is not as it must be.

    Attributes
    ----------
    problem : str
        What, in a few words, with its size.
    places : (P, 3) float64
        Where, the worst first, in the plane's mm and height in mm; none where it is of the whole surface.
    """

    problem: str
    places: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    def line(self, to_world: FloatArray) -> str:
        """One line for people, the place in mm RAS by an affine (4, 4)."""
        if len(self.places) == 0:
            return self.problem
        x, y, z = to_world[:3, :3] @ self.places[0] + to_world[:3, 3]
        return f"{self.problem} at ({x:.1f}, {y:.1f}, {z:.1f}) mm"


def check_surface(mesh: Mesh, stack: SliceStack, pairs: IntArray | None = None) -> list[Violation]:
    """Find what is wrong with a surface.

    It is closed and passes nowhere through itself. On every slice it lies within `ON_SLICE` pixels of the
    outline, both ways; between two slices no further from what they hold than a voxel's diagonal. It holds
    their volume, and has as many bodies and cavities as they imply.

    Parameters
    ----------
    mesh : Mesh
        In the plane's mm and height in mm.
    stack : SliceStack
        What the slices hold.
    pairs : (K, 2) int64, optional
        Triangles that pass through each other, where that is known.
    """
    found: list[Violation] = []
    if not mesh.is_closed_manifold:
        found.append(Violation("the surface is not closed"))
    pairs = mesh.self_intersections() if pairs is None else pairs
    found += crossing(mesh, pairs)
    found += _off_slices(mesh, stack)
    found += _off_between(mesh, stack)
    return found + _of_other_volume(mesh, stack) + _of_other_topology(mesh, stack)


def crossing(mesh: Mesh, pairs: IntArray) -> list[Violation]:
    """Report pairs (K, 2) of triangles that pass through each other."""
    if not len(pairs):
        return []
    places = mesh.vertices[mesh.faces[pairs[:, 0]]].mean(axis=1)
    return [Violation(f"the surface intersects itself in {_counted(len(pairs), 'place')}, the first", places)]


def lost_voxels(mesh: Mesh, stack: SliceStack) -> tuple[FloatArray, FloatArray]:
    """Find the pixels of slices that lie on the wrong side of a surface by more than `ON_SLICE` pixels.

    Returns
    -------
    places : (P, 3) float64
        Their centres, in the plane's mm and height in mm.
    far : (P,) float64
        mm from the surface.
    """
    slices, most = stack.slices, ON_SLICE * stack.pixel
    places = _centres(_inside(mesh, slices) != (slices.distance < 0), slices)
    # the nearest vertex is quickly found, and no nearer than the surface
    away = np.asarray(cKDTree(mesh.vertices).query(places)[0], float)
    places, away = places[away > most], away[away > most]
    if not len(places):
        return places, away
    a, b = mesh.vertices[mesh.faces], mesh.vertices[np.roll(mesh.faces, 1, axis=1)]
    reach = float(away.max() + np.linalg.norm(a - b, axis=2).max())
    near = np.isfinite(cKDTree(places).query(mesh.vertices, distance_upper_bound=reach)[0])
    faces = mesh.faces[np.any(near[mesh.faces], axis=1)]
    far = unsigned_to_mesh(places, Mesh(mesh.vertices, faces).compact())
    wrong = far > most
    return places[wrong], far[wrong]


def pixels_within(mesh: Mesh, slices: Slices) -> FloatArray:
    """Centres (P, 3) of the slices' pixels that a closed mesh holds, in the plane's mm and height in mm."""
    return _centres(_inside(mesh, slices), slices)


def _centres(pixels: BoolArray, slices: Slices) -> FloatArray:
    """Centres (P, 3) of some pixels (S, I, J), in the plane's mm and height in mm."""
    slice_, *at = np.nonzero(pixels)
    return np.column_stack([np.column_stack(at) * slices.spacing, slices.z[slice_]])


def places_off_slices(mesh: Mesh, stack: SliceStack) -> tuple[FloatArray, FloatArray]:
    """Find where a surface leaves a slice's outline, and pixels on its wrong side, by over `ON_SLICE` pixels.

    Returns
    -------
    places : (P, 3) float64
        In the plane's mm and height in mm, the worst first.
    far : (P,) float64
        How many mm.
    """
    # Distances are in space: where the surface lies almost flat on a slice, its outline there says little.
    slices = stack.slices
    across = np.linalg.norm(mesh.vertex_normals[:, :2], axis=1)
    lost, lost_by = lost_voxels(mesh, stack)
    points, off = [lost], [lost_by]
    sections = _sections(mesh, across, slices.z)
    for distance, section in zip(slices.distance, sections, strict=True):
        points.append(section[:, :3])
        off.append(np.abs(sampled(distance, section[:, :2] / slices.spacing)) * section[:, 3])
    places, far = np.concatenate(points), np.concatenate(off)
    order = np.argsort(-far, kind="stable")[: np.count_nonzero(far > ON_SLICE * stack.pixel)]
    return places[order], far[order]


def _off_slices(mesh: Mesh, stack: SliceStack) -> list[Violation]:
    """Report where the surface leaves the slices."""
    places, far = places_off_slices(mesh, stack)
    if not len(places):
        return []
    where = _counted(len(np.unique(places[:, 2])), "slice")
    return [
        Violation(f"the surface is up to {far[0]:.2g} mm away from the outline of {where}, farthest", places)
    ]


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" + ("" if count == 1 else "s")


def _sections(mesh: Mesh, values: FloatArray, heights: FloatArray) -> list[FloatArray]:
    """Points in which a mesh's edges meet planes across z, and values (V,) there: (P, 4), plane by plane."""
    vertices = np.column_stack([mesh.vertices, values])
    ends = np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    ends = ends[ends[:, 0] < ends[:, 1]]  # in a closed mesh each edge comes once this way round
    low, high = vertices[ends[:, 0]], vertices[ends[:, 1]]
    turned = low[:, 2] > high[:, 2]
    low[turned], high[turned] = high[turned], low[turned]
    first, last = np.searchsorted(heights, low[:, 2]), np.searchsorted(heights, high[:, 2])
    number = last - first
    edge = np.repeat(np.arange(len(low)), number)
    plane: IntArray = np.arange(len(edge)) - np.repeat(np.cumsum(number) - number, number) + first[edge]
    rise = high[edge, 2] - low[edge, 2]
    share = ((heights[plane] - low[edge, 2]) / np.where(rise > 0, rise, 1))[:, None]
    points = low[edge] * (1 - share) + high[edge] * share
    order = np.argsort(plane, kind="stable")
    return np.split(points[order], np.searchsorted(plane[order], np.arange(1, len(heights))))


def _inside(mesh: Mesh, slices: Slices) -> BoolArray:
    """Which pixels (S, I, J) of slices have their centre inside a closed mesh."""
    # heights to numbers of slices, which are even only in a run without missing ones
    heights = slices.z
    if len(heights) == 1:
        scaled = mesh.vertices[:, 2] - heights[0]
    else:
        step = np.diff(heights)
        scaled = np.interp(mesh.vertices[:, 2], heights, np.arange(len(heights), dtype=float))
        scaled += np.minimum(mesh.vertices[:, 2] - heights[0], 0) / step[0]
        scaled += np.maximum(mesh.vertices[:, 2] - heights[-1], 0) / step[-1]
    pixels = Mesh(np.column_stack([mesh.vertices[:, :2] / slices.spacing, scaled]), mesh.faces)
    block = voxelise(pixels, np.eye(4), (*slices.distance.shape[1:], len(heights)), np.zeros(3, np.int64))
    return np.moveaxis(block, 2, 0)


def _off_between(mesh: Mesh, stack: SliceStack) -> list[Violation]:
    """Find where the surface is further from the voxels of the slices beside than their diagonal."""
    heights, planes = stack.slices.z, stack.slices.distance
    above = np.searchsorted(heights, mesh.vertices[:, 2])
    order = np.argsort(above, kind="stable")
    diagonal = float(np.linalg.norm(stack.voxel))
    off = np.zeros(len(order))
    starts = np.searchsorted(above[order], np.arange(len(heights) + 2))
    for n in range(len(heights) + 1):
        here = order[starts[n] : starts[n + 1]]
        if len(here) == 0:
            continue
        pixels = mesh.vertices[here, :2] / stack.slices.spacing
        around = [m for m in range(n - 2, n + 2) if 0 <= m < len(heights)]
        values = np.array([sampled(planes[m], pixels) for m in around])
        beyond = np.abs(mesh.vertices[here, 2] - heights[around][:, None]) - stack.step / 2
        outside = np.hypot(np.maximum(values, 0), np.maximum(beyond, 0)).min(axis=0)
        # a cap may lie deep in two slices, but not in the next ones too
        depth = -values.max(axis=0) if len(around) == 4 else np.zeros(len(here))
        off[here] = np.maximum(outside, depth)
    far = np.flatnonzero(off > diagonal)
    if len(far):  # what is followed between the slices moves further aside
        far = far[np.abs(stack.distance(mesh.vertices[far])) > stack.pixel]
    if len(far) == 0:
        return []
    far = far[np.argsort(-off[far], kind="stable")]
    text = f"the surface is {off[far[0]]:.2g} mm away from the voxels of the neighbouring slices"
    return [Violation(text, mesh.vertices[far])]


def _of_other_volume(mesh: Mesh, stack: SliceStack) -> list[Violation]:
    """Find a volume that is not the slices'."""
    if stack.held_volume is None or abs((share := mesh.volume / stack.held_volume) - 1) <= VOLUME:
        return []
    return [
        Violation(f"the surface has {share:.1%} of its slices' volume: some parts are as thin as a voxel")
    ]


def _of_other_topology(mesh: Mesh, stack: SliceStack) -> list[Violation]:
    """Find parts that the slices do not imply, and parts that are missing; small ones do not count."""
    volumes = mesh.piece_volumes
    least = stack.smallest
    # what touches at a corner, or across a missing slice, may be one part or two
    bodies = sum(volume >= least for volume in stack.part_volumes)
    separate = max(bodies, _separate(_with_missing(stack.slices, stack.step), least, stack))
    found = int(np.count_nonzero(volumes >= least))
    at_most = int(np.count_nonzero(volumes >= SHRUNK_PART * least))
    problems: list[Violation] = []
    if at_most < bodies or found > separate:
        implied = f"{bodies}" if bodies == separate else f"{bodies} to {separate}"
        problems.append(Violation(f"the surface has {_counted(found, 'part')}, the slices imply {implied}"))
    return problems


def _with_missing(slices: Slices, step: float) -> BoolArray:
    """Pixels (S, I, J) inside, with an empty slice wherever some are missing."""
    wide = np.flatnonzero(np.diff(slices.z) > 1.5 * step) + 1
    return np.insert(slices.distance < 0, wide, False, axis=0)


def _separate(inside: BoolArray, least: float, stack: SliceStack) -> int:
    """Count the parts (S, I, J) of at least so many mm^3; what touches at an edge or a corner is apart."""
    parts, _ = ndimage.label(inside)
    size = np.bincount(parts.ravel())[1:] * float(stack.voxel.prod())
    return int(np.count_nonzero(size >= least))
