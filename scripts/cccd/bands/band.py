"""The band of a surface: how far inwards and outwards the true surface may lie, vertex by vertex."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from cccd.bands.calibration import Calibration
from cccd.bands.readers import Reader
from cccd.bands.signs import Slices, signs_of
from cccd.geometry.arrays import FloatArray
from cccd.geometry.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Band:
    """Where a share of the true surface lies, along the normals of a surface.

    Attributes
    ----------
    inner, outer : (V,) float64
        mm inwards and outwards from each vertex.
    share : float
        Of the surface that is covered, on the mean of organs like those of the calibration.
    volume_factor : float
        What ``inner`` and ``outer`` times the surface's area are multiplied by for the volume's interval.
    extrapolated : bool
        Whether the calibration knows no slices so far apart, or so near to each other.
    length_mm : float
        Over which errors are correlated along the surface.
    area_low, area_high, diameter_low, diameter_high : float
        By what the band's mean width is multiplied for the ends of these intervals.
    """

    inner: FloatArray
    outer: FloatArray
    share: float
    volume_factor: float
    extrapolated: bool
    length_mm: float = 1.0
    area_low: float = -1.0
    area_high: float = 1.0
    diameter_low: float = -1.0
    diameter_high: float = 1.0

    def volume_interval(self, mesh: Mesh) -> tuple[float, float]:
        """Lowest and highest volume in mm^3 of the band's mesh, for the same share."""
        area = mesh.vertex_areas
        low, high = (self.volume_factor * float(area @ side) for side in (self.inner, self.outer))
        return max(mesh.volume - low, 0.0), mesh.volume + high

    def warnings(self, ratio: float) -> list[str]:
        """Say so where the band is extrapolated; ``ratio``: distance between slices in pixels."""
        if not self.extrapolated:
            return []
        return [f"the error band is extrapolated: the calibration has no slices {ratio:.2g} pixels apart"]

    def inner_mesh(self, mesh: Mesh) -> Mesh:
        """Move the band's mesh inwards; it may pass through itself where the organ is thinner than that."""
        return Mesh(mesh.vertices - self.inner[:, None] * mesh.vertex_normals, mesh.faces)

    def outer_mesh(self, mesh: Mesh) -> Mesh:
        """Move the band's mesh outwards."""
        return Mesh(mesh.vertices + self.outer[:, None] * mesh.vertex_normals, mesh.faces)

    def moved_to(self, vertices: FloatArray, points: FloatArray) -> Band:
        """Return the band at other points (P, 3): that of the nearest of its ``vertices`` (V, 3)."""
        nearest = scipy.spatial.cKDTree(vertices).query(points)[1]
        return replace(self, inner=self.inner[nearest], outer=self.outer[nearest])


def estimate_band(
    mesh: Mesh,
    slices: Slices,
    share: float,
    calibration: Calibration,
    reader: Reader | None = None,
    doubt: FloatArray | None = None,
) -> Band:
    """Estimate the band of a surface that was lofted from slices.

    Parameters
    ----------
    mesh : Mesh
        In the plane's mm and height, as the slices are.
    slices : Slices
    share : float
        Of the surface that shall lie within.
    calibration : Calibration
    reader : Reader, optional
        The band then holds that share of another reader's border, too.
    doubt : (V,) float64, optional
        How far from the border, in mm, a network's probabilities are not certain: see `find_doubt`.

    Raises
    ------
    InputError
        The calibration has no factors for the share.
    """
    factor, volume_factor, length, extrapolated = calibration.factors(slices.ratio, share)
    between = factor * slices.pixel * calibration.lengths(signs_of(mesh, slices))
    width, swept = between, volume_factor / factor * between
    if doubt is not None:
        width, swept = np.hypot(width, doubt), np.hypot(swept, doubt)
    if reader is not None:
        beyond, together = reader.at(share)
        width, swept = np.hypot(width, beyond), np.hypot(swept, together)
    area = mesh.vertex_areas
    ratio = float(area @ swept) / max(float(area @ width), 1e-12)
    ends = [end / factor for name in ("area", "diameter") for end in calibration.span(name, share)]
    return Band(width, width, share, ratio, extrapolated, length * slices.pixel, *ends)
