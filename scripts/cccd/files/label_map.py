"""A label map on the scan's grid (NIfTI)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cccd.files.options import ExportOptions
from cccd.geometry.raster import voxelise
from cccd.inputs.annotation import fill_mask
from cccd.inputs.nifti_export import write_nifti
from cccd.surface.surface import LoftedSurface

__all__ = ["write"]


def write(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write the voxels inside as 1; slices that were drawn, where only some were, as they were drawn."""
    frame = surface.frame.of_file
    if options.drawn is None:
        mask = voxelise(surface.mesh, frame.affine, frame.shape)
    else:
        mask = fill_mask(options.drawn, surface.mesh, whole=True)
    write_nifti(path, mask.astype(np.uint8), frame.affine)
