"""The option ``--all-labels`` of ``cccd surface``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from cccd.commands import describe_surface, print_json, with_name, write_with_band
from cccd.console import print_error
from cccd.errors import InputError
from cccd.files import format_of
from cccd.store import atomic_path
from cccd_labels.between import near_pairs
from cccd_labels.progress import OrganLines, joined_warnings, organ_table
from cccd_labels.scene import name_organs, write_scene
from cccd_labels.whole_map import WholeMap

if TYPE_CHECKING:
    from cccd.settings.root import Settings
    from cccd_labels.whole_map import LabelSurface

#: What is shown while the labels of a map are made: which one, how much is done, how long it takes yet.
_ALL_BAR = "{desc:<32} {percentage:3.0f}% {bar:20} {elapsed}, {remaining} left"


def make_all_surfaces(given: argparse.Namespace, outputs: Sequence[Path], settings: Settings) -> int:
    """Make a surface of every label, and write and report each when it is ready: the exit status."""
    scenes = [path for path in outputs if format_of(path) == "glb"]
    with tqdm(disable=None, leave=False, bar_format="{desc:<40} {elapsed}") as bar:
        bar.set_description_str("reading")
        whole = WholeMap.read(given.input, given.names, given.image, given.annotated, settings)
    if given.resume:
        if scenes or given.json or given.band:
            problem = "a scene, --json and --band need all organs again"
            raise InputError("--resume", problem, "leave one of them out")
        whole = without_written(whole, outputs)
    if note := whole.check_memory(given.cores):
        print(f"{note} ...", file=sys.stderr)
    voxels, reported = whole.voxels, 0
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
            files = [with_name(path, one.surface.name) for path in outputs if path not in scenes]
            files = [
                file for path in files for file in write_with_band(one.surface, path, settings, given.band)
            ]
            if scenes or given.json:  # what is read of all together at the end
                found[one.number] = one
            made[one.number] = describe_surface(one.surface, files, one.seconds)
            with tqdm.external_write_mode():
                reported = _fail_each(whole.failures, reported)
                if not given.json:
                    print(_line_of(made[one.number]), flush=True)
    _fail_each(whole.failures, reported)
    ordered = [found[number] for number in sorted(found)]
    files = [str(file) for path in scenes for file in _write_scene(path, ordered, given.band)]
    if given.json:
        apart = near_pairs({one.surface.name: one.surface.lofted for one in ordered})
        distances = [{"between": pair, **between._asdict()} for pair, between in apart.items()]
        described = [made[number] for number in sorted(made)]
        print_json(given, described, scenes=files, distances=distances, failed=len(whole.failures))
    else:
        print(*files, sep="\n", end="\n" if files else "")
        _print_table([made[number] for number in sorted(made)])
    return 1 if whole.failures else 0


def without_written(whole: WholeMap, outputs: Sequence[Path]) -> WholeMap:
    """Leave out organs whose files are there, newer than the map; none that shares walls with another."""
    since = whole.path.stat().st_mtime if whole.path.is_file() else 0.0
    files = {
        number: [with_name(path, structure.organ) for path in outputs]
        for number, structure in whole.structures.items()
    }
    left = whole.without(
        {n for n, paths in files.items() if all(p.is_file() and p.stat().st_mtime > since for p in paths)}
    )
    kept = len(whole.structures) - len(left.structures)
    print(f"{kept} of {len(whole.structures)} organs are written already", file=sys.stderr)
    return left


def _as_far_as_possible(
    surfaces: Iterable[LabelSurface], made: Mapping[int, object], count: int
) -> Iterator[LabelSurface]:
    """Give surfaces when they are ready; if that is interrupted, say what is written."""
    try:
        yield from surfaces
    except (KeyboardInterrupt, MemoryError):
        again = "the same command with --resume makes the others"
        print(f"{len(made)} of {count} organs are written; {again}", file=sys.stderr)
        raise


def _line_of(made: Mapping[str, Any]) -> str:
    """Say in a line what was made of one label of a map."""
    said = made["warnings"]
    notes = f", {len(said)} warning{'s'[: len(said) > 1]}" if said else ""
    return f"{' '.join(made['files']) or made['organ']}: {made['volume_ml']:.4g} ml{notes}"


def _print_table(made: Sequence[Mapping[str, Any]]) -> None:
    """Print a table of a map's organs, and their warnings, those of one kind joined."""
    rows = [(one["organ"], one["volume_ml"], one["triangles"], len(one["warnings"])) for one in made]
    if rows:
        print("", organ_table(rows), sep="\n")
    for line in joined_warnings({one["organ"]: one["warnings"] for one in made}):
        print(f"warning: {line}")


def _fail_each(failures: Sequence[str], reported: int) -> int:
    """Report the failures that were not reported yet; how many there are now."""
    new = failures[reported:]
    why = {label: [reason] for label, _, reason in (line.partition(": ") for line in new)}
    for line in joined_warnings(why) if len(new) > 1 else new:
        print_error(line)
    return len(failures)


def _write_scene(path: Path, organs: Sequence[LabelSurface], band: bool) -> list[Path]:
    """Write all organs of a map as one scene and, with ``band``, those of their error bands beside it."""
    labels = {one.surface.name: asdict(one.label) for one in organs}
    scenes = {path: {one.surface.name: one.surface.lofted.mesh for one in organs}}
    for side in ("inner", "outer") if band else ():
        moved = {one.surface.name: one.surface.sides[side] for one in organs if side in one.surface.sides}
        scenes[with_name(path, side)] = {name: surface.lofted.mesh for name, surface in moved.items()}
    scenes = {file: meshes for file, meshes in scenes.items() if meshes}
    for file, meshes in scenes.items():
        with atomic_path(file) as temporary:
            write_scene(temporary, name_organs(meshes, labels))
    return list(scenes)
