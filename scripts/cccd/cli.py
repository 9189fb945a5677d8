"""The command ``cccd``: surfaces from files in one process, and the workflow from anywhere.

Whatever is slow to load is imported by the command that needs it, so that ``cccd --help`` is there at once.
"""

from __future__ import annotations

import argparse
import errno
import json
import os
import re
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cccd.console import clock, millilitres
from cccd.errors import TAKEN_TOGETHER, InputError
from cccd.extras import check_extra, missing_extra

if TYPE_CHECKING:
    from cccd.api import Surface
    from cccd.containers import Structure
    from cccd.geometry.mesh import Mesh
    from cccd.inputs.regions import DrawnLabels
    from cccd.inputs.row_files import RowFiles
    from cccd.settings.root import Settings
    from cccd_labels.label_survey import SurveyedLabel
    from cccd_labels.whole_map import LabelSurface

__all__ = ["main"]

#: What nibabel's letters of the axes stand for.
_TOWARDS = {"R": "right", "L": "left", "A": "anterior", "P": "posterior", "S": "superior", "I": "inferior"}

#: What is said of triangles of one size.
_UNIFORM = ("edge_mm", "chord_error_mm")

#: Processes for a whole map where nobody says: each may need a gigabyte.
_MOST_CORES = 4

#: What is shown while the labels of a map are made: which one, how much is done, how long it takes yet.
_ALL_BAR = "{desc:<32} {percentage:3.0f}% {bar:20} {elapsed}, {remaining} left"

_STEPS = ("reading", "contours", "splines", "surface", "writing")

