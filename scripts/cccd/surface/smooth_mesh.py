"""The closed mesh that a spline is fitted to: the distances' zero level, low-passed once.

The filter takes the steps of pixels and slices off and keeps the volume. Where it would leave a voxel of a
slice on the wrong side, as at the tip of a thin rib, it does less.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from cccd.geometry.arrays import FloatArray
from cccd.geometry.booleans import between_planes
from cccd.geometry.mesh import Mesh
from cccd.surface.checks import lost_voxels
from cccd.surface.control_mesh import on_caps
from cccd.surface.sampled import SampledDistance
from cccd.surface.stack import SliceStack
from cccd.tolerances import SHRUNK_PART

__all__ = ["MOST_OFFSET", "smooth_mesh"]

#: Waves of this many pixels and shorter go. Shorter ones leave steps of pixels; longer ones cost detail.
WAVE_PIXELS = 8.0
#: Degree of the filter's polynomial: how sharply waves are parted.
ROUNDS = 30
#: Edges of an isosurface are this long, in pixels, on the mean.
EDGE_PIXELS = 0.75
#: The filter's band for the shortest waves that a mesh has.
WIDEST_BAND = 1.9
#: The surface is moved at most by so many pixels to hold the slices' volume.
MOST_OFFSET = 0.5
#: Moves that hold it.
VOLUME_ROUNDS = 2
#: Vertices within this share of a level's height of where the scan ends are moved there before it cuts.
NEXT_TO_CUT = 0.2
#: Rounds in which lost voxels are given back, and how far around them in pixels the filter does less.
MENDING_ROUNDS, MENDED_PIXELS = 3, 3.0


def smooth_mesh(stack: SliceStack, wave: float | None = None) -> Mesh:
    r"""Mesh what the slices tell, without the steps of pixels and slices.

    Parameters
    ----------
    stack : SliceStack
    wave : float, optional
        Length in mm of the longest waves that are taken off; by default `WAVE_PIXELS`.

    Returns
    -------
    Mesh
        Closed, oriented outwards, in the plane's mm and height in mm; cut by planes where the scan ends.

    Notes
    -----
    A windowed sinc filter (Taubin, Zhang and Golub 1996). A wave of length :math:`w` is an eigenvector of the
    means over neighbours at a distance :math:`h`, with the value :math:`1 - (\pi h / w)^2`; what is taken
    from one there is the band.
    """
    distance, pixel = stack.distance, stack.pixel
    rough = without_small(distance.zero_surface(), stack)
    wave = WAVE_PIXELS * pixel if wave is None else wave
    band = min((np.pi * EDGE_PIXELS * pixel / max(wave, 1e-6)) ** 2, WIDEST_BAND)
    smooth = rough.low_passed(band, ROUNDS)
    if stack.held_volume is not None:
        smooth = _of_volume(smooth, stack.held_volume, distance)
    return _cut_at_ends(_mended(smooth, rough, stack), distance)


def _of_volume(mesh: Mesh, volume: float, distance: SampledDistance) -> Mesh:
    """Move a mesh along its normals until it holds a volume in mm^3, by no more than `MOST_OFFSET`."""
    moved, most = 0.0, MOST_OFFSET * distance.pixel
    for _ in range(VOLUME_ROUNDS):
        cut = _cut_at_ends(Mesh(mesh.vertices + moved * mesh.vertex_normals, mesh.faces), distance)
        wall = cut.area - float(cut.face_areas[on_caps(cut, distance.ends)].sum())
        moved = float(np.clip(moved + (volume - cut.volume) / max(wall, 1e-9), -most, most))
    return Mesh(mesh.vertices + moved * mesh.vertex_normals, mesh.faces)


def _mended(smooth: Mesh, rough: Mesh, stack: SliceStack) -> Mesh:
    """Go back towards the rough mesh where voxels of slices lie on the wrong side of the smooth one."""
    kept = np.zeros(len(rough.vertices))
    mesh, reach = smooth, MENDED_PIXELS * stack.pixel
    for _ in range(MENDING_ROUNDS):
        places, far = lost_voxels(_cut_at_ends(mesh, stack.distance), stack)
        if len(places) == 0:
            break
        away, nearest = cKDTree(places).query(rough.vertices)
        near = 1 - np.clip((away - far[nearest]) / reach, 0, 1)
        kept = np.maximum(kept, near * near * (3 - 2 * near))
        mesh = Mesh(smooth.vertices + kept[:, None] * (rough.vertices - smooth.vertices), rough.faces)
    return mesh


def without_small(mesh: Mesh, stack: SliceStack) -> Mesh:
    """Leave out a mesh's pieces that are too small, but for the largest."""
    pieces = sorted(mesh.pieces(), key=lambda piece: -abs(piece.volume))
    least = SHRUNK_PART * stack.smallest
    return Mesh.joined([piece for n, piece in enumerate(pieces) if n == 0 or abs(piece.volume) >= least])


def _cut_at_ends(mesh: Mesh, distance: SampledDistance) -> Mesh:
    """Cut a mesh by planes where the scan ends."""
    if not np.isfinite(distance.ends).any():
        return mesh
    vertices: FloatArray = mesh.vertices.copy()
    for end in distance.ends:
        vertices[np.abs(vertices[:, 2] - end) < NEXT_TO_CUT * distance.level_step, 2] = end
    cut = between_planes(Mesh(vertices, mesh.faces), *distance.ends)
    for end in distance.ends:
        cut.vertices[np.abs(cut.vertices[:, 2] - end) < 1e-9, 2] = end
    return cut
