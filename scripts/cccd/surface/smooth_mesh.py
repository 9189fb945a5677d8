"""The closed mesh that a spline is fitted to: the distances' zero level, low-passed once.

The filter takes the steps of pixels and slices off and keeps the volume. Where it would leave a voxel of a
slice on the wrong side, as at the tip of a thin rib, or let the mesh pass through itself, it does less.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from cccd.geometry.arrays import FloatArray
from cccd.geometry.collisions import MovingTriangles
from cccd.geometry.flat_caps import between_planes
from cccd.geometry.mesh import WIDEST_BAND, Mesh
from cccd.surface.checks import lost_voxels, pixels_within
from cccd.surface.distances import SampledDistance
from cccd.surface.stack import SliceStack
from cccd.tolerances import HELD_VOLUME, SHRUNK_PART

#: Waves of this many pixels and shorter go, or of this many slice distances. Shorter ones leave steps of
#: pixels, and ripples between slices that are far apart; longer ones cost detail.
WAVE_PIXELS, WAVE_SLICES = 8.0, 2.5
#: Degree of the filter's polynomial: how sharply waves are parted.
ROUNDS = 30
#: Edges of an isosurface are this long, in pixels, on the mean.
EDGE_PIXELS = 0.75
#: The surface is moved at most by so many pixels to hold the slices' volume.
MOST_OFFSET = 0.5
#: It holds it after a few moves: threads need the most.
VOLUME_ROUNDS = 6
#: Vertices within this share of a level's height of where the scan ends are moved there before it cuts.
NEXT_TO_CUT = 0.2
#: Rounds in which lost voxels are given back, and how far around them in pixels the filter does less.
MENDING_ROUNDS, MENDED_PIXELS = 4, 3.0
#: The filter does less where it moves the surface inwards: by so much for each pixel, as it is on the mean of
#: neighbours over so many rounds. Thin trees are 10 % nearer to the truth, and bend no more.
LESS, INWARD_ROUNDS = 6.0, 8
#: A branch as thin as a voxel is a thread where its area shrank to this share, averaged over neighbours.
THREAD, AREA_ROUNDS = 0.3, 2


def smooth_mesh(stack: SliceStack, wave: float | None = None) -> Mesh:
    r"""Mesh what the slices tell, without the steps of pixels and slices.

    Parameters
    ----------
    stack : SliceStack
    wave : float, optional
        Length in mm of the longest waves that are taken off; by default `WAVE_PIXELS`, or `WAVE_SLICES` where
        these are longer.

    Returns
    -------
    Mesh
        Closed, oriented outwards, in the plane's mm and height in mm. It runs on where the scan ends; see
        `cut_at_ends`.

    Notes
    -----
    A windowed sinc filter (Taubin, Zhang and Golub 1996). A wave of length :math:`w` is an eigenvector of the
    means over neighbours at a distance :math:`h`, with the value :math:`1 - (\pi h / w)^2`; what is taken
    from one there is the band.
    """
    distance, pixel = stack.distance, stack.pixel
    rough = without_small(distance.zero_surface(), stack)
    wave = default_wave(pixel, stack.step) if wave is None else wave
    band = min((np.pi * EDGE_PIXELS * pixel / max(wave, 1e-6)) ** 2, WIDEST_BAND)
    smooth = _kept_where_shrunk(rough.low_passed(band, ROUNDS), rough, stack)
    if stack.held_volume is not None:
        smooth = _of_volume(smooth, stack.held_volume, distance)
    return _mended(smooth, rough, stack)


def default_wave(pixel: float, step: float) -> float:
    """Length in mm of the longest waves that go, for pixels and distances of slices in mm."""
    return max(WAVE_PIXELS * pixel, WAVE_SLICES * step)


def _of_volume(mesh: Mesh, volume: float, distance: SampledDistance) -> Mesh:
    """Move a mesh along its normals until it holds a volume in mm^3, by no more than `MOST_OFFSET`."""
    moved, most = 0.0, MOST_OFFSET * distance.pixel
    there = mesh
    for _ in range(VOLUME_ROUNDS):
        missing = volume - volume_between(there, distance.ends)
        if abs(missing) <= HELD_VOLUME * volume:
            break
        moved = float(np.clip(moved + missing / max(_area_between(there, distance.ends), 1e-9), -most, most))
        there = Mesh(mesh.vertices + moved * mesh.vertex_normals, mesh.faces)
    return there


def _kept_where_shrunk(smooth: Mesh, rough: Mesh, stack: SliceStack) -> Mesh:
    """Go back towards the rough mesh where the smooth one shrank, all the way where it is a thread."""
    inwards = ((rough.vertices - smooth.vertices) * rough.vertex_normals).sum(axis=1) / stack.pixel
    kept = np.clip(LESS * rough.averaged(inwards, INWARD_ROUNDS), 0, 1)
    area, before = (one.averaged(one.vertex_areas, AREA_ROUNDS) for one in (smooth, rough))
    thread = np.flatnonzero(area < THREAD * before)
    if len(thread):
        kept = np.maximum(kept, _beside(rough, rough.vertices[thread], np.zeros(len(thread)), stack))
    return _between(smooth, rough, kept)


def _mended(smooth: Mesh, rough: Mesh, stack: SliceStack) -> Mesh:
    """Go back towards the rough mesh where the smooth one loses voxels of slices, or crosses itself."""
    kept, triangles = np.zeros(len(rough.vertices)), MovingTriangles(rough.faces)
    mesh = smooth
    for _ in range(MENDING_ROUNDS):
        places, far = lost_voxels(mesh, stack)
        crossing = mesh.vertices[np.unique(mesh.faces[triangles.passing_pairs(mesh.vertices)])]
        places, far = np.concatenate([places, crossing]), np.append(far, np.zeros(len(crossing)))
        if not len(places):
            break
        kept = np.maximum(kept, _beside(rough, places, far, stack))
        mesh = _between(smooth, rough, kept)
        if stack.held_volume is not None:
            mesh = _of_volume(mesh, stack.held_volume, stack.distance)
    return mesh


def _beside(mesh: Mesh, places: FloatArray, far: FloatArray, stack: SliceStack) -> FloatArray:
    """Shares (V,): 1 at places (P, 3), and so far (P,) around, falling to 0 within `MENDED_PIXELS`."""
    away, nearest = cKDTree(places).query(mesh.vertices)
    near = 1 - np.clip((away - far[nearest]) / (MENDED_PIXELS * stack.pixel), 0, 1)
    return near * near * (3 - 2 * near)


def _between(smooth: Mesh, rough: Mesh, share: FloatArray) -> Mesh:
    """Vertices on the way from one mesh to another: shares (V,) of 1 are the rough one's."""
    return Mesh(smooth.vertices + share[:, None] * (rough.vertices - smooth.vertices), rough.faces)


