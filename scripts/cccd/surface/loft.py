"""Borders of slices -> distances on and between them -> zero level -> low pass -> spline -> checks."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from cccd.bands import Band, Calibration, Reader, Slices, estimate_band
from cccd.containers import Frame, ProbabilityStack, Sections
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import LoftSettings
from cccd.surface.spline import SplineSolid, loft_spline
from cccd.surface.stack import interpolate_slices
from cccd.surface.surface import LoftedSurface

#: With it 90 % of the readers' borders lie within the bands of the shipped segmenter's hippocampi, ten of
#: those that it was not trained on.
FACTOR = 0.87
#: Doubt counts up to so many mm before the factor.
MOST_DOUBT = 20.0


def loft_surface(sections: Sections, settings: LoftSettings) -> LoftedSurface:
    """Loft a stack of ordered curves.

    Parameters
    ----------
    sections : Sections
        The curves, and what else is known of the slices.
    settings : LoftSettings
        Section ``surface`` of the configuration.

    Raises
    ------
    InputError
        When there is no curve at all, or none goes around the centre of a pixel.
    """
    solid, frame = loft_in_plane(sections, settings), sections.curves.frame
    surface = solid.to_world(frame)
    doubt = find_doubt(solid.mesh, sections.probability, frame, solid.stack.origin, settings.band)
    surface.band = band_of(solid.mesh, solid.stack.slices, settings, doubt)
    surface.report["warnings"] += surface.band.warnings(solid.stack.slices.ratio)
    return surface


def loft_in_plane(sections: Sections, settings: LoftSettings) -> SplineSolid:
    """Loft as `loft_surface` does, in the plane's mm and height."""
    return loft_spline(interpolate_slices(sections, settings), settings.smoothing)


def band_of(mesh: Mesh, slices: Slices, settings: LoftSettings, doubt: FloatArray | None = None) -> Band:
    """Estimate a surface's error band as the settings say: see `cccd.bands.estimate_band`."""
    reader = None if settings.reader_mm is None else Reader.of(settings.reader_mm)
    return estimate_band(mesh, slices, settings.band, Calibration.read(settings.calibration), reader, doubt)


def find_doubt(
    mesh: Mesh, stack: ProbabilityStack | None, frame: Frame, origin: IntArray, share: float
) -> FloatArray | None:
    """How far in mm (V,) from a mesh probabilities reach that are less certain than a share.

    They fall from one half by half the share over this distance, if they fall on as they do at the vertex.
    It is multiplied by `FACTOR`. A border that is sharp gives a doubt of three quarters of a voxel.

    Parameters
    ----------
    mesh : Mesh
        In the plane's mm and height.
    stack : ProbabilityStack or None
    frame : Frame
        Of the source volume.
    origin : (2,) int64
        Source ``(i, j)`` of the plane's first pixel.
    share : float
        Of the border that shall lie within.

    Returns
    -------
    (V,) float64 or None
        None without probabilities.
    """
    if stack is None:
        return None
    voxel, first = np.array([frame.slice_spacing, *frame.pixel_spacing]), np.asarray(stack.origin, np.int64)
    places = mesh.vertices[:, [2, 0, 1]] / voxel - first + np.array([0, *origin])
    axes = [axis for axis in range(3) if stack.values.shape[axis] > 1]
    slopes = [
        ndimage.map_coordinates(
            np.gradient(stack.values, voxel[axis], axis=axis), places.T, order=1, mode="nearest"
        )
        for axis in axes
    ]
    steep = np.maximum(np.linalg.norm(slopes, axis=0), share / (2 * MOST_DOUBT))
    return FACTOR * share / 2 / steep
