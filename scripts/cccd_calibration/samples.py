"""Closed surfaces drawn within an error band: they give the interval of any number."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.distance import pdist
from scipy.special import ndtri

from cccd.bands import Band
from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray
from cccd.geometry.mesh import Mesh

#: Plane waves that make up a field; with fewer it repeats itself within an organ.
WAVES = 96
#: Vertices whose waves are in memory at once.
AT_ONCE = 50_000


def draw_meshes(mesh: Mesh, band: Band, count: int, seed: int = 0) -> Iterator[Mesh]:
    """Draw closed meshes as the true surface may lie.

    Every vertex moves along its normal by a normally distributed length of which the band's share lies
    within the band. Neighbours move alike: the moves are correlated over `Band.length_mm`. A part of them is
    common to the whole organ, so that volumes spread as their interval says.

    Parameters
    ----------
    mesh : Mesh
        That the band is of, in mm.
    band : Band
    count : int
        1 or more.
    seed : int
        The same seed draws the same meshes.

    Yields
    ------
    Mesh
        With the faces of ``mesh``.

    Notes
    -----
    The field is a sum of plane waves whose wave vectors are normally distributed, which has a Gaussian
    correlation (Rahimi and Recht 2007, Random features for large-scale kernel machines). Its variance is one
    at every vertex.
    """
    if count < 1:
        raise InputError("samples", f"{count} surfaces cannot be drawn", "give a number from 1")
    rng = np.random.default_rng(seed)
    waves = (rng.standard_normal((3, WAVES)) / band.length_mm).astype(np.float32)
    common = min(band.volume_factor, 1.0)
    weights = rng.standard_normal((2 * WAVES, count)) * np.sqrt((1 - common**2) / WAVES)
    whole = rng.standard_normal(count) * common
    most = ndtri((1 + band.share) / 2)
    field = np.empty((len(mesh.vertices), count), np.float32)
    for start in range(0, len(field), AT_ONCE):
        phase = mesh.vertices[start : start + AT_ONCE].astype(np.float32) @ waves
        field[start : start + AT_ONCE] = np.hstack([np.cos(phase), np.sin(phase)]) @ weights + whole
    for off in field.T / most:
        moves = np.where(off > 0, band.outer, band.inner) * off
        yield Mesh(mesh.vertices + moves[:, None] * mesh.vertex_normals, mesh.faces)


def largest_diameter(vertices: FloatArray) -> float:
    """Largest distance between two of some points (V, 3).

    Examples
    --------
    >>> largest_diameter(np.array([(0.0, 0, 0), (3, 0, 0), (0, 4, 0), (0, 0, 1), (1, 1, 0)]))
    5.0
    """
    return float(pdist(vertices[ConvexHull(vertices).vertices]).max())


def intervals(mesh: Mesh, band: Band) -> dict[str, tuple[float, float]]:
    """Intervals of volume (ml), area (mm^2) and largest diameter (mm) for the band's share.

    Parameters
    ----------
    mesh : Mesh
        That the band is of, in mm.
    band : Band
    """
    width = float(mesh.vertex_areas @ (band.inner + band.outer)) / (2 * mesh.area)
    low, high = band.volume_interval(mesh)
    grows, diameter = mesh.area * mesh.curvature_per_area * width, largest_diameter(mesh.vertices)
    return {
        "volume_ml": (low / 1000, high / 1000),
        "area_mm2": (mesh.area + grows * band.area_low, mesh.area + grows * band.area_high),
        "diameter_mm": (diameter + width * band.diameter_low, diameter + width * band.diameter_high),
    }
