"""Arguments that several commands have, and what they say."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from cccd.errors import InputError
from cccd.plugins import find, table

if TYPE_CHECKING:
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
        from cccd.settings.validation import read_config

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