_EXAMPLES = """\
examples:
  cccd surface liver.nii.gz                     liver.ply, from a mask
  cccd surface labels.nii.gz --label 5 -o liver.stl -o liver.step
  cccd surface labels.nii.gz --all-labels       one file for each label
  cccd surface dicom_folder/ --label Liver      a series with its RTSTRUCT or SEG
  cccd surface ct.nii.gz --seed 120,88,40       the organ around a voxel of an image without a mask
  cccd surface ct.nii.gz --threshold 150:       what is bright in an image without a mask
  cccd surface mesh.stl --like ct.nii.gz -o mask.nii.gz     a mesh on a scan's grid
  cccd segment mr.nii.gz --segmenter hippocampus    labels and surface, from a scan without a mask
  cccd check labels.nii.gz                      what is in it: axes, spacing, labels, a picture
  cccd compare a.stl b.nii.gz --json            Dice, distances, normals of two surfaces or masks
  cccd centrelines airway.nii.gz -o tree.csv    branches: length, radius, angles
  cccd hollow aorta.nii.gz --thickness 2 -o wall.stl    a wall around a lumen or inside a surface
  cccd lumen aorta.nii.gz -o lumen.msh          ends cut square, inlet and outlets named, for flow
  cccd run sheet.tsv --cores 8                  a cohort, with tables and a report
  cccd run bids/ out/ participant               the masks of a BIDS data set
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code: 0, 1 where the input is at fault, 130 or 143 when interrupted.

    Parameters
    ----------
    arguments : sequence of str, optional
        Those of the process by default.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    cut = given.index("--") if "--" in given else len(given)
    parser = _parser()
    parsed = parser.parse_args(_with_ranges_joined(given[:cut]))
    if parsed.command is None:
        parser.print_help()
        return 0
    parsed.further = given[cut + 1 :]
    before = _take_sigterm()
    try:
        if parsed.further and parsed.command != "run":
            raise InputError("--", "only cccd run passes arguments to Snakemake", "leave them out")
        with warnings.catch_warnings():  # of Python; commands say it themselves, in one line
            warnings.filterwarnings("ignore", f".*{TAKEN_TOGETHER}")
            return parsed.run(parsed)
    except InputError as error:
        return _fail(str(error))
    except ModuleNotFoundError as error:
        return _fail(str(missing_extra(error, f"cccd {parsed.command}")))
    except MemoryError:
        return _fail("out of memory; crop the scan to the organ, or use a larger machine")
    except KeyboardInterrupt as error:
        return _fail("interrupted; no half-written file is left", 128 + (*error.args, signal.SIGINT)[0])
    except OSError as error:
        if error.errno == errno.EPIPE:  # the reader of our output has gone
            return 1
        return _fail(
            f"{error.filename or 'file'}: {error.strerror or error}; check the folder's rights and space"
        )
    finally:
        if before is not None:
            signal.signal(signal.SIGTERM, before)


def _take_sigterm() -> Any:
    """Let SIGTERM do what Ctrl-C does, and take half-written files away; give the handler before."""
    if threading.current_thread() is not threading.main_thread():
        return None

    def interrupt(number: int, _: object) -> None:
        raise KeyboardInterrupt(number)

    return signal.signal(signal.SIGTERM, interrupt)


def _with_ranges_joined(words: Sequence[str]) -> list[str]:
    """Join ``--threshold`` and its range: argparse takes -200:0 for an option, and any file for a range."""
    joined: list[str] = []
    for word in words:
        if joined and joined[-1] == "--threshold":
            joined[-1] += f"={word}" if re.fullmatch(r"[-+.:e\d]*[\d:][-+.:e\d]*", word) else "="
            if joined[-1] != "--threshold=":
                continue
        joined.append(word)
    return joined


def _fail(line: str, code: int = 1) -> int:
    print(f"Error: {' '.join(line.split())}", file=sys.stderr)
    return code


# the arguments --------------------------------------------------------------------------------------


def _parser() -> argparse.ArgumentParser:
    from cccd import __version__

    parser = argparse.ArgumentParser(
        prog="cccd",
        description="Smooth, watertight spline surfaces of organs from stacks of CT and MR slices.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"cccd {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="command")
    _add_surface(commands)
    _add_segment(commands)
    _add_check(commands)
    _add_compare(commands)
    _add_centrelines(commands)
    _add_hollow(commands)
    _add_lumen(commands)
    _add_run(commands)
    _add_export(commands)
    _add_report(commands)
    _add_relabel(commands)
    _add_next(commands)
    _add_calibrate(commands)
    doctor = commands.add_parser(
        "doctor",
        help="report what is installed and works",
        description="Report what is installed and works: extras, GPU, off-screen drawing, CAD.",
    )
    doctor.add_argument("--json", action="store_true", help="print JSON")
    doctor.set_defaults(run=_doctor)
    return parser


#: A parser, or a group of its arguments.
_Arguments = argparse.ArgumentParser | argparse._ArgumentGroup  # pyright: ignore[reportPrivateUsage]


def _add_input(command: _Arguments) -> None:
    command.add_argument(
        "input",
        type=Path,
        help="mask or label map (NIfTI, NRRD, MHA), DICOM SEG or RTSTRUCT, or a folder: a DICOM series, "
        "a SEG or RTSTRUCT with its series, or a mask per organ",
    )
    command.add_argument(
        "--label",
        default="",
        help="value(s) of the label map (5 or 10,11), or the name of an organ, segment or ROI",
    )
    command.add_argument("--image", type=Path, help="the scan, if it is in another file or folder")
    command.add_argument(
        "--threshold", nargs="?", const="", metavar="LOW:HIGH",
        help="the input is an image without a mask: take the largest piece whose grey values lie in a range, "
        "150: or -1000:-400. Without a range, Otsu's method chooses one. A threshold does not find organs",
    )  # fmt: skip
    command.add_argument(
        "--seed", action="append", default=[], metavar="I,J,K",
        help="the input is an image without a mask: the organ is around this voxel, or this box "
        "(110:130,80:96,38:42), of indices from 0; repeatable, as for two lungs. Needs the extra gnn",
    )  # fmt: skip
    command.add_argument(
        "--boundary", action="store_true", help="the input contains boundary maps, which the network orders"
    )
    command.add_argument(
        "--annotated",
        default="auto",
        metavar="RULE",
        help="which slices of the mask are annotated: auto (default; decides by the gaps), nonempty, or "
        "'every slice'. The others are filled",
    )
    command.add_argument("--json", action="store_true", help="print JSON")


def _add_surface(commands: Any) -> None:
    surface = commands.add_parser(
        "surface",
        help="make a surface of one organ, or of every label",
        description="Make a smooth closed surface, and print its volume, its size and warnings.",
    )
    _add_input(surface.add_argument_group("what is read"))
    written = surface.add_argument_group("what is written")
    every = surface.add_argument_group("all labels")
    shape = surface.add_argument_group("the surface")
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
    _add_band(written)
    shape.add_argument(
        "--smooth", type=float, metavar="MM",
        help="smooth away waves of this length and shorter; eight pixels by default",
    )  # fmt: skip
    written.add_argument(
        "--triangles", type=int, metavar="N", help="the mesh has N triangles of about one size"
    )  # fmt: skip
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
    surface.set_defaults(run=_surface)


def _add_band(command: _Arguments) -> None:
    command.add_argument(
        "--band", action="store_true",
        help="also write the inner and outer surface of the error band, as NAME_inner and NAME_outer",
    )  # fmt: skip


def _add_segment(commands: Any) -> None:
    segment = commands.add_parser(
        "segment",
        help="find an organ in a scan without a mask, and make its surface",
        description="Find an organ with a trained network. Writes its labels on the scan's own grid, and one "
        "surface of all labels.",
    )
    segment.add_argument("input", type=Path, help="scan (NIfTI, NRRD, MHA) or the folder of a DICOM series")
    segment.add_argument(
        "--segmenter", required=True, metavar="WEIGHTS",
        help="weights (model.pt, or shipped: hippocampus), totalsegmentator, or nnunetv2:FOLDER",
    )  # fmt: skip
    segment.add_argument("--organ", help="what to look for; default: what the weights were trained to find")
    segment.add_argument(
        "-o", "--output", type=Path, action="append", default=[], metavar="FILE",
        help="the surface, repeatable, as in cccd surface; default: the scan's name with .ply",
    )  # fmt: skip
    segment.add_argument(
        "--labels",
        type=Path,
        metavar="FILE",
        help="the label map; default: the scan's name with _labels.nii.gz, in this folder",
    )
    segment.add_argument(
        "--device",
        choices=["auto", "cpu", "cuda"],
        help="where the network runs; default: a GPU if there is one",
    )
    segment.add_argument("--json", action="store_true", help="print JSON")
    segment.set_defaults(run=_segment)


def _add_check(commands: Any) -> None:
    check = commands.add_parser(
        "check",
        help="report what an input contains, and draw it",
        description="Read the input, report how it was understood (grid, axes, spacing, labels, cut ends), "
        "and draw it. A cohort sheet (.tsv) is read row by row.",
    )
    _add_input(check)
    check.add_argument(
        "-o",
        "--output",
        type=Path,
        metavar="PNG",
        help="the picture; default: NAME_check.png in this folder, "
        "of a sheet's rows in the folder SHEET_check",
    )
    check.set_defaults(run=_check)


def _add_compare(commands: Any) -> None:
    from cccd.limits import LIMITS, TOLERANCE_MM

    compare = commands.add_parser(
        "compare",
        help="compare two surfaces, masks or label maps",
        description="Measure how far two surfaces, masks or label maps agree, label by label. Inputs: meshes "
        "(PLY, STL, OBJ, GLB, VTP, GIfTI), surface.h5, solids (STEP, IGES, BREP), masks, label maps, DICOM "
        "SEG and RTSTRUCT. Exits with 1 if a limit is missed.",
    )
    compare.add_argument("first", type=Path, metavar="A")
    compare.add_argument("second", type=Path, metavar="B")
    compare.add_argument(
        "--label", action="append", default=[], metavar="LABEL",
        help="compare only this label; if A and B use different labels, give both, that of A first",
    )  # fmt: skip
    compare.add_argument(
        "--tolerance", type=float, default=TOLERANCE_MM, metavar="MM",
        help=f"surfaces this near to each other agree, for the surface Dice; default: {TOLERANCE_MM:g} mm",
    )  # fmt: skip
    compare.add_argument(
        "-o", "--output", type=Path, action="append", default=[], metavar="FILE",
        help="output file, repeatable: .glb, .vtp: A's surface coloured by its distance to B; .html: a page",
    )  # fmt: skip
    for figure, limit in LIMITS.items():
        compare.add_argument(
            f"--{limit.option}", type=float, dest=figure, metavar=limit.unit, help=limit.help
        )
    compare.add_argument("--json", action="store_true", help="print JSON")
    compare.set_defaults(run=_compare)


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


def _add_centrelines(commands: Any) -> None:
    lines = commands.add_parser(
        "centrelines",
        help="centrelines, radii and angles of a vessel, an airway or a duct",
        description="Find the centrelines of a tree of tubes, and measure each branch: length, radius, "
        "diameters, tortuosity, curvature, angle to its parent.",
    )
    _add_tube(lines)
    _add_root(lines)
    lines.add_argument(
        "-o", "--output", type=Path, action="append", default=[], metavar="FILE",
        help="output file, repeatable: .csv (a row per branch), .vtp (lines), .swc (samples of a tree). "
        "Default: the input's name with _centrelines.csv, in this folder",
    )  # fmt: skip
    lines.set_defaults(run=_centrelines)


def _add_named_output(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "-o", "--output", type=Path, action="append", required=True, metavar="FILE",
        help="output file, repeatable: .vtp, .stl (text), .obj (surface with named groups), .msh, .vtu, .inp "
        "(tetrahedra with named boundaries)",
    )  # fmt: skip


def _add_hollow(commands: Any) -> None:
    hollow = commands.add_parser(
        "hollow",
        help="a wall of one thickness, as of a vessel or a print",
        description="Make a closed solid with a cavity: a wall of one thickness, inwards or outwards from "
        "the surface. Groups: outer, inner.",
    )
    _add_tube(hollow)
    hollow.add_argument("--thickness", type=float, required=True, metavar="MM", help="of the wall")
    hollow.add_argument(
        "--outwards",
        action="store_true",
        help="the input is the lumen: the wall lies around it; default: inside the input's surface",
    )
    hollow.add_argument(
        "--open-ends", action="store_true", help="cut the ends of tubes open; groups inlet, outlet_1, ..."
    )
    _add_root(hollow)
    _add_named_output(hollow)
    hollow.set_defaults(run=_hollow)


def _add_lumen(commands: Any) -> None:
    lumen = commands.add_parser(
        "lumen",
        help="cut the ends of a vessel square and name them, for flow",
        description="Cut each free end of a tube square to its centreline and close it by a flat cap. "
        "Groups: wall, inlet, outlet_1, ...",
    )
    _add_tube(lumen)
    _add_root(lumen)
    _add_named_output(lumen)
    lumen.set_defaults(run=_lumen)


def _add_run(commands: Any) -> None:
    run = commands.add_parser(
        "run",
        help="run the whole workflow on a cohort",
        description="Run the workflow on a cohort sheet or on the masks of a BIDS data set. Arguments after "
        "-- go to Snakemake: -- surfaces, -- results/anna/liver/surface.ply, -- --config seed=7",
    )
    run.add_argument("input", type=Path, help="cohort sheet (.tsv), or the folder of a BIDS data set")
    run.add_argument("output", type=Path, nargs="?", help="BIDS: folder of the results")
    run.add_argument("level", nargs="?", choices=["participant"], help="BIDS: the level of the analysis")
    run.add_argument(
        "--participant-label", nargs="+", default=[], metavar="LABEL", help="BIDS: only these participants"
    )
    run.add_argument(
        "--cores", type=int, default=os.cpu_count() or 1, help="jobs at once; default: all cores"
    )
    run.add_argument("--directory", type=Path, help="folder for results/; default: this folder")
    run.add_argument("--profile", help="slurm, generic, or the folder of a Snakemake profile")
    run.add_argument(
        "--configfile", type=Path, metavar="YAML", help="your own settings, for example 'compare: true'"
    )
    run.add_argument(
        "-k", "--keep-going", action="store_true", help="finish the other structures where one fails"
    )
    run.add_argument("-n", "--dry-run", action="store_true", help="show what would run, and run nothing")
    run.set_defaults(run=_run)


def _add_export(commands: Any) -> None:
    export = commands.add_parser(
        "export",
        help="write a finished structure of the workflow in another format",
        description="Write a finished structure of the workflow in another format.",
    )
    export.add_argument("input", type=Path, help="folder of a finished structure: results/CASE/ORGAN")
    export.add_argument(
        "-o", "--output", type=Path, action="append", required=True, metavar="FILE",
        help="output file, repeatable; the suffix chooses the format, as in cccd surface",
    )  # fmt: skip
    _add_band(export)
    export.set_defaults(run=_export)


def _add_report(commands: Any) -> None:
    report = commands.add_parser(
        "report",
        help="build the report of all finished structures again",
        description="Build the report of all finished structures again.",
    )
    report.add_argument(
        "input",
        type=Path,
        nargs="?",
        default=Path("results"),
        help="folder of the results; default: results",
    )
    report.add_argument(
        "-o", "--output", type=Path, metavar="HTML", help="the page; default: report.html in that folder"
    )
    report.set_defaults(run=_report)


def _add_relabel(commands: Any) -> None:
    relabel = commands.add_parser(
        "relabel",
        help="a label map on finer, cubic or any other voxels, without stairs",
        description="Make the surfaces of all labels and fill the voxels of another grid: labels never "
        "overlap. Labels too small for a surface get their nearest voxels.",
    )
    relabel.add_argument("input", type=Path, help="label map")
    relabel.add_argument("--voxel", type=float, metavar="MM", help="edge of cubic voxels")
    relabel.add_argument("--like", type=Path, metavar="SCAN", help="a scan whose grid is taken")
    relabel.add_argument("--soft", action="store_true", help="also the share of each voxel, a file per label")
    relabel.add_argument("--cores", type=int, default=1, metavar="N", help="processes at once; default: 1")
    relabel.add_argument(
        "-o", "--output", type=Path, required=True, metavar="NIFTI", help="label map, .nii or .nii.gz"
    )
    relabel.set_defaults(run=_relabel)


def _add_next(commands: Any) -> None:
    following = commands.add_parser(
        "next",
        help="name the slice to annotate next",
        description="Rank the slices of a partly annotated mask by how much annotating one is expected to "
        "lower the error of the surface.",
    )
    _add_input(following)
    following.set_defaults(run=_next)


def _add_calibrate(commands: Any) -> None:
    calibrate = commands.add_parser(
        "calibrate",
        help="calibrate the error bands on your own masks",
        description="Thin dense masks, loft them, and find by how much the error bands must be widened. Use "
        "the result as surface: {calibration: FILE}.",
    )
    calibrate.add_argument("input", type=Path, help="cohort sheet (.tsv) of masks that have every slice")
    calibrate.add_argument(
        "-o", "--output", type=Path, default=Path("calibration.json"), metavar="JSON",
        help="default: calibration.json in this folder",
    )  # fmt: skip
    calibrate.set_defaults(run=_calibrate)


# cccd surface ---------------------------------------------------------------------------------------


def _surface(given: argparse.Namespace) -> int:
    from cccd.inputs.zarr_labels import is_zarr

    if is_zarr(given.input):
        return _surface_of_zarr(given)
    option = "--seed" if given.seed else "--threshold" if given.threshold is not None else None
    stem = _plain_stem(given.input)
    if option:
        stem += {"--seed": "_seeded", "--threshold": "_threshold"}[option]
    outputs = given.output or [Path(f"{stem}.ply")]
    if _is_shape(given.input, given.label):
        return _surface_of_mesh(given, given.output or [Path(f"{stem}_smooth.ply")])
    if given.like is not None:
        raise InputError(
            "--like", f"{given.input.name} is not a mesh", "leave it out; --image names the scan"
        )
    if option and given.all_labels:
        raise InputError(option, "an image without a mask has no labels", "leave --all-labels out")
    if given.label and given.all_labels:
        raise InputError("--all-labels", "it already takes every label", "leave --label out")
    if given.names is not None and not given.all_labels:
        raise InputError("--names", "it names the labels of a whole map", "add --all-labels")
    if given.cores < 1:
        raise InputError("--cores", f"{given.cores} is no number of processes", "give 1 or more")
    for option, value in (("--triangles", given.triangles), ("--edge-mm", given.edge_mm)):
        if value is not None and given.all_labels:
            raise InputError(option, "neighbours that share a wall keep its triangles", "choose one --label")
    if given.seed:
        check_extra("gnn", "--seed")
    settings = _settings_of(given)
    _check_outputs(outputs, [given.input, given.image])
    if given.all_labels:
        return _make_all_surfaces(given, outputs, settings)
    _print_surfaces(given, [_make_surface(given, given.label, outputs, settings)])
    return 0


def _is_shape(path: Path, label: str) -> bool:
    """Whether a file is a mesh, or contours in planes of several directions."""
    from cccd.closed_meshes import drawn_planes
    from cccd.files.read_meshes import is_mesh

    if not path.is_file() or is_mesh(path):
        return path.is_file()
    try:
        return drawn_planes(path, label) is not None
    except InputError:
        return path.name.lower().endswith(".csl")


def _surface_of_mesh(given: argparse.Namespace, outputs: Sequence[Path]) -> int:
    """Make a smooth surface of a mesh, or put it onto a scan's grid."""
    import cccd
    from cccd.files.write import format_of

    labelled = bool(given.label) and not given.input.name.lower().endswith(".dcm")
    from_image = bool(given.seed) or given.threshold is not None
    voxels = (labelled, given.all_labels, given.boundary, from_image, given.band)
    if any(voxels):
        problem = "a mesh has no labels, grey values, boundary maps or error band"
        raise InputError(given.input.name, problem, "leave --label, --threshold and their like out")
    like = given.like or given.image
    settings = _settings_of(given)
    _check_outputs(outputs, [given.input, like])
    for path in outputs:
        if like is None and format_of(path) in {"nii.gz", "seg.dcm"}:
            raise InputError(str(path), "it needs the grid of a scan", "name the scan: --like ct.nii.gz")
    began = time.perf_counter()
    surface = _uniform(cccd.smooth_mesh(given.input, like, label=given.label, settings=settings), given)
    files = [file for path in outputs for file in _write(surface, path, settings, False)]
    made = _describe_surface(surface, files, time.perf_counter() - began)
    _print_surfaces(given, [made])
    return 0


