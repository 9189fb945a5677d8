"""Volumes as NIfTI.

That no half file is left is the caller's to see to (`cccd.store.atomic_path`).
"""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from nibabel.nifti1 import Nifti1Image

from cccd.geometry.arrays import FloatArray
from cccd.tolerances import ORTHOGONALITY


def write_nifti(path: str | Path, values: npt.NDArray[np.integer | np.floating], affine: FloatArray) -> None:
    """Write a volume as NIfTI (mm, RAS); the same bytes for the same volume.

    Parameters
    ----------
    path : path
        Compressed when it ends with ``.gz``.
    values : (a, b, c) array
        Of the type in which they are to be stored.
    affine : (4, 4) float64
        ``world_mm = affine @ (a, b, c, 1)``.
    """
    image: Any = Nifti1Image(values, affine)
    image.set_sform(affine, code=1)
    columns = affine[:3, :3] / np.linalg.norm(affine[:3, :3], axis=0)
    tilted = np.abs(columns.T @ columns - np.eye(3)).max() > ORTHOGONALITY
    image.set_qform(affine, code=0 if tilted else 1)  # a qform has no shear: readers shall take the sform
    image.header.set_xyzt_units("mm")
    content = image.to_bytes()  # nibabel would not know the format of a name that ends with .gz alone
    if Path(path).suffix == ".gz":
        content = gzip.compress(content, compresslevel=6, mtime=0)
    Path(path).write_bytes(content)
