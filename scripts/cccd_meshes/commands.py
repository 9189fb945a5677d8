"""What ``cccd surface`` does of a mesh, a solid, or contours in planes of several directions."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

from cccd.commands.arguments import settings_of
from cccd.commands.outputs import check_outputs, describe_surface, print_surfaces, write_with_band
from cccd.commands.surface import uniform
from cccd.errors import InputError
from cccd.files.write import format_of
from cccd_meshes.closed_meshes import drawn_planes
from cccd_meshes.read_meshes import is_mesh
from cccd_meshes.smooth import smooth_mesh


def make_surface_of_mesh(given: argparse.Namespace, outputs: Sequence[Path]) -> int | None:
    """Make a smooth surface of a mesh or of planes, or put it onto a scan's grid; None of another input."""
    if not _is_shape(given.input, given.label):
        return None
    labelled = bool(given.label) and not given.input.name.lower().endswith(".dcm")
    from_image = bool(given.seed) or given.threshold is not None
    voxels = (labelled, given.all_labels, given.boundary, from_image, given.band, given.samples is not None)
    if any(voxels):
        problem = "a mesh has no labels, grey values, boundary maps or error band"
        raise InputError(given.input.name, problem, "leave --label, --threshold and their like out")
    like = given.like or given.image
    settings = settings_of(given)
    check_outputs(outputs, [given.input, like])
    for path in outputs:
        if like is None and format_of(path) in {"nii.gz", "seg.dcm"}:
            raise InputError(str(path), "it needs the grid of a scan", "name the scan: --like ct.nii.gz")
    began = time.perf_counter()
    surface = uniform(smooth_mesh(given.input, like, label=given.label, settings=settings), given)
    files = [file for path in outputs for file in write_with_band(surface, path, settings, False)]
    made = describe_surface(surface, files, time.perf_counter() - began)
    print_surfaces(given, [made])
    return 0


def _is_shape(path: Path, label: str) -> bool:
    """Whether a file is a mesh, or contours in planes of several directions."""
    if is_mesh(path):
        return True
    try:
        return drawn_planes(path, label) is not None
    except InputError:
        return path.name.lower().endswith(".csl")
