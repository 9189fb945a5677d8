"""What ``cccd surface`` does of a mesh, a solid, or contours in planes of several directions."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from pathlib import Path

from cccd.commands import (
    check_outputs,
    describe_surface,
    print_surfaces,
    settings_of,
    uniform,
    write_with_band,
)
from cccd.errors import InputError
from cccd.files import format_of
from cccd_meshes.closed_meshes import drawn_planes
from cccd_meshes.read_meshes import is_mesh
from cccd_meshes.smooth import smooth_mesh


def make_surface_of_mesh(given: argparse.Namespace, outputs: Sequence[Path]) -> int | None:
    """Make a smooth surface of a mesh or of planes, or put it onto a scan's grid; None of another input."""
    try:
        is_shape = is_mesh(given.input) or drawn_planes(given.input, given.label) is not None
    except InputError:
        is_shape = given.input.name.lower().endswith(".csl")  # a damaged one
    if not is_shape:
        return None
    labelled = given.label and not given.input.name.lower().endswith(".dcm")
    values = [value for value in (given.threshold, given.samples) if value is not None]
    if labelled or given.all_labels or given.boundary or given.seed or given.band or values:
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
    print_surfaces(given, [describe_surface(surface, files, time.perf_counter() - began)])
    return 0
