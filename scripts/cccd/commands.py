"""The command ``cccd surface``, and what commands share: arguments, files, and what they say."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cccd.console import clock, millilitres
from cccd.errors import EarlyWarning, InputError
from cccd.extras import check_extra
from cccd.plugins import find, formats, table
from cccd.store import check_writable

if TYPE_CHECKING:
    from cccd.api import Surface
    from cccd.containers import Structure
    from cccd.inputs.file_requests import Threshold
    from cccd.settings.root import Settings

#: A parser, or a group of its arguments.
Arguments = argparse.ArgumentParser | argparse._ArgumentGroup  # pyright: ignore[reportPrivateUsage]


def add_input(command: Arguments) -> None:
    """Add what is read: a file or folder, and which organ of it."""
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


def add_band(command: Arguments) -> None:
    """Add the option ``--band``."""
    command.add_argument(
        "--band", action="store_true",
        help="also write the inner and outer surface of the error band, as NAME_inner and NAME_outer",
    )  # fmt: skip


def read_given(given: argparse.Namespace, settings: Settings) -> Structure:
    """Read what the arguments of `add_input` name."""
    from cccd.inputs import read_request
    from cccd.inputs.file_requests import request_for

    request = request_for(
        given.input,
        given.label,
        image=given.image,
        boundary=given.boundary,
        annotated=given.annotated,
        threshold=threshold_of(given),
        seeds=tuple(given.seed),
    )
    return read_request(request, settings.import_, settings.seed)


def threshold_of(given: argparse.Namespace) -> Threshold:
    """Return what `cccd.read` takes as threshold."""
    if not given.threshold:
        return given.threshold is not None
    try:
        low, high = (float(end) if end else None for end in given.threshold.split(":"))
    except ValueError:
        hint = "give LOW:HIGH, as 150: or -1000:-400"
        raise InputError("--threshold", f"{given.threshold!r} is not a range", hint) from None
    return low, high


def settings_of(given: argparse.Namespace) -> Settings:
    """Return the defaults, or those with the keys of the file that was given."""
    from cccd.settings.root import Settings

    settings = Settings()
    if given.configfile:
        from cccd.settings.root import read_config

        settings = read_config(given.configfile)
    changes: dict[str, float | str] = {}
    if given.smooth is not None:
        if not 0 < given.smooth <= 1000:
            raise InputError("--smooth", f"{given.smooth:g} is no length in mm", "give a number up to 1000")
        changes["smoothing"] = given.smooth
    if given.reader is not None:
        from cccd.bands import Reader

        Reader.of(given.reader)  # refused before any work
        changes["reader_mm"] = given.reader
    if changes:
        settings = settings.model_copy(update={"surface": settings.surface.model_copy(update=changes)})
    return settings if given.materials is None else find(table("OPTIONS")["materials"])(settings, given)


def plain_stem(path: Path) -> str:
    """Return a file's or folder's name without the suffix of its format."""
    from cccd.inputs.file_requests import name_of

    return name_of(path.absolute())


def check_outputs(outputs: Sequence[Path], sources: Sequence[Path | None]) -> None:
    """Refuse surfaces that could not be written before anything is computed."""
    from cccd.files import check_format

    for path in outputs:
        if "." not in path.name:
            hint = f"name a file: {path / 'all.ply'}, which with --all-labels is all_LABEL.ply for each"
            raise InputError(str(path), "no suffix chooses a format", hint)
        check_format(path)
    check_files(outputs, sources)


def check_files(outputs: Sequence[Path], sources: Sequence[Path | None]) -> None:
    """Refuse files that cannot be written, or that hold what is read."""
    absolute = [path.absolute() for path in outputs]
    for path in outputs:
        if absolute.count(path.absolute()) > 1:
            raise InputError(str(path), "named twice as output", "name it once")
        if any(source is not None and _is_read(path, source) for source in sources):
            raise InputError(str(path), "that is the input", "give another name")
        check_writable(path)


def _is_read(path: Path, source: Path) -> bool:
    """Whether a file is an input, or one of the volumes and images in a folder that is."""
    from cccd.file_headers import dicom_modality
    from cccd.inputs.readers import without_suffix

    if not path.is_file() or not source.exists():
        return False
    if not source.is_dir():
        return path.samefile(source)
    inside = source.resolve() in path.resolve().parents
    return inside and (without_suffix(path.name) is not None or dicom_modality(path) is not None)


def with_name(path: Path, organ: str) -> Path:
    """Put the name of an organ before a file's suffix."""
    from cccd.files import format_of

    suffix = f".{format_of(path)}"
    return path.with_name(f"{path.name[: -len(suffix)]}_{organ}{suffix}")


