"""Segmenters that users may have installed beside: called by their own commands."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray
from cccd.volumes.grid import Volume, on_grid
from cccd.volumes.nifti_export import write_nifti
from cccd.volumes.readers import read_volume

__all__ = ["COMMANDS", "run_external"]

#: What is typed for each, and how it is installed.
COMMANDS = {
    "totalsegmentator": ("TotalSegmentator", "pip install TotalSegmentator"),
}


def run_external(name: str, image: Volume, organ: str) -> AnyArray:
    """Run an installed segmenter on a scan.

    Parameters
    ----------
    name : str
        Key of `COMMANDS`.
    image : Volume
    organ : str
        In the segmenter's words: TotalSegmentator's ``liver``, ``kidney_left``, ...

    Returns
    -------
    (a, b, c) uint8
        1 in the organ, on the scan's grid.

    Raises
    ------
    InputError
        It is not installed, or ended with an error, or knows no such organ.
    """
    command, installation = COMMANDS[name]
    program = shutil.which(command)
    if program is None:
        raise InputError("config key segmenter", f"{command} is not installed", installation)
    with tempfile.TemporaryDirectory() as folder:
        scan, found = Path(folder, "scan.nii.gz"), Path(folder, "found")
        write_nifti(scan, np.rint(image.data).astype(np.int16), image.affine)
        arguments = [program, "-i", str(scan), "-o", str(found), "--roi_subset", organ]
        run = subprocess.run(arguments, capture_output=True, text=True, check=False)
        mask = found / f"{organ}.nii.gz"
        if run.returncode or not mask.is_file():
            said = next((line for line in reversed(run.stderr.splitlines()) if line.strip()), "no word")
            raise InputError(
                image.location, f"{command} gave no {organ} ({said.strip()})", "run it by hand to see more"
            )
        moved = on_grid(read_volume(mask), image.affine, image.shape, fill=0)
    if moved is None:
        raise InputError(image.location, f"{command}'s mask lies on another grid", "report this")
    return (moved.data > 0).astype(np.uint8)
