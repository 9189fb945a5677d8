"""The command ``cccd``: surfaces from files in one process, and the workflow from anywhere.

Commands are rows of a table (`cccd.plugins`). A command is loaded when it is given, so that ``cccd --help``
is there at once.
"""

from __future__ import annotations

import argparse
import errno
import re
import signal
import sys
import warnings
from collections.abc import Sequence

from cccd.console import interruptible, print_error
from cccd.errors import InputError, MergedLabels
from cccd.extras import missing_extra
from cccd.plugins import find, own_rows, table

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
    words = _with_ranges_joined(given[:cut])
    parser = _parser(words)
    parsed = parser.parse_args(words)
    if parsed.command is None:
        parser.print_help()
        return 0
    parsed.further = given[cut + 1 :]
    try:
        if parsed.further and parsed.command != "run":
            raise InputError("--", "only cccd run passes arguments to Snakemake", "leave them out")
        with interruptible(), warnings.catch_warnings():  # of Python; commands say it in one line
            warnings.simplefilter("ignore", MergedLabels)
            return parsed.run(parsed)
    except InputError as error:
        return print_error(str(error))
    except ModuleNotFoundError as error:
        return print_error(str(missing_extra(error, f"cccd {parsed.command}")))
    except MemoryError:
        return print_error("out of memory; crop the scan to the organ, or use a larger machine")
    except KeyboardInterrupt as error:
        return print_error("interrupted; no half-written file is left", 128 + (*error.args, signal.SIGINT)[0])
    except OSError as error:
        if error.errno == errno.EPIPE:  # the reader of our output has gone
            return 1
        return print_error(
            f"{error.filename or 'file'}: {error.strerror or error}; check the folder's rights and space"
        )


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


def _parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """Make the parser of all commands, with the arguments of the one that is given."""
    from cccd import __version__

    parser = argparse.ArgumentParser(
        prog="cccd",
        description="Smooth, watertight spline surfaces of organs from stacks of CT and MR slices.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"cccd {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="command")
    asked = next((word for word in words if not word.startswith("-")), None)
    own = own_rows("COMMANDS")  # help and errors of one of these name no other
    for name, row in (own if {*words[:1]} & {*own} else table("COMMANDS")).items():
        command = commands.add_parser(name, help=row.help)
        if name == asked:
            add_arguments = find(row.arguments)
            command.description = add_arguments.__doc__
            add_arguments(command)
    return parser


if __name__ == "__main__":
    sys.exit(main())
