"""The command ``cccd next``: for masks that are annotated in part."""

from __future__ import annotations

import argparse
import json

from cccd.commands.arguments import add_input, read_given
from cccd.errors import InputError
from cccd.settings.root import Settings


def add_next(command: argparse.ArgumentParser) -> None:
    """Name the slice in the middle of the widest gap of a partly annotated mask."""
    add_input(command)
    command.set_defaults(run=_next)


def _next(given: argparse.Namespace) -> int:
    structure = read_given(given, Settings())
    gaps = [] if structure.annotation is None else structure.annotation.gaps
    if not gaps:
        problem = "no slice is left to draw between those that are annotated"
        raise InputError(structure.organ, problem, "give a mask of some slices, or --annotated nonempty")
    axis = structure.frame.slice_axis
    if given.json:
        slices = [{"slice": number, "gap": gap} for number, gap in gaps]
        print(json.dumps({"input": str(given.input), "axis": axis, "slices": slices}, indent=2))
        return 0
    number, gap = gaps[0]
    print(f"annotate slice {number} next (axis {axis}, counted from 0), in the middle of {gap} that are not")
    return 0
