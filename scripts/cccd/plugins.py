"""The packages around the core, and the tables by which each adds to it.

A package has a module ``plugin`` with those of these tables that it fills, dictionaries by name:

========================= ========================================================================
table                     a row
========================= ========================================================================
``COMMANDS``              a command: `Command`
``OPTIONS``               path of what ``cccd surface`` does of an option or another input, by it
``READERS``               what reads a kind of file, by suffix with its dot, or another name: `Reader`
``WRITERS``               a format of files: `Format`
``CURVES``                path of a function that makes curves, by what of (`Structure.input`, pixels)
``SOURCES``               path of what makes a row's `Scan` or `Structure`, by its source
``LAYOUTS``               path of what completes a row of a named cohort, by its source
``MASKS``                 path of what finds an organ in an image, by how (`cccd.inputs.load.find_organ`)
``API``                   path of a public function of ``import cccd``
``SETTINGS``              path of a section's model and its default (as `pydantic.create_model` has fields)
``JUNCTION_NETWORKS``     path of a class, by the name that a ``model.pt`` says
``JUNCTION_TRAINING``     path of what trains such a network, a `cccd_training.junctions.tasks.Task`
``SEGMENTATION_NETWORKS`` path of a mapping like `cccd_segmentation.networks.NETWORKS`
``REPORT``                a module with ITEMS, INPUTS and SECTIONS, as in `cccd_workflow.report.registry`
========================= ========================================================================

Functions and classes are named by their dotted path (`find`), and such a module imports nothing
but this one: what is asked for is loaded when it is asked for.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

#: The core, and what is around it: those that are not there add nothing.
PACKAGES = (
    "cccd",
    *("cccd_networks", "cccd_segmentation", "cccd_datasets", "cccd_junctions", "cccd_labels", "cccd_dicom"),
    *("cccd_formats", "cccd_viewers", "cccd_meshes", "cccd_solids", "cccd_tetrahedra", "cccd_vessels"),
    *("cccd_walls", "cccd_shapes", "cccd_calibration", "cccd_workflow", "cccd_paper", "cccd_training"),
)


@dataclass(frozen=True)
class Command:
    """A command of ``cccd``.

    Attributes
    ----------
    help : str
        One line of ``cccd --help``.
    arguments : str
        Path of a function that adds the arguments to the command's parser, and with ``set_defaults(run=...)``
        what runs it and returns the exit code. Its docstring is the command's description.
    """

    help: str
    arguments: str


@dataclass(frozen=True)
class Reader:
    """What reads a kind of file.

    Attributes
    ----------
    read : str
        Path of a function of the file's path; what it returns of several things has ``names`` by number.
    holds : {"", "volume", "mesh"}
        Of a row by suffix: what the function returns, a `cccd.inputs.grid.Volume` (a mask, a label map, an
        image), or vertices (V, 3) in mm RAS and triangles (F, 3).
    inside : tuple of str
        Names of files: a folder with one of them is such a volume, whatever its own name.
    """

    read: str
    holds: Literal["", "volume", "mesh"] = ""
    inside: tuple[str, ...] = ()


@dataclass(frozen=True)
class Format:
    """A format in which surfaces are written; its name is the files' suffix without its dot.

    Attributes
    ----------
    holds : str
        What the file contains, for people.
    writer : str
        Path of a function, called with path, surface and `cccd.files.ExportOptions`.
    extra : str
        The extra that writes it.
    made_of : {"mesh", "solids", "tetrahedra"}
        Writers of solids and of tetrahedra return a report.
    check : str
        Path of a function that refuses, before any work, what could not be written: called with path, and
        folder of the DICOM series or None.
    """

    holds: str
    writer: str
    extra: str = ""
    made_of: Literal["mesh", "solids", "tetrahedra"] = "mesh"
    check: str = ""


def folders() -> tuple[Path, ...]:
    """Folders of the packages that are there."""
    beside = Path(__file__).resolve().parent.parent
    return tuple(beside / name for name in PACKAGES if (beside / name / "__init__.py").is_file())


def own_rows(name: str, package: str = PACKAGES[0]) -> Mapping[str, Any]:
    """Rows of one table that the core itself has, or another package."""
    return getattr(import_module(f"{package}.plugin"), name, {})


def row(name: str, key: str) -> Any:
    """One row of a table, None where there is none: of what the core has itself, no other table is loaded.

    >>> row("WRITERS", "ply").writer, row("WRITERS", "tsl")
    ('cccd.files.write_ply', None)
    """
    return own_rows(name).get(key) or table(name).get(key)


def formats(*made_of: str) -> dict[str, Format]:
    """Every format by its name, in order, of all packages; or those that are made of something.

    >>> "ply" in formats(), "ply" in formats("solids", "tetrahedra")
    (True, False)
    """
    rows: Mapping[str, Format] = table("WRITERS")
    return {name: form for name, form in sorted(rows.items()) if not made_of or form.made_of in made_of}


def band_formats() -> tuple[str, ...]:
    """Name formats of the error band's inner and outer surface, surface_inner.stl and surface_outer.stl."""
    return tuple(f"band.{name}" for name in own_rows("WRITERS"))  # which are meshes


@functools.cache
def table(name: str) -> Mapping[str, Any]:
    """Rows of one table of all packages, by their names.

    Raises
    ------
    ValueError
        Two packages have a row of the same name.

    Examples
    --------
    >>> table("WRITERS")["ply"].writer
    'cccd.files.write_ply'
    """
    rows: dict[str, Any] = {}
    for folder in folders():
        if not (folder / "plugin.py").is_file():
            continue
        more = own_rows(name, folder.name)
        if taken := rows.keys() & more:
            raise ValueError(f"{folder.name}: {name} has a row {min(taken)!r} already")
        rows |= more
    return MappingProxyType(rows)


def find(path: str) -> Any:
    """Look up a function, or what else a module has, by its dotted path.

    >>> find("math.hypot")(3, 4)
    5.0
    """
    module, name = path.rsplit(".", 1)
    return getattr(import_module(module), name)


def call(function: str, arguments: Mapping[str, Any]) -> Any:
    """Call a function with those of the arguments that it has parameters for.

    >>> call("statistics.fmean", {"data": [3, 4], "weights": None, "unused": 1})
    3.5
    """
    found = find(function)
    return found(**{name: arguments[name] for name in inspect.signature(found).parameters})