def _surface_of_zarr(given: argparse.Namespace) -> int:
    """Make a surface of a label in an OME-Zarr."""
    import cccd
    from cccd.inputs.zarr_labels import open_zarr

    other = (
        *(given.all_labels, given.boundary, given.threshold is not None, given.image, given.like),
        *(given.seed, given.triangles, given.edge_mm),
    )
    if any(other):
        problem = "an OME-Zarr is read as a label map, one label at a time"
        raise InputError(given.input.name, problem, "give --label, and leave --all-labels and its like out")
    stem = given.input.absolute().name.removesuffix(".zarr").removesuffix(".ome") or "surface"
    outputs = given.output or [Path(f"{stem}.ply")]
    settings = _settings_of(given)
    _check_outputs(outputs, [])
    labels = open_zarr(given.input)
    began = time.perf_counter()
    surface = cccd.reconstruct(labels.whole(given.label), labels.affine, settings=settings)
    files = [file for path in outputs for file in _write(surface, path, settings, given.band)]
    made = _describe_surface(surface, files, time.perf_counter() - began)
    _print_surfaces(given, [made | {"organ": stem}])
    return 0


def _uniform(surface: Surface, given: argparse.Namespace) -> Surface:
    """Return the surface with the number of triangles, or the edges, that were asked for."""
    if given.triangles is None and given.edge_mm is None:
        return surface
    return surface.uniform(given.triangles, given.edge_mm)


