"""The commands ``cccd centrelines``, ``hollow`` and ``lumen``."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tqdm import tqdm

import cccd
from cccd.commands import check_files, plain_stem
from cccd.console import clock, millilitres
from cccd.errors import InputError
from cccd_meshes.closed_meshes import read_closed_mesh
from cccd_meshes.read_meshes import is_mesh
from cccd_vessels.centrelines import find_centrelines
from cccd_vessels.ends import clear_ends, find_ends, opened
from cccd_vessels.files import check_suffix, describe, write_centrelines
from cccd_vessels.hollow import hollow_wall
from cccd_vessels.named import check_named, write_named

if TYPE_CHECKING:
    from cccd.geometry.mesh import Mesh


def _add_tube(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "input",
        type=Path,
        help="mask or label map, as in cccd surface, or a closed mesh (.stl .ply .vtp .step)",
    )
    command.add_argument(
        "--label", default="", help="value(s) of the label map, or the name of an organ, segment or ROI"
    )
    command.add_argument("--json", action="store_true", help="print JSON")


def _add_root(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--root", metavar="X,Y,Z",
        help="the free end nearest to this point (mm RAS) is the root, or the inlet; default: the widest end",
    )  # fmt: skip


def add_centrelines(command: argparse.ArgumentParser) -> None:
    """Find the centrelines of a tree of tubes, and measure each branch.

    Length, radius, diameters, tortuosity, curvature, angle to its parent.
    """
    _add_tube(command)
    _add_root(command)
    command.add_argument(
        "-o", "--output", type=Path, action="append", default=[], metavar="FILE",
        help="output file, repeatable: .csv (a row per branch), .vtp (lines), .swc (samples of a tree). "
        "Default: the input's name with _centrelines.csv, in this folder",
    )  # fmt: skip
    command.set_defaults(run=_centrelines)


def _add_named_output(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "-o", "--output", type=Path, action="append", required=True, metavar="FILE",
        help="output file, repeatable: .vtp, .stl (text), .obj (surface with named groups), .msh, .vtu, .inp "
        "(tetrahedra with named boundaries)",
    )  # fmt: skip


def add_hollow(command: argparse.ArgumentParser) -> None:
    """Make a closed solid with a cavity: a wall of one thickness, inwards or outwards from the surface.

    Groups: outer, inner.
    """
    _add_tube(command)
    command.add_argument("--thickness", type=float, required=True, metavar="MM", help="of the wall")
    command.add_argument(
        "--outwards",
        action="store_true",
        help="the input is the lumen: the wall lies around it; default: inside the input's surface",
    )
    command.add_argument(
        "--open-ends", action="store_true", help="cut the ends of tubes open; groups inlet, outlet_1, ..."
    )
    _add_root(command)
    _add_named_output(command)
    command.set_defaults(run=_hollow)


def add_lumen(command: argparse.ArgumentParser) -> None:
    """Cut each free end of a tube square to its centreline and close it by a flat cap.

    Groups: wall, inlet, outlet_1, ...
    """
    _add_tube(command)
    _add_root(command)
    _add_named_output(command)
    command.set_defaults(run=_lumen)


def _tube(given: argparse.Namespace) -> tuple[Mesh, float | None]:
    """Return the surface of what was given, and the smallest edge of a voxel; a mesh is taken as it is."""
    if is_mesh(given.input):
        if given.label:
            raise InputError(given.input.name, "a mesh has no labels", "leave --label out")
        mended = read_closed_mesh(given.input)
        _warn(mended.notes)
        return mended.mesh, None
    surface = cccd.reconstruct(cccd.read(given.input, given.label))
    _warn(surface.warnings)
    return surface.lofted.mesh, float(min(surface.lofted.frame.spacing))


def _warn(notes: Sequence[str]) -> None:
    for note in notes:  # beside a line that says what goes on
        tqdm.write(f"warning: {note}", file=sys.stderr)


def _root_of(given: argparse.Namespace) -> list[float] | None:
    if given.root is None:
        return None
    try:
        x, y, z = (float(part) for part in given.root.split(","))
    except ValueError:
        hint = "give X,Y,Z in mm RAS: --root=-12,30,55"
        raise InputError("--root", f"{given.root!r} is not a point", hint) from None
    return [x, y, z]


def _centrelines(given: argparse.Namespace) -> int:
    outputs = given.output or [Path(f"{plain_stem(given.input)}_centrelines.csv")]
    for path in outputs:
        check_suffix(path)
    check_files(outputs, [given.input])
    root = _root_of(given)
    with clock("centrelines"):
        mesh, voxel = _tube(given)
        found = find_centrelines(mesh, voxel, root, given.input.name)
    for path in outputs:
        write_centrelines(path, found)
    rows = [describe(branch) for branch in found.branches]
    if given.json:
        print(json.dumps({"input": str(given.input), "branches": rows, "notes": found.notes}, indent=2))
        return 0
    print(*outputs, sep="\n")
    print(f"{'branch':>8}{'parent':>8}{'length mm':>11}{'radius mm':>11}{'tortuosity':>12}{'angle deg':>11}")
    for row in rows:
        names = ("length_mm", "mean_radius_mm", "tortuosity", "angle_to_parent_deg")
        length, radius, tortuosity, angle = ("-" if row[n] is None else f"{row[n]:.2f}" for n in names)
        parent = row["parent"] or "-"
        print(f"{row['branch']:>8}{parent:>8}{length:>11}{radius:>11}{tortuosity:>12}{angle:>11}")
    for note in found.notes:
        print(f"note: {note}")
    return 0


def _hollow(given: argparse.Namespace) -> int:
    if not given.open_ends and given.root is not None:
        raise InputError(
            "--root", "without --open-ends nothing is cut", "add --open-ends, or leave --root out"
        )

    def walls(mesh: Mesh) -> list[tuple[Mesh, str]]:
        outer, inner = hollow_wall(mesh, given.thickness, given.outwards, given.input.name)
        return [(outer, "outer"), (inner, "inner")]

    return _cut(given, walls, given.open_ends)


def _lumen(given: argparse.Namespace) -> int:
    return _cut(given, lambda mesh: [(mesh, "wall")], True)


def _cut(given: argparse.Namespace, layers: Callable[[Mesh], list[tuple[Mesh, str]]], open_: bool) -> int:
    """Cut what bounds a solid open where asked for, write it, and print its groups."""
    for path in given.output:
        check_named(path)
    check_files(given.output, [given.input])
    root = _root_of(given)
    notes, ends = [], []
    with clock(given.command):
        mesh, voxel = _tube(given)
        bounds = layers(mesh)
        if open_:
            found = find_centrelines(mesh, voxel, root, given.input.name)
            ends, closed = clear_ends(bounds, find_ends(found, given.input.name))
            notes = [*found.notes, *closed]
        named = opened(bounds, ends, given.input.name)
    for path in given.output:
        write_named(path, named, plain_stem(given.input))
    areas = {name: round(named.group(name).area, 3) for name in named.names}
    volume = named.mesh.volume / 1000
    if given.json:
        made = {"input": str(given.input), "files": [str(path) for path in given.output]}
        made |= {"volume_ml": round(volume, 4), "areas_mm2": areas, "notes": notes}
        print(json.dumps(made, indent=2))
        return 0
    print(*given.output, sep="\n")
    print(f"  {millilitres(volume)}, {len(named.mesh.faces)} triangles")
    for name, area in areas.items():
        print(f"  {name}: {area:.1f} mm²")
    for note in notes:
        print(f"  note: {note}")
    return 0
