"""The command ``cccd relabel``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from tqdm import tqdm

from cccd.commands import check_files, with_name
from cccd.containers import Grid
from cccd.errors import InputError
from cccd.inputs.load import existing
from cccd.inputs.nifti_export import write_nifti
from cccd.inputs.row_files import label_values, read_image
from cccd.settings.root import Settings
from cccd.store import atomic_path
from cccd_labels.relabelling import finer_grid, relabelled, share_of_voxels
from cccd_labels.whole_map import WholeMap


def add_relabel(command: argparse.ArgumentParser) -> None:
    """Make the surfaces of all labels and fill the voxels of another grid: labels never overlap.

    Labels too small for a surface get their nearest voxels.
    """
    command.add_argument("input", type=Path, help="label map")
    command.add_argument("--voxel", type=float, metavar="MM", help="edge of cubic voxels")
    command.add_argument("--like", type=Path, metavar="SCAN", help="a scan whose grid is taken")
    command.add_argument("--soft", action="store_true", help="also the share of each voxel, a file per label")
    command.add_argument("--cores", type=int, default=1, metavar="N", help="processes at once; default: 1")
    command.add_argument(
        "-o", "--output", type=Path, required=True, metavar="NIFTI", help="label map, .nii or .nii.gz"
    )
    command.set_defaults(run=_relabel)


def _relabel(given: argparse.Namespace) -> int:
    if (given.voxel is None) == (given.like is None):
        raise InputError("--voxel", "one of --voxel and --like is needed", "name one of them")
    if given.voxel is not None and not given.voxel > 0:
        raise InputError("--voxel", f"{given.voxel} is not positive", "give the edge of a voxel in mm")
    if not given.output.name.endswith((".nii", ".nii.gz")):
        raise InputError(given.output.name, "it is no NIfTI file", "name it .nii or .nii.gz")
    check_files([given.output], [given.input, given.like])
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
    with tqdm(disable=None, leave=False, bar_format="{desc:<40} {elapsed}") as progress:
        for value, surface, voxels in relabelled(whole, grid, given.cores, progress.set_description_str):
            labels.reshape(-1)[voxels] = value
            if surface is not None and given.soft:
                low, share = share_of_voxels(surface.surface.lofted.mesh, grid)
                soft = np.zeros(grid.shape, np.float32)
                soft[tuple(slice(a, a + n) for a, n in zip(low, share.shape, strict=True))] = share
                with atomic_path(with_name(given.output, surface.surface.name)) as path:
                    write_nifti(path, soft, grid.affine)
    with atomic_path(given.output) as path:
        write_nifti(path, labels, grid.affine)
    size = " x ".join(str(n) for n in grid.shape)
    print(f"{given.output}: {size} voxels, {len(np.unique(labels)) - 1} of {len(whole.labels)} labels")
    return 0