def _plain_stem(path: Path) -> str:
    from cccd.api import name_of

    return name_of(path.absolute())


def _threshold_of(given: argparse.Namespace) -> bool | tuple[float | None, float | None]:
    """Return what `cccd.read` takes as threshold."""
    if not given.threshold:
        return given.threshold is not None
    try:
        low, high = (float(end) if end else None for end in given.threshold.split(":"))
    except ValueError:
        hint = "give LOW:HIGH, as 150: or -1000:-400"
        raise InputError("--threshold", f"{given.threshold!r} is not a range", hint) from None
    return low, high


def _settings_of(given: argparse.Namespace) -> Settings:
    """Return the defaults, or those with the keys of the file that was given."""
    from cccd.settings.root import Settings
    from cccd.settings.validation import read_config

    settings = read_config(given.configfile) if given.configfile else Settings()
    if given.smooth is not None:
        if not 0 < given.smooth <= 1000:
            raise InputError("--smooth", f"{given.smooth:g} is no length in mm", "give a number up to 1000")
        smoother = settings.surface.model_copy(update={"smoothing": given.smooth})
        settings = settings.model_copy(update={"surface": smoother})
    return settings if given.materials is None else _with_materials(settings, given)


def _with_materials(settings: Settings, given: argparse.Namespace) -> Settings:
    """Return settings with the table that was named, provided that something is made of it."""
    from cccd.files.write import format_of
    from cccd.settings.formats import TETRAHEDRA_FORMATS
    from cccd_tetrahedra.materials import read_table

    if not any(format_of(path) in TETRAHEDRA_FORMATS for path in given.output):
        hint = f"write one of {', '.join(f'.{form}' for form in TETRAHEDRA_FORMATS)}"
        raise InputError("--materials", "no output has tetrahedra", hint)
    read_table(given.materials)
    tetrahedra = settings.surface.tetrahedra.model_copy(update={"materials": given.materials})
    surface = settings.surface.model_copy(update={"tetrahedra": tetrahedra})
    return settings.model_copy(update={"surface": surface})


def _check_outputs(outputs: Sequence[Path], sources: Sequence[Path | None]) -> None:
    """Refuse surfaces that could not be written before anything is computed."""
    from cccd.files.write import check_format

    for path in outputs:
        check_format(path)
    _check_files(outputs, sources)


def _check_files(outputs: Sequence[Path], sources: Sequence[Path | None]) -> None:
    """Refuse files that cannot be written, or that hold what is read."""
    absolute = [path.absolute() for path in outputs]
    for path in outputs:
        if absolute.count(path.absolute()) > 1:
            raise InputError(str(path), "named twice as output", "name it once")
        if path.is_dir():
            raise InputError(str(path), "that is a folder", "give the name of a file in it")
        if any(source is not None and _is_read(path, source) for source in sources):
            raise InputError(str(path), "that is the input", "give another name")
        _check_writable(path)


def _is_read(path: Path, source: Path) -> bool:
    """Whether a file is an input, or one of the volumes and images in a folder that is."""
    from cccd.dicom_objects import dicom_modality
    from cccd.inputs.readers import without_suffix

    if not path.is_file() or not source.exists():
        return False
    if not source.is_dir():
        return path.samefile(source)
    inside = source.resolve() in path.resolve().parents
    return inside and (without_suffix(path.name) is not None or dicom_modality(path) is not None)


def _check_writable(path: Path) -> None:
    from cccd.store import check_writable

    check_writable(path)


def _with_name(path: Path, organ: str) -> Path:
    """Put the name of an organ before a file's suffix."""
    from cccd.files.write import format_of

    suffix = f".{format_of(path)}"
    return path.with_name(f"{path.name[: -len(suffix)]}_{organ}{suffix}")


