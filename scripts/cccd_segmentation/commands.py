"""The command ``cccd segment``."""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path

import cccd
from cccd.commands import check_files, check_outputs, describe_surface, plain_stem, print_surface
from cccd.errors import InputError
from cccd.inputs.load import existing
from cccd.inputs.row_files import read_image
from cccd_networks.devices import DEVICE
from cccd_segmentation.segment import find_segmenter, segment, write_labels


def add_segment(command: argparse.ArgumentParser) -> None:
    """Find an organ with a trained network.

    Writes its labels on the scan's own grid, and one surface of all labels.
    """
    command.add_argument("input", type=Path, help="scan (NIfTI, NRRD, MHA) or the folder of a DICOM series")
    command.add_argument(
        "--segmenter", required=True, metavar="WEIGHTS",
        help="weights (model.pt, or shipped: hippocampus), totalsegmentator, or nnunetv2:FOLDER",
    )  # fmt: skip
    command.add_argument("--organ", help="what to look for; default: what the weights were trained to find")
    command.add_argument(
        "-o", "--output", type=Path, action="append", default=[], metavar="FILE",
        help="the surface, repeatable, as in cccd surface; default: the scan's name with .ply",
    )  # fmt: skip
    command.add_argument(
        "--labels",
        type=Path,
        metavar="FILE",
        help="the label map; default: the scan's name with _labels.nii.gz, in this folder",
    )
    command.add_argument(
        "--device",
        choices=["auto", "cpu", "cuda"],
        help="where the network runs; default: a GPU if there is one",
    )
    command.add_argument("--json", action="store_true", help="print JSON")
    command.set_defaults(run=_segment)


def _segment(given: argparse.Namespace) -> int:
    if given.device:
        os.environ[DEVICE] = given.device
    stem = plain_stem(given.input)
    outputs, labels = given.output or [Path(f"{stem}.ply")], given.labels or Path(f"{stem}_labels.nii.gz")
    check_outputs(outputs, [given.input])
    if not labels.name.lower().endswith((".nii.gz", ".nii")):
        raise InputError(str(labels), "labels are written as NIfTI", "end its name with .nii.gz")
    check_files([*outputs, labels], [given.input])
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
    made = describe_surface(surface, [*outputs, labels], time.perf_counter() - began)
    made |= {"organ": organ, "segmenter": found.segmenter, "warnings": [*found.warnings, *made["warnings"]]}
    if given.json:
        print(json.dumps(made, indent=2))
    else:
        print_surface(made)
    return 0
