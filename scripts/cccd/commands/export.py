"""The command ``cccd export``."""

from __future__ import annotations

import argparse
from pathlib import Path

from cccd.commands.arguments import add_band
from cccd.commands.outputs import check_outputs, with_name
from cccd.errors import InputError
from cccd.files.write import ExportOptions, write_surface
from cccd.store import read_drawn
from cccd.surface.surface import read_surface


def add_export(command: argparse.ArgumentParser) -> None:
    """Write a finished structure of the workflow in another format."""
    command.add_argument("input", type=Path, help="folder of a finished structure: results/CASE/ORGAN")
    command.add_argument(
        "-o", "--output", type=Path, action="append", required=True, metavar="FILE",
        help="output file, repeatable; the suffix chooses the format, as in cccd surface",
    )  # fmt: skip
    add_band(command)
    command.set_defaults(run=_export)


def _export(given: argparse.Namespace) -> int:
    folder = given.input.parent if given.input.is_file() else given.input  # a file of it will do
    splines, mesh = folder / "surface.h5", folder / "surface.ply"
    for path in (splines, mesh):
        if not path.is_file():
            raise InputError(
                str(path), "not there", "give the folder of a finished structure: results/CASE/ORGAN"
            )
    check_outputs(given.output, [mesh])
    surface, structure = read_surface(splines, mesh), folder / "structure.h5"
    drawn = read_drawn(structure) if structure.is_file() else None
    for path in given.output:
        sides = surface.sides() if given.band else {}
        moved = {with_name(path, side): of for side, of in sides.items()}
        for file, one in {path: surface, **moved}.items():
            write_surface(file, one, ExportOptions(folder.resolve().name, drawn=drawn))
            print(file)
    return 0