def _make_all_surfaces(given: argparse.Namespace, outputs: Sequence[Path], settings: Settings) -> int:
    """Make a surface of every label, and write and report each when it is ready: the exit status."""
    from tqdm import tqdm

    from cccd.console import OrganLines
    from cccd.files.write import format_of
    from cccd.surface.between import near_pairs
    from cccd_labels.whole_map import WholeMap

    scenes = [path for path in outputs if format_of(path) == "glb"]
    with tqdm(disable=None, leave=False, bar_format="{desc:<40} {elapsed}") as bar:
        bar.set_description_str("reading")
        whole = WholeMap.read(given.input, given.names, given.image, given.annotated, settings)
    if note := whole.check_memory(given.cores):
        print(f"{note} ...", file=sys.stderr)
    voxels, told = whole.voxels, 0
    made: dict[int, dict[str, Any]] = {}
    found: dict[int, LabelSurface] = {}
    lines = OrganLines(voxels)
    with tqdm(total=sum(voxels.values()), disable=None, leave=False, bar_format=_ALL_BAR) as bar:

        def tell(what: str) -> None:
            bar.set_description_str(what)
            lines.begins(what)

        def done(number: int) -> None:
            bar.update(voxels[number])
            lines.done(number)

        for one in _as_far_as_possible(whole.surfaces(given.cores, tell, done), made, len(voxels)):
            files = [_with_name(path, one.surface.name) for path in outputs if path not in scenes]
            files = [file for path in files for file in _write(one.surface, path, settings, given.band)]
            if scenes or given.json:  # what is read of all together at the end
                found[one.number] = one
            made[one.number] = _describe_surface(one.surface, files, one.seconds)
            with tqdm.external_write_mode():
                told = _fail_each(whole.failures, told)
                if not given.json:
                    print(_line_of(made[one.number]), flush=True)
    _fail_each(whole.failures, told)
    ordered = [found[number] for number in sorted(found)]
    files = [str(file) for path in scenes for file in _write_scene(path, ordered, given.band)]
    if given.json:
        apart = near_pairs({one.surface.name: one.surface.lofted for one in ordered})
        distances = [{"between": pair, **between._asdict()} for pair, between in apart.items()]
        described = [made[number] for number in sorted(made)]
        _print_json(given, described, scenes=files, distances=distances, failed=len(whole.failures))
    else:
        print(*files, sep="\n", end="\n" if files else "")
        _print_table([made[number] for number in sorted(made)])
    return 1 if whole.failures else 0


def _as_far_as_possible(
    surfaces: Iterable[LabelSurface], made: Mapping[int, object], count: int
) -> Iterator[LabelSurface]:
    """Give surfaces when they are ready; if that is interrupted, say what is written."""
    try:
        yield from surfaces
    except (KeyboardInterrupt, MemoryError):
        again = "the same command makes all of them again"
        print(f"{len(made)} of {count} organs are written; {again}", file=sys.stderr)
        raise


def _line_of(made: Mapping[str, Any]) -> str:
    """Say in a line what was made of one label of a map."""
    said = made["warnings"]
    notes = f", {len(said)} warning{'s'[: len(said) > 1]}" if said else ""
    return f"{' '.join(made['files']) or made['organ']}: {made['volume_ml']:.4g} ml{notes}"


def _print_table(made: Sequence[Mapping[str, Any]]) -> None:
    """Print a table of a map's organs, and their warnings, those of one kind joined."""
    from cccd.console import joined_warnings, organ_table

    rows = [(one["organ"], one["volume_ml"], one["triangles"], len(one["warnings"])) for one in made]
    if rows:
        print("", organ_table(rows), sep="\n")
    for line in joined_warnings({one["organ"]: one["warnings"] for one in made}):
        print(f"warning: {line}")


def _fail_each(failures: Sequence[str], told: int) -> int:
    """Report the failures that were not told yet; how many there are now."""
    for line in failures[told:]:
        _fail(line)
    return len(failures)


def _write_scene(path: Path, organs: Sequence[LabelSurface], band: bool) -> list[Path]:
    """Write all organs of a map as one scene and, with ``band``, those of their error bands beside it."""
    from dataclasses import asdict

    from cccd.store import atomic_path
    from cccd_labels.scene import name_organs, write_scene

    labels = {one.surface.name: asdict(one.label) for one in organs}
    scenes = {path: {one.surface.name: one.surface.lofted.mesh for one in organs}}
    for side in ("inner", "outer") if band else ():
        moved = {one.surface.name: one.surface.sides[side] for one in organs if side in one.surface.sides}
        scenes[_with_name(path, side)] = {name: surface.lofted.mesh for name, surface in moved.items()}
    scenes = {file: meshes for file, meshes in scenes.items() if meshes}
    for file, meshes in scenes.items():
        with atomic_path(file) as temporary:
            write_scene(temporary, name_organs(meshes, labels))
    return list(scenes)


def _write(surface: Surface, path: Path, settings: Settings, band: bool) -> list[Path]:
    """Write a surface and, with ``band``, those of its error band beside it."""
    files = {path: surface}
    if band:
        files |= {_with_name(path, side): moved for side, moved in surface.sides.items()}
    for file, one in files.items():
        one.write(
            file,
            contour_spacing_mm=settings.surface.contour_spacing_mm,
            keep_patient=settings.surface.keep_patient,
            settings=settings,
        )
    return list(files)


def _make_surface(
    given: argparse.Namespace, label: str, files: Sequence[Path], settings: Settings
) -> dict[str, Any]:
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
        structure = cccd.read(
            given.input,
            label,
            image=given.image,
            boundary=given.boundary,
            annotated=given.annotated,
            threshold=_threshold_of(given),
            seed=";".join(given.seed),
            settings=settings,
        )
        check_references(files, structure)
        for note in structure.warnings:
            if TAKEN_TOGETHER in note:
                tqdm.write(f"warning: {note}", file=sys.stderr)
        if not _is_compiled():
            tqdm.write("first use: compiling, once, for about 10 seconds ...", file=sys.stderr)
        surface = _uniform(cccd.reconstruct(structure, settings=settings, progress=tell), given)
        tell("writing")
        files = [file for path in files for file in _write(surface, path, settings, given.band)]
    return _describe_surface(surface, files, time.perf_counter() - began)


def _is_compiled() -> bool:
    """Whether Numba's machine code is there, or kept elsewhere, as where the library cannot be written."""
    library = Path(__file__).parent
    elsewhere = "NUMBA_CACHE_DIR" in os.environ or not os.access(library, os.W_OK)
    return elsewhere or any((library / "surface" / "__pycache__").glob("*.nbi"))


def _describe_surface(surface: Surface, files: Sequence[Path], seconds: float) -> dict[str, Any]:
    from cccd.surface.measure import measure_band

    return {
        "organ": surface.name,
        "files": [str(path) for path in files],
        "volume_ml": round(surface.volume / 1000, 4),
        **{name: round(value, 4) for name, value in measure_band(surface.lofted).items()},
        "size_mm": [round(length, 2) for length in surface.size],
        "pieces": surface.pieces,
        "triangles": len(surface.faces),
        **{
            name: surface.lofted.report["uniform"][name]
            for name in _UNIFORM
            if "uniform" in surface.lofted.report
        },
        "control_points": surface.lofted.report["control_points"],
        "tetrahedra": surface.tetrahedra,
        "warnings": [*surface.warnings, *(line for one in surface.tetrahedra for line in one["warnings"])],
        "seconds": round(seconds, 2),
    }


