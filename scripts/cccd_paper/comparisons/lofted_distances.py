"""The distances that our surface is lofted from as an isosurface: what its splines add to them, and lose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pyvista as pv

from cccd.containers import Frame, Sections, Structure
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import LoftSettings
from cccd.surface.fields import LevelField
from cccd.surface.outlines import lofted_outlines
from cccd.surface.stack import Run, interpolate_slices
from cccd.tracing import trace_mask
from cccd_paper.comparisons.volume_meshes import from_polydata

__all__ = ["lofted_distances"]


def lofted_distances(structure: Structure) -> Mesh:
    """Mesh the zero level of the signed distances between a mask's splines, by flying edges.

    They are those of `cccd.surface.stack`, by its default settings: with the learned filling where that acts.
    The organ ends half a slice distance beyond its last slice.

    Parameters
    ----------
    structure : Structure
        With a mask.

    Returns
    -------
    Mesh
        In world mm (RAS), outwards.
    """
    settings = LoftSettings()
    sections = Sections(trace_mask(structure))
    stack = interpolate_slices(lofted_outlines(sections, settings), sections, settings)
    parts = [_zero_level(run, stack.origin, structure.frame) for run in stack.runs]
    return Mesh.joined(parts).outwards()


def _zero_level(run: Run, origin: np.ndarray, frame: Frame) -> Mesh:
    levels = _mirrored_ends(run.fields, run.half_step)
    block = np.stack([np.pad(level.distance, 1, mode="edge") for level in levels], axis=-1)
    rows, columns = (np.arange(size) - 1.0 + first for size, first in zip(block.shape, origin, strict=False))
    grid = pv.RectilinearGrid(rows, columns, np.array([level.z for level in levels]))
    grid.point_data["distance"] = block.ravel(order="F")
    mesh = from_polydata(grid.contour([0.0], scalars="distance"))
    return Mesh(frame.to_world(mesh.vertices[:, :2], mesh.vertices[:, 2] / frame.slice_spacing), mesh.faces)


def _mirrored_ends(fields: Sequence[LevelField], half_step: float) -> list[LevelField]:
    """Levels with one more at either end, a slice distance beyond, on which nothing lies inside."""
    low, high = (
        replace(end, z=end.z + way * 2 * half_step, distance=np.abs(end.distance), source_slice=None)
        for way, end in ((-1, fields[0]), (1, fields[-1]))
    )
    return [low, *fields, high]