def write_with_band(
    surface: Surface, path: Path, settings: Settings, band: bool, samples: Sequence[Surface] = ()
) -> list[Path]:
    """Write a surface, with ``band`` those of its error band, and samples beside it."""
    files = {path: surface}
    if band:
        files |= {with_name(path, side): moved for side, moved in surface.sides.items()}
    files |= {with_name(path, str(n)): sample for n, sample in enumerate(samples, 1)}
    for file, one in files.items():
        with clock(f"writing {file.name}"):
            one.write(file, settings=settings)
    return list(files)


def describe_surface(surface: Surface, files: Sequence[Path], seconds: float) -> dict[str, Any]:
    """Return what there is to say of a surface: plain JSON."""
    return {
        "organ": surface.name,
        "files": [str(path) for path in files],
        "volume_ml": round(surface.volume / 1000, 4),
        **{name: round(value, 4) for name, value in surface.lofted.band_figures.items()},
        "size_mm": [round(length, 2) for length in surface.size],
        "pieces": surface.pieces,
        "triangles": len(surface.faces),
        **surface.lofted.report.get("uniform", {}),
        "control_points": surface.lofted.report["control_points"],
        "tetrahedra": surface.tetrahedra,
        "warnings": [*surface.warnings, *(line for one in surface.tetrahedra for line in one["warnings"])],
        "seconds": round(seconds, 2),
    }


def print_surfaces(given: argparse.Namespace, made: Sequence[dict[str, Any]]) -> None:
    """Say what was made, as lines or as JSON."""
    if given.json:
        print_json(given, made, distances=[], failed=0)
        return
    for surface in made:
        print_surface(surface)


def print_json(given: argparse.Namespace, made: Sequence[dict[str, Any]], **more: object) -> None:
    """Say what was made as JSON."""
    print(json.dumps({"input": str(given.input), "surfaces": list(made), **more}, indent=2))


def print_surface(made: dict[str, Any]) -> None:
    """Say what was made in some lines."""
    size = " x ".join(f"{length:.1f}" for length in made["size_mm"])
    print(*(made["files"] or [made["organ"]]), sep="\n")
    volume = millilitres(made.get("spline_ml", made["volume_ml"]))  # of what the interval is of
    if "band" in made:
        low, high = (millilitres(made[f"volume_{end}_ml"]).removesuffix(" ml") for end in ("low", "high"))
        volume += f" ({low} to {high}, {made['band']:.0%} interval)"
    pieces = f", {made['pieces']} pieces" if made.get("pieces", 1) > 1 else ""
    print(f"  {volume}, {size} mm{pieces}, {made['triangles']} triangles, {made['seconds']:.1f} s")
    if "chord_error_mm" in made:
        least, mean, most = made["edge_mm"]
        off = f"{millilitres(made['volume_ml'])} within {made['chord_error_mm']:.2g} mm of the spline"
        print(f"  edges of {mean:.3g} mm ({least:.3g} to {most:.3g}), {off}")
    for name, (low, high) in made.get("intervals", {}).items():
        what, _, unit = name.rpartition("_")
        print(f"  {what}: {low:.4g} to {high:.4g} {unit}, {made['band']:.0%} interval")
    for report in made.get("tetrahedra", []):
        print(f"  {_describe_tetrahedra(report)}")
    for warning in made["warnings"]:
        if not isinstance(warning, EarlyWarning):  # that was said before
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


#: Processes for a whole map where nobody says: each may need a gigabyte.
_MOST_CORES = 4

_STEPS = ("reading", "contours", "splines", "surface", "writing")


class _Formats:
    """Suffixes of all formats, which are looked up only where the help is printed."""

    def __str__(self) -> str:
        return " ".join(f".{name}" for name in formats())


def add_surface(command: argparse.ArgumentParser) -> None:
    """Make a smooth closed surface, and print its volume, its size and warnings."""
    add_input(command.add_argument_group("what is read"))
    written = command.add_argument_group("what is written")
    every = command.add_argument_group("all labels")
    shape = command.add_argument_group("the surface")
    output = written.add_argument(
        "-o", "--output", type=Path, action="append", default=[], metavar="FILE",
        help="output file, repeatable. The suffix chooses the format, one of %(formats)s. Default: the "
        "input's name with .ply (with --seed: _seeded.ply, with --threshold: _threshold.ply), in this folder",
    )  # fmt: skip
    vars(output)["formats"] = _Formats()
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