def _print_surfaces(given: argparse.Namespace, made: Sequence[dict[str, Any]]) -> None:
    """Say what was made, as lines or as JSON."""
    if given.json:
        _print_json(given, made, distances=[], failed=0)
        return
    for surface in made:
        _print_surface(surface)


def _print_json(given: argparse.Namespace, made: Sequence[dict[str, Any]], **more: object) -> None:
    print(json.dumps({"input": str(given.input), "surfaces": list(made), **more}, indent=2))


def _print_surface(made: dict[str, Any]) -> None:
    size = " x ".join(f"{length:.1f}" for length in made["size_mm"])
    print(*(made["files"] or [made["organ"]]), sep="\n")
    volume = millilitres(made["volume_ml"])
    if "band" in made:
        low, high = (millilitres(made[f"volume_{end}_ml"]).removesuffix(" ml") for end in ("low", "high"))
        volume += f" ({low} to {high}, {made['band']:.0%} interval)"
    pieces = f", {made['pieces']} pieces" if made.get("pieces", 1) > 1 else ""
    print(f"  {volume}, {size} mm{pieces}, {made['triangles']} triangles, {made['seconds']:.1f} s")
    if "chord_error_mm" in made:
        least, mean, most = made["edge_mm"]
        error = made["chord_error_mm"]
        print(f"  edges of {mean:.3g} mm ({least:.3g} to {most:.3g}), within {error:.2g} mm of the spline")
    for report in made.get("tetrahedra", []):
        print(f"  {_describe_tetrahedra(report)}")
    for warning in made["warnings"]:
        if TAKEN_TOGETHER not in warning:  # that was said before
            print(f"  warning: {warning}")


def _describe_tetrahedra(report: Mapping[str, Any]) -> str:
    """Say how many tetrahedra there are, how flat the worst is, and between which moduli they lie."""
    (organ,) = report["organs"].values()
    angle, jacobian = organ["least_dihedral_deg"]["min"], organ["scaled_jacobian"]["min"]
    said = f"{report['tetrahedra']} tetrahedra, dihedral angles from {angle:.1f} degrees"
    said += f", scaled Jacobian from {jacobian:.2f}, {report['seconds']:.0f} s"
    if "young_mpa" in report:
        low, high = report["young_mpa"]
        said += f"; {report['materials']} materials, E of {low:.4g} to {high:.4g} MPa"
    return said


# cccd segment ---------------------------------------------------------------------------------------


def _segment(given: argparse.Namespace) -> int:
    import cccd
    from cccd.devices import DEVICE
    from cccd.inputs.load import existing
    from cccd.inputs.row_files import read_image
    from cccd.segmentation.segment import find_segmenter, segment, write_labels

    if given.device:
        os.environ[DEVICE] = given.device
    stem = _plain_stem(given.input)
    outputs, labels = given.output or [Path(f"{stem}.ply")], given.labels or Path(f"{stem}_labels.nii.gz")
    _check_outputs(outputs, [given.input])
    if not labels.name.lower().endswith((".nii.gz", ".nii")):
        raise InputError(str(labels), "labels are written as NIfTI", "end its name with .nii.gz")
    _check_files([*outputs, labels], [given.input])
    began = time.perf_counter()
    segmenter, known = find_segmenter(given.segmenter)
    organ = given.organ or known
    if not organ:
        raise InputError("--organ", "no organ is named", "name one with --organ, such as liver")
    if known and organ not in known.split():
        hint = "leave --organ out, or use other weights"
        raise InputError("--organ", f"the segmenter was trained to find {known}, not {organ}", hint)
    found = segment(read_image(existing(given.input, "scan"), "files", fill_gaps=False), segmenter, organ)
    write_labels(labels, found)
    surface = cccd.reconstruct(found.labels > 0, found.image.affine)
    for path in outputs:
        surface.write(path)
    made = _describe_surface(surface, [*outputs, labels], time.perf_counter() - began)
    made |= {"organ": organ, "segmenter": found.segmenter, "warnings": [*found.warnings, *made["warnings"]]}
    if given.json:
        print(json.dumps(made, indent=2))
    else:
        _print_surface(made)
    return 0


# cccd check -----------------------------------------------------------------------------------------


def _check(given: argparse.Namespace) -> int:
    import cccd
    from cccd_labels.label_survey import measure_labels, survey_labels

    threshold = _threshold_of(given)
    from_image = bool(given.seed) or threshold is not False
    if given.output is not None:
        if given.output.suffix.lower() != ".png":
            raise InputError(str(given.output), "the picture is a PNG", "end its name with .png")
        _check_files([given.output], [given.input, given.image])
    if given.input.suffix == ".tsv":
        return _check_sheet(given)
    if given.label or given.boundary or from_image or not given.input.exists():
        structure = cccd.read(
            given.input,
            given.label,
            image=given.image,
            boundary=given.boundary,
            annotated=given.annotated,
            threshold=threshold,
            seed=";".join(given.seed),
        )
        plain = given.boundary or from_image
        listed = [] if plain else [label for label, _ in measure_labels(given.input)]
        found = [_check_one(given, structure, listed)]
    else:
        found = [_check_one(given, *survey_labels(given.input, given.image, given.annotated))]
    if given.json:
        print(json.dumps(found, indent=2))
    return 0


def _check_sheet(given: argparse.Namespace) -> int:
    """Check every row of a cohort sheet; what cannot be read is said in a line for each row."""
    from cccd.cohort import read_cohort
    from cccd.inputs.row_files import RowFiles

    sheet: Path = given.input
    rows = read_cohort(sheet)
    if given.output is not None and len(rows) > 1:
        raise InputError(str(given.output), "each row has a picture of its own", "leave --output out")
    found: list[dict[str, Any]] = []
    failed = False
    for _, alike in groupby(rows, key=itemgetter("image", "mask")):
        files = RowFiles.shared()
        for row in alike:
            try:
                found.append(_check_one(given, *_survey_row(row, sheet.parent, files)))
            except InputError as error:
                failed = True
                _fail(str(error))
    if given.json:
        print(json.dumps(found, indent=2))
    return int(failed)


def _survey_row(
    row: Mapping[str, str], folder: Path, files: RowFiles
) -> tuple[Structure, Sequence[SurveyedLabel], DrawnLabels | None]:
    """Read a row's structure, or all labels of a map whose organ is ``*``."""
    from cccd.inputs import load_structure
    from cccd.settings.root import Settings
    from cccd_labels.label_survey import survey_labels

    if row["organ"] != "*":
        settings = Settings()
        return load_structure(row, folder, settings.import_, settings.seed, files), (), None
    image, table = (folder / row[column] if row[column] else None for column in ("image", "labels"))
    try:
        structure, told, drawn = survey_labels(folder / row["mask"], image, row["annotated"], table)
    except InputError as error:
        raise error.at(row["location"]) from None
    return replace(structure, case=row["case"], organ=row["case"]), told, drawn


