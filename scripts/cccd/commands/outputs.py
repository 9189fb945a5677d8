"""The files that commands write: their names, whether they can be written, and with their band."""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cccd.console import clock, millilitres
from cccd.errors import EarlyWarning, InputError
from cccd.store import check_writable

if TYPE_CHECKING:
    from cccd.api import Surface
    from cccd.settings.root import Settings


def plain_stem(path: Path) -> str:
    """Return a file's or folder's name without the suffix of its format."""
    from cccd.inputs.file_requests import name_of

    return name_of(path.absolute())


def check_outputs(outputs: Sequence[Path], sources: Sequence[Path | None]) -> None:
    """Refuse surfaces that could not be written before anything is computed."""
    from cccd.files.write import check_format

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
        if path.is_dir():
            raise InputError(str(path), "that is a folder", "give the name of a file in it")
        if any(source is not None and _is_read(path, source) for source in sources):
            raise InputError(str(path), "that is the input", "give another name")
        check_writable(path)


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


def with_name(path: Path, organ: str) -> Path:
    """Put the name of an organ before a file's suffix."""
    from cccd.files.write import format_of

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
            one.write(
                file,
                contour_spacing_mm=settings.surface.contour_spacing_mm,
                keep_patient=settings.surface.keep_patient,
                settings=settings,
            )
    return list(files)


def describe_surface(surface: Surface, files: Sequence[Path], seconds: float) -> dict[str, Any]:
    """Return what there is to say of a surface: plain JSON."""
    from cccd.surface.measure import measure_band

    return {
        "organ": surface.name,
        "files": [str(path) for path in files],
        "volume_ml": round(surface.volume / 1000, 4),
        **{name: round(value, 4) for name, value in measure_band(surface.lofted).items()},
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
