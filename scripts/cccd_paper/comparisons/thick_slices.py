"""Thick slices: keep every n-th slice, reconstruct, compare with the full resolution."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from cccd.containers import Frame, Structure
from cccd.contours import trace_contours
from cccd.settings.surface import LoftSettings
from cccd.store import bodies_bytes
from cccd.surface.loft import loft_surface
from cccd_paper.comparisons.baselines.surfaces import FAMILIES
from cccd_paper.comparisons.timing import timed
from cccd_paper.comparisons.tuning import SAMPLES, Truth, tuned_rows
from cccd_paper.settings import ThickSliceSettings
from cccd_workflow.surface_measures import Reference, measure_mesh

#: Fewer slices with organ than this say nothing about a reconstruction.
FEWEST_SLICES = 3


def every_nth_slice(structure: Structure, n: int) -> Structure:
    """Keep every n-th slice of the mask as a structure of its own, with n times the slice spacing."""
    frame, axis = structure.frame, structure.frame.slice_axis
    first = int(-structure.origin[axis]) % n
    kept = np.moveaxis(structure.required_stack("mask")[first::n], 0, axis)
    affine = frame.affine.copy()
    affine[:, axis] *= n
    origin = np.array(structure.origin)
    origin[axis] = (origin[axis] + first) // n
    a, b, c = (-(-size // n) if along == axis else size for along, size in enumerate(frame.shape))
    return replace(
        structure, frame=Frame(affine, axis, (a, b, c)), origin=origin, mask=kept, image=None, truth=None
    )


def thick_slice_experiment(
    structure: Structure, settings: ThickSliceSettings, lofting: LoftSettings
) -> pd.DataFrame:
    """Reconstruct a structure from every n-th slice and measure against its full resolution.

    Parameters
    ----------
    structure : Structure
        With a mask; without one the table is empty.
    settings : ThickSliceSettings
        The slice distances.
    lofting : LoftSettings

    Returns
    -------
    DataFrame
        One row per slice distance and method, two for a tuned one (see `cccd_paper.comparisons.tuning`), with
        the columns of `measure_mesh`, processor ``seconds``, and for ours ``control_bytes``.
    """
    rows = []
    if structure.mask is None:
        return pd.DataFrame(rows)
    spacing = structure.frame.slice_spacing
    truth = Truth(Reference.of(structure))
    steps = sorted({max(2, round(distance / spacing)) for distance in settings.spacings_mm})
    for n in steps:
        thick = every_nth_slice(structure, n)
        if np.count_nonzero(thick.required_stack("mask").any(axis=(1, 2))) < FEWEST_SLICES:
            continue
        row = {"slice_distance_mm": n * spacing, "every_nth": n}
        rows += [row | measured for measured in _reconstructions(thick, structure, truth, lofting)]
    return pd.DataFrame(rows)


def _reconstructions(
    thick: Structure, structure: Structure, truth: Truth, lofting: LoftSettings
) -> Iterator[dict[str, Any]]:
    """Reconstruct thick slices by our way and by the baselines, each measured at full resolution."""
    surface, seconds = timed(lambda: loft_surface(thick.sections(trace_contours(thick)), lofting))
    ours = measure_mesh(surface.mesh, structure, reference=truth.reference, samples=SAMPLES)
    sizes = {"seconds": seconds, "control_bytes": bodies_bytes(surface.bodies)}
    yield {"method": "CCCD", "chosen": None, "setting": None, **ours, **sizes}
    for family in FAMILIES.values():
        if family.available():
            yield from tuned_rows(family, thick, structure, truth, ours["curvature_per_area_mm"])