def _check_one(
    given: argparse.Namespace,
    structure: Structure,
    labels: Sequence[SurveyedLabel] = (),
    drawn: DrawnLabels | None = None,
) -> dict[str, Any]:
    """Say what a structure was understood to be, and draw it."""
    from cccd.inputs.regions import draw_region
    from cccd.store import atomic_path

    name = structure.organ if structure.organ == structure.case else f"{structure.case}_{structure.organ}"
    picture = given.output or Path(f"{name}_check.png")
    said = _describe_structure(structure, drawn)
    if given.input.suffix == ".tsv":
        picture = given.output or Path(f"{given.input.stem}_check") / f"{name}.png"  # one of many
        said = {"case": structure.case, **said}
    _check_writable(picture)
    if not given.json:
        for key, value in {**said, "labels": labels}.items():
            for line in [value] if isinstance(value, str) else value:
                print(f"{key + ':':<10} {line}")
    said["labels"] = [
        {"label": label.label, "name": label.name, "volume_ml": label.volume_ml, "note": label.note}
        for label in labels
    ]
    with atomic_path(picture) as temporary:
        draw_region(structure, temporary, drawn)
    if not given.json:
        print(f"{'picture:':<10} {picture}")
    return {**said, "picture": str(picture)}


def _describe_structure(structure: Structure, drawn: DrawnLabels | None) -> dict[str, Any]:
    import numpy as np
    from nibabel.orientations import aff2axcodes

    frame = structure.frame
    axes = [str(code) for code in aff2axcodes(frame.affine)]
    along = f"axis {frame.slice_axis} ({axes[frame.slice_axis]})"
    tilted = f", tilted by {frame.tilt:.1f} degrees" if frame.is_tilted else ""
    slices = _slices(structure)
    steps = sorted({f"{step * frame.slice_spacing:.4g}" for step in np.diff(slices)}, key=float)
    apart = " to ".join(dict.fromkeys((steps[0], steps[-1]))) if steps else f"{frame.slice_spacing:.4g}"
    shape, spacing = " x ".join(map(str, frame.shape)), " x ".join(f"{size:.4g}" for size in frame.spacing)
    ways = {
        "contours": "drawn contours, used as they are",
        "boundary": "boundary maps, ordered by the network",
        "probability": "probabilities, traced at 0.5",
    }
    traced = "a region of grey values, traced" if "region" in structure.provenance else "a mask, traced"
    way = next((text for name, text in ways.items() if getattr(structure, name) is not None), traced)
    if drawn is not None:
        way = way.replace("a mask", "masks")
        way += f"; {len(drawn.captions)} labels: --label NAME takes one, --all-labels makes each"
    return {
        "organ": structure.organ,
        "input": way,
        "grid": f"{shape} voxels of {spacing} mm",
        "axes": f"index axes run towards {', '.join(axes)}: {', '.join(_TOWARDS[axis] for axis in axes)}",
        "slices": f"{len(slices)} with organ, along {along}, {apart} mm apart" + tilted,
        "warnings": list(structure.warnings),
    }


def _slices(structure: Structure) -> list[int]:
    """Numbers of the slices with organ, ascending."""
    import numpy as np

    from cccd.containers import BoundaryMaps, Curves, GreyImage

    match structure.source:
        case Curves() as drawn:
            return sorted(set(drawn.slice.tolist()))
        case BoundaryMaps(stack) | GreyImage(region=stack):
            pass
        case _:
            stack = structure.required_stack("mask")
    return np.flatnonzero(stack.any(axis=(1, 2))).tolist()


# cccd compare ---------------------------------------------------------------------------------------


def _compare(given: argparse.Namespace) -> int:
    from cccd.limits import LIMITS
    from cccd_workflow.comparison import compare, missed_limits
    from cccd_workflow.comparison_files import check_outputs, write_comparison

    if len(given.label) > 2:
        raise InputError("--label", "given more than twice", "give one label, or that of A and that of B")
    if not given.tolerance >= 0:
        raise InputError("--tolerance", f"{given.tolerance:g} is no distance", "give mm, 0 or more")
    check_outputs(given.output)
    _check_files(given.output, [given.first, given.second])
    limits = {figure: value for figure in LIMITS if (value := getattr(given, figure)) is not None}
    found = compare(given.first, given.second, given.label, given.tolerance, bool(given.output))
    for path in given.output:
        write_comparison(path, found)
    missed = missed_limits(found, limits)
    if given.json:
        print(json.dumps({**found.as_json(), "limits": limits, "missed": missed}, indent=2))
    else:
        print(found.as_text())
        for line in missed:
            print(f"missed: {line}")
        print(*given.output, sep="\n", end="\n" * bool(given.output))
    return 1 if missed else 0


# vessels, airways and ducts -------------------------------------------------------------------------


def _tube(given: argparse.Namespace) -> tuple[Mesh, float | None]:
    """Return the surface of what was given, and the smallest edge of a voxel; a mesh is taken as it is."""
    import cccd
    from cccd.closed_meshes import read_closed_mesh
    from cccd.files.read_meshes import is_mesh

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
    from tqdm import tqdm

    for note in notes:
        tqdm.write(f"warning: {note}", file=sys.stderr)  # beside a line that says what goes on


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
    from cccd_vessels.centrelines import find_centrelines
    from cccd_vessels.files import check_suffix, describe, write_centrelines

    outputs = given.output or [Path(f"{_plain_stem(given.input)}_centrelines.csv")]
    for path in outputs:
        check_suffix(path)
    _check_files(outputs, [given.input])
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
    from cccd_vessels.hollow import hollow_wall

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
    from cccd_vessels.centrelines import find_centrelines
    from cccd_vessels.ends import clear_ends, find_ends, opened
    from cccd_vessels.named import check_named, write_named

    for path in given.output:
        check_named(path)
    _check_files(given.output, [given.input])
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
        write_named(path, named, _plain_stem(given.input))
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
        print(f"  {name}: {area:.4g} mm²")
    for note in notes:
        print(f"  note: {note}")
    return 0


# the workflow ---------------------------------------------------------------------------------------


def _run(given: argparse.Namespace) -> int:
    from cccd.workflow_command import run_command, snakemake_command

    sheet, folder = given.input, given.directory or Path.cwd()
    if sheet.is_dir():
        sheet, folder = _sheet_of_bids(given)
    elif given.output is not None:
        raise InputError(
            str(sheet), "not the folder of a BIDS data set", "give BIDS_DIR OUT participant, or a sheet"
        )
    _check_writable(folder / "results")
    flags = [flag for flag in ("--keep-going", "--dry-run") if getattr(given, flag[2:].replace("-", "_"))]
    further = [*flags, *given.further]
    command = snakemake_command(sheet, folder, given.cores, given.profile, given.configfile, further)
    sys.stdout.flush()
    return run_command(command)


