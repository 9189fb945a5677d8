"""``wall_splines.h5``: the spline through a case's walls, wall by wall."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cccd.containers import Frame
from cccd.geometry.subdivision import ControlMesh
from cccd.store import new_file, open_file, read_value, write_value
from cccd_walls.splines import WallSpline

#: Of the control mesh that all walls share: names in the file, and their types.
_SHARED = {"vertices": np.float64, "creases": np.int32, "crease_sharpness": np.float32, "corners": np.int32}


def write_spline(path: str | Path, spline: WallSpline, frame: Frame, report: Mapping[str, Any]) -> None:
    """Write the spline through the walls of a case.

    Parameters
    ----------
    path : path
    spline : WallSpline
        In mm RAS.
    frame : Frame
        The grid of the source volume.
    report : mapping
        Plain JSON about the fit.
    """
    control = spline.control
    arrays = (control.vertices, control.creases, control.sharpness, control.corners)
    names = ["", *spline.organs]
    with new_file(path) as file:
        write_value(file, "frame", frame, Frame)
        write_value(file, "report", report, dict[str, Any])
        write_value(file, "organs", list(spline.organs), list[str])
        write_value(file, "crossing", spline.crossing, int)
        write_value(file, "count", len(spline.regions), int)
        for (name, kind), array in zip(_SHARED.items(), arrays, strict=True):
            write_value(file, name, np.asarray(array, kind), np.ndarray)
        for number, (inside, outside) in enumerate(spline.regions.tolist()):
            group = file.create_group(f"walls/{number}")
            write_value(group, "organs", [names[inside], names[outside]], list[str])
            write_value(group, "quads", np.int32(control.quads[spline.wall == number]), np.ndarray)


def read_spline(path: str | Path) -> WallSpline:
    """Read what `write_spline` wrote."""
    with open_file(path) as file:
        organs: list[str] = read_value(file, "organs", list[str])
        crossing, count = read_value(file, "crossing", int), read_value(file, "count", int)
        vertices, creases, sharpness, corners = (read_value(file, name, np.ndarray) for name in _SHARED)
        walls = [file[f"walls/{number}"] for number in range(count)]
        quads = [read_value(wall, "quads", np.ndarray).astype(np.int64) for wall in walls]
        names = [read_value(wall, "organs", list[str]) for wall in walls]
    number = {name: n for n, name in enumerate(["", *organs])}
    control = ControlMesh(
        vertices,
        np.concatenate([*quads, np.zeros((0, 4), np.int64)]),
        creases.astype(np.int64),
        sharpness.astype(float),
        corners.astype(np.int64),
    )
    wall = np.repeat(np.arange(len(quads)), [len(part) for part in quads])
    regions = np.reshape([[number[name] for name in pair] for pair in names], (-1, 2)).astype(np.int64)
    return WallSpline(control, wall, regions, crossing, organs)
