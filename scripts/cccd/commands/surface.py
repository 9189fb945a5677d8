"""The command ``cccd surface``."""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cccd.commands.arguments import add_band, add_input, read_given, settings_of
from cccd.commands.outputs import check_outputs, describe_surface, plain_stem, print_surfaces, write_with_band
from cccd.errors import EarlyWarning, InputError
from cccd.extras import check_extra
from cccd.plugins import find, table

if TYPE_CHECKING:
    from cccd.api import Surface
    from cccd.settings.root import Settings

#: Processes for a whole map where nobody says: each may need a gigabyte.
_MOST_CORES = 4

_STEPS = ("reading", "contours", "splines", "surface", "writing")


def add_surface(command: argparse.ArgumentParser) -> None:
    """Make a smooth closed surface, and print its volume, its size and warnings."""
    add_input(command.add_argument_group("what is read"))
    written = command.add_argument_group("what is written")
    every = command.add_argument_group("all labels")
    shape = command.add_argument_group("the surface")
    written.add_argument(
        "-o", "--output", type=Path, action="append", default=[], metavar="FILE",
        help="output file, repeatable. The suffix chooses the format: .ply .stl .obj .vtp .gii .glb .3mf "
        "(mesh), .usd (spline), .step .iges .brep (solid), .msh .vtu .inp .feb (tetrahedra), .nii.gz (label "
        "map), .dcm .seg.dcm .stl.dcm (RTSTRUCT, SEG, encapsulated STL). Default: the input's name with .ply "
        "(with --seed: _seeded.ply, with --threshold: _threshold.ply), in this folder",
    )  # fmt: skip
    written.add_argument(
        "--like", type=Path, metavar="SCAN",
        help="the input is a mesh (.stl .ply .obj .glb .vtp .step) or contours in several directions (.csl): "
        "the scan on whose grid label maps lie",
    )  # fmt: skip
    every.add_argument(
        "--all-labels",
        action="store_true",
        help="a surface of every label; neighbours share their walls. A .glb is one scene of all",
    )
    every.add_argument(
        "--names", type=Path, metavar="TABLE",
        help="with --all-labels: names of the labels, lines of label,name below a header (.csv, .tsv), a "
        "FreeSurfer colour table, or a dataset.json",
    )  # fmt: skip
    every.add_argument(
        "--cores", type=int, default=min(os.cpu_count() or 1, _MOST_CORES), metavar="N",
        help="with --all-labels: processes at once, each with up to a gigabyte of memory; default: all "
        f"cores, at most {_MOST_CORES}",
    )  # fmt: skip
    every.add_argument(
        "--resume", action="store_true",
        help="with --all-labels, after a call that was interrupted: keep organs whose files are there",
    )  # fmt: skip
    add_band(written)
    written.add_argument(
        "--samples", type=int, metavar="N",
        help="also draw N surfaces as the true one may lie, NAME_1 to NAME_N, and print the intervals of "
        "volume, area and largest diameter; -o may be a folder",
    )  # fmt: skip
    shape.add_argument(
        "--reader", metavar="MM",
        help="widen the error band so that it also holds another reader's border: by how many mm two readers "
        "differ on the mean, or a file of cccd calibrate --readers",
    )  # fmt: skip
    shape.add_argument(
        "--smooth", type=float, metavar="MM",
        help="smooth away waves of this length and shorter; eight pixels by default",
    )  # fmt: skip
    written.add_argument("--triangles", type=int, metavar="N", help="as many triangles, of about one size")
    written.add_argument(
        "--edge-mm", type=float, metavar="MM", help="the mesh has triangles whose edges are about this long"
    )  # fmt: skip
    written.add_argument(
        "--materials", metavar="CSV",
        help="give tetrahedra elastic materials by the scan's grey values, from this table; needs --image",
    )  # fmt: skip
    shape.add_argument(
        "--configfile", type=Path, metavar="YAML",
        help="your own settings, for example 'surface: {tetrahedra: {elements: tet10}}'",
    )  # fmt: skip
    command.set_defaults(run=_surface)


def _surface(given: argparse.Namespace) -> int:
    from cccd.inputs.readers import without_suffix

    option = "--seed" if given.seed else "--threshold" if given.threshold is not None else None
    stem = plain_stem(given.input)
    if option:
        stem += {"--seed": "_seeded", "--threshold": "_threshold"}[option]
    outputs = given.output or [Path(f"{stem}.ply")]
    if given.samples is not None:
        outputs = [path if path.suffix and not path.is_dir() else path / f"{stem}.ply" for path in outputs]
    if given.input.is_file() and without_suffix(given.input.name) is None:
        code = find(table("OPTIONS")["mesh"])(given, given.output or [Path(f"{stem}_smooth.ply")])
        if code is not None:
            return code
    if given.like is not None:
        from cccd.inputs.load import existing

        name = existing(given.input, given.input.name).name
        raise InputError("--like", f"{name} is not a mesh", "leave it out; --image names the scan")
    if option and given.all_labels:
        raise InputError(option, "an image without a mask has no labels", "leave --all-labels out")
    if given.label and given.all_labels:
        raise InputError("--all-labels", "it already takes every label", "leave --label out")
    if given.names is not None and not given.all_labels:
        raise InputError("--names", "it names the labels of a whole map", "add --all-labels")
    if given.resume and not given.all_labels:
        raise InputError("--resume", "it continues a whole map", "add --all-labels")
    if given.cores < 1:
        raise InputError("--cores", f"{given.cores} is no number of processes", "give 1 or more")
    if given.samples is not None and given.all_labels:
        raise InputError("--samples", "neighbours that share a wall move together", "choose one --label")
    for option, value in (("--triangles", given.triangles), ("--edge-mm", given.edge_mm)):
        if value is not None and given.all_labels:
            raise InputError(option, "neighbours that share a wall keep its triangles", "choose one --label")
    if given.seed:
        check_extra("gnn", "--seed")
    settings = settings_of(given)
    check_outputs(outputs, [given.input, given.image])
    if given.all_labels:
        return find(table("OPTIONS")["all_labels"])(given, outputs, settings)
    print_surfaces(given, [_make_surface(given, outputs, settings)])
    return 0


def uniform(surface: Surface, given: argparse.Namespace) -> Surface:
    """Return the surface with the number of triangles, or the edges, that were asked for."""
    if given.triangles is None and given.edge_mm is None:
        return surface
    return surface.uniform(given.triangles, given.edge_mm)


def _make_surface(given: argparse.Namespace, files: Sequence[Path], settings: Settings) -> dict[str, Any]:
    """Make one surface and write it; what there is to say of it."""
    from tqdm import tqdm

    import cccd
    from cccd.api import check_references

    began = time.perf_counter()
    with tqdm(total=len(_STEPS), disable=None, leave=False, bar_format="{desc:<12}{bar:30} {elapsed}") as bar:

        def tell(step: str) -> None:
            bar.set_description_str(step)
            bar.update(_STEPS.index(step) - bar.n)

        tell("reading")
        structure = read_given(given, settings)
        check_references(files, structure)
        for note in structure.warnings:
            if isinstance(note, EarlyWarning):
                tqdm.write(f"warning: {note}", file=sys.stderr)
        surface = uniform(cccd.reconstruct(structure, settings=settings, progress=tell), given)
        tell("writing")
        samples = [] if given.samples is None else surface.samples(given.samples)
        files = [
            file for path in files for file in write_with_band(surface, path, settings, given.band, samples)
        ]
    made = describe_surface(surface, files, time.perf_counter() - began)
    return made | ({"intervals": surface.intervals} if samples else {})