def _sheet_of_bids(given: argparse.Namespace) -> tuple[Path, Path]:
    """Write the cohort sheet of a BIDS data set into the folder of the results."""
    import cccd
    from cccd.bids import find_structures, write_sheet

    if given.output is None or given.level is None:
        raise InputError(
            str(given.input), "a folder", "give BIDS_DIR OUT participant, or a cohort sheet (.tsv)"
        )
    _check_writable(given.output / "cohort.tsv")
    rows = find_structures(given.input, cccd.labels, given.participant_label)
    sheet = given.output / "cohort.tsv"
    write_sheet(sheet, rows)
    print(f"{sheet}: {len(rows)} structures of {len({row['case'] for row in rows})} cases")
    return sheet, given.output


def _export(given: argparse.Namespace) -> int:
    from cccd.files.options import ExportOptions
    from cccd.files.write import write_surface
    from cccd.store import read_drawn
    from cccd.surface.surface import read_surface

    folder = given.input if given.input.is_dir() else given.input.parent  # a file of it will do
    splines, mesh = folder / "surface.h5", folder / "surface.ply"
    for path in (splines, mesh):
        if not path.is_file():
            raise InputError(
                str(path), "not there", "give the folder of a finished structure: results/CASE/ORGAN"
            )
    _check_outputs(given.output, [mesh])
    surface, structure = read_surface(splines, mesh), folder / "structure.h5"
    drawn = read_drawn(structure) if structure.is_file() else None
    for path in given.output:
        sides = surface.sides() if given.band else {}
        moved = {_with_name(path, side): of for side, of in sides.items()}
        for file, one in {path: surface, **moved}.items():
            write_surface(file, one, ExportOptions(folder.resolve().name, drawn=drawn))
            print(file)
    return 0


def _report(given: argparse.Namespace) -> int:
    from cccd.project import PROJECT
    from cccd.report.page import build_report_of_finished
    from cccd.settings.root import whole_settings

    output = given.output or given.input / "report.html"
    _check_writable(output)
    if not any(given.input.glob("*/*/metrics.json")):
        raise InputError(str(given.input), "no structure is finished there", "give the folder of the results")
    templates = PROJECT / "workflow" / "report"
    build_report_of_finished(given.input, whole_settings()().as_config(), output, templates)
    print(output)
    return 0


def _relabel(given: argparse.Namespace) -> int:
    import numpy as np
    from tqdm import tqdm

    from cccd.containers import Grid
    from cccd.inputs.load import existing
    from cccd.inputs.nifti_export import write_nifti
    from cccd.inputs.row_files import label_values, read_image
    from cccd.settings.root import Settings
    from cccd.store import atomic_path
    from cccd_labels.relabelling import finer_grid, name_of_soft, relabelled, share_of_voxels
    from cccd_labels.whole_map import WholeMap

    if (given.voxel is None) == (given.like is None):
        raise InputError("--voxel", "one of --voxel and --like is needed", "name one of them")
    if given.voxel is not None and not given.voxel > 0:
        raise InputError("--voxel", f"{given.voxel} is not positive", "give the edge of a voxel in mm")
    if not given.output.name.endswith((".nii", ".nii.gz")):
        raise InputError(given.output.name, "it is no NIfTI file", "name it .nii or .nii.gz")
    _check_files([given.output], [given.input, given.like])
    settings = Settings()
    volume = label_values(existing(given.input.absolute(), given.input.name))
    if volume is None:
        raise InputError(given.input.name, "it is no label map", "give NIfTI, NRRD or MHA")
    if given.like is None:
        grid = finer_grid(volume, float(given.voxel or 0))
    else:
        scan = read_image(
            existing(given.like.absolute(), given.like.name), "files", settings.import_.fill_gaps
        )
        grid = Grid(scan.affine, (scan.data.shape[0], scan.data.shape[1], scan.data.shape[2]))
    whole = WholeMap.read(given.input, None, None, "every slice", settings)
    if note := whole.check_memory(given.cores):
        print(f"{note} ...", file=sys.stderr)
    labels = np.zeros(grid.shape, np.uint16 if int(volume.data.max()) < 1 << 16 else np.int32)
    progress = tqdm(disable=None, leave=False, bar_format="{desc:<40} {elapsed}")
    for value, surface, voxels in relabelled(whole, grid, given.cores, progress.set_description_str):
        labels.reshape(-1)[voxels] = value
        if surface is not None and given.soft:
            low, share = share_of_voxels(surface.surface.lofted.mesh, grid)
            soft = np.zeros(grid.shape, np.float32)
            soft[tuple(slice(a, a + n) for a, n in zip(low, share.shape, strict=True))] = share
            with atomic_path(name_of_soft(given.output, surface.surface.name)) as path:
                write_nifti(path, soft, grid.affine)
    progress.close()
    with atomic_path(given.output) as path:
        write_nifti(path, labels, grid.affine)
    size = " x ".join(str(n) for n in grid.shape)
    print(f"{given.output}: {size} voxels, {len(np.unique(labels)) - 1} of {len(whole.labels)} labels")
    return 0


def _next(given: argparse.Namespace) -> int:
    import cccd
    from cccd.next_slice import rank_slices
    from cccd.settings.root import Settings

    of = {"image": given.image, "boundary": given.boundary, "annotated": given.annotated}
    with clock("slices"):
        structure = cccd.read(given.input, given.label, **of)
        gains = rank_slices(structure, Settings())
    if given.json:
        slices = [{"slice": gain.slice, "lowers_error": round(gain.lowers, 4)} for gain in gains]
        axis = structure.frame.slice_axis
        print(json.dumps({"input": str(given.input), "axis": axis, "slices": slices}, indent=2))
        return 0
    best, *others = gains[:4]
    print(f"annotate slice {best.slice} next (axis {structure.frame.slice_axis}, counted from 0):")
    print(f"  it is expected to lower the error by {best.lowers:.1%}")
    for gain in others:
        print(f"  slice {gain.slice}: {gain.lowers:.1%}")
    return 0


def _calibrate(given: argparse.Namespace) -> int:
    from tqdm import tqdm

    from cccd.cohort import read_cohort
    from cccd.inputs import load_structure
    from cccd.settings.root import Settings
    from cccd.thinning import calibrate_masks

    _check_files([given.output], [given.input])
    settings, rows = Settings(), read_cohort(given.input)
    structures = (load_structure(row, given.input.parent, settings.import_, settings.seed) for row in rows)
    with tqdm(structures, total=len(rows), disable=None, leave=False) as bar:
        calibration = calibrate_masks(bar, len(rows), settings, given.input.name)
    from cccd.store import atomic_path

    with atomic_path(given.output) as temporary:
        calibration.write(temporary)
    print(given.output)
    print(f"  {calibration.made_of}")
    for regime in calibration.regimes:
        apart = f"slices {regime.low:g} to {regime.high:g} pixels apart"
        print(f"  {apart}: {regime.stacks} stacks of {regime.organs} organs")
    return 0


def _doctor(given: argparse.Namespace) -> int:
    from cccd.doctor import examine

    findings = examine()
    if given.json:
        print(json.dumps([finding._asdict() for finding in findings], indent=2))
    else:
        for what, works, detail in findings:
            print(f"{'yes' if works else 'no ':<4} {what:<18} {detail}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