def without_small(mesh: Mesh, stack: SliceStack) -> Mesh:
    """Leave out a mesh's pieces that are too small and around no pixel's centre, but for the largest."""
    pieces = sorted(mesh.pieces(), key=lambda piece: -abs(piece.volume))
    least = SHRUNK_PART * stack.smallest
    count = max(1, sum(abs(piece.volume) >= least for piece in pieces))
    large, small = pieces[:count], pieces[count:]
    if not small:
        return mesh
    places = pixels_within(Mesh.joined([piece.outwards() for piece in small]), stack.slices)
    of_piece = np.repeat(np.arange(len(small)), [len(piece.vertices) for piece in small])
    nearest = cKDTree(np.concatenate([piece.vertices for piece in small])).query(places)[1]
    return Mesh.joined(large + [small[number] for number in np.unique(of_piece[nearest]).tolist()])


def volume_between(mesh: Mesh, ends: tuple[float, float]) -> float:
    """Volume in mm^3 of a closed mesh between two heights in mm, infinite without a plane.

    By the divergence theorem, of a field across the planes that is zero below, height above the lower plane
    between them, and the same all over beyond.

    Examples
    --------
    >>> corner = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    >>> tetrahedron = Mesh(corner, np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]))
    >>> round(6 * volume_between(tetrahedron, (0.5, np.inf)), 9)
    0.125
    """
    if not np.isfinite(ends).any():
        return mesh.volume
    height, up = np.sort(mesh.vertices[mesh.faces, 2], axis=1), mesh.face_normals[:, 2] / 2
    return float(up @ (_mean_above(height, ends[0]) - _mean_above(height, ends[1])))


def _mean_above(height: FloatArray, plane: float) -> FloatArray:
    """Mean over triangles (F,) of how far they are above a plane, zero below; their heights (F, 3) ascend."""
    if plane == np.inf:
        return np.zeros(len(height))
    if plane == -np.inf:
        return height.mean(axis=1)
    a, b, c = np.asarray(height - plane).T
    tip = np.maximum(c, 0) ** 3 / np.maximum(3 * (c - a) * (c - b), 1e-30)
    foot = np.maximum(-a, 0) ** 3 / np.maximum(3 * (b - a) * (c - a), 1e-30)
    mean = (a + b + c) / 3
    return np.select([a >= 0, c <= 0, b <= 0], [mean, np.zeros(len(mean)), tip], mean + foot)


def _area_between(mesh: Mesh, ends: tuple[float, float]) -> float:
    """Area in mm^2 of the triangles whose middles lie between two heights."""
    middle = mesh.vertices[mesh.faces, 2].mean(axis=1)
    return float(mesh.face_areas[(middle > ends[0]) & (middle < ends[1])].sum())


def cut_at_ends(mesh: Mesh, distance: SampledDistance) -> Mesh:
    """Cut a closed mesh by planes where the scan ends, and close it by planar caps."""
    if not np.isfinite(distance.ends).any():
        return mesh
    return moved_to_ends(between_planes(moved_to_ends(mesh, distance), *distance.ends), distance)


def moved_to_ends(mesh: Mesh, distance: SampledDistance) -> Mesh:
    """Move vertices that lie next to where the scan ends there."""
    vertices: FloatArray = mesh.vertices.copy()
    for end in distance.ends:
        vertices[np.abs(vertices[:, 2] - end) < NEXT_TO_CUT * distance.level_step, 2] = end
    return Mesh(vertices, mesh.faces)
