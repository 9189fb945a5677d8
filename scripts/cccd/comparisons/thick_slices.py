"""Thick slices: keep every n-th slice, reconstruct, compare with the full resolution."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from cccd.chaincode import trace_mask
from cccd.comparisons.volume_meshes import distance_isosurface, flying_edges, windowed_sinc
from cccd.containers import Frame, Structure
from cccd.surface.loft import loft_surface
from cccd.surface.measure import measure_mesh

__all__ = ["every_nth_slice", "thick_slice_experiment"]

#: Fewer slices with organ than this say nothing about a reconstruction.
FEWEST_SLICES = 3


def every_nth_slice(structure: Structure, n: int) -> Structure:
    """Keep every n-th slice of the mask as a structure of its own, with n times the slice spacing."""
    frame, axis = structure.frame, structure.frame.slice_axis
    first = int(-structure.origin[axis]) % n
    kept = np.take(structure.mask, np.arange(first, structure.mask.shape[axis], n), axis=axis)
    affine = frame.affine.copy()
    affine[:, axis] *= n
    origin = np.array(structure.origin)
    origin[axis] = (origin[axis] + first) // n
    shape = tuple(-(-size // n) if a == axis else size for a, size in enumerate(frame.shape))
    return replace(
        structure, frame=Frame(affine, axis, shape), origin=origin, mask=kept, image=None, truth=None
    )


def thick_slice_experiment(structure: Structure, settings: Mapping) -> pd.DataFrame:
    """Reconstruct a structure from every n-th slice and measure against its full resolution.

    Parameters
    ----------
    structure : Structure
        With a mask; without one the table is empty.
    settings : mapping
        Section ``comparisons`` with ``thick_slices.spacings_mm``, and ``surface`` for the lofting.

    Returns
    -------
    DataFrame
        One row per slice distance and method, with the columns of `measure_mesh` and ``seconds``.
    """
    rows = []
    if structure.mask is None:
        return pd.DataFrame(rows)
    spacing = structure.frame.slice_spacing
    steps = sorted({max(2, round(wanted / spacing)) for wanted in settings["thick_slices"]["spacings_mm"]})
    for n in steps:
        thick = every_nth_slice(structure, n)
        if np.count_nonzero(thick.stack("mask").any(axis=(1, 2))) < FEWEST_SLICES:
            continue

        def ours(thick=thick):
            surface = loft_surface(trace_mask(thick), settings["surface"])
            return surface.vertices, surface.faces

        makers = {
            "CCCD": ours,
            "marching cubes + windowed sinc": lambda thick=thick: windowed_sinc(flying_edges(thick)),
            "signed distance + isosurface + windowed sinc": lambda thick=thick: windowed_sinc(
                distance_isosurface(thick)
            ),
        }
        for method, make in makers.items():
            start = time.perf_counter()
            mesh = make()
            seconds = time.perf_counter() - start
            row = {"slice_distance_mm": n * spacing, "every_nth": n, "method": method}
            rows.append({**row, **measure_mesh(*mesh, structure), "seconds": seconds})
    return pd.DataFrame(rows)
