"""Phantoms as files for a benchmark: scans with slices at several distances, and the true surface."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from cccd.containers import Structure
from cccd.inputs.nifti_export import write_nifti
from cccd.store import atomic_path, read_table, write_ply


def write_scan(image: str | Path, mask: str | Path, structure: Structure) -> None:
    """Write a scan's grey values (HU, int16) and its mask (uint8) as NIfTI, cropped to the organ."""
    for path, name, kind in ((image, "image", np.int16), (mask, "mask", np.uint8)):
        with atomic_path(path) as temporary:
            write_nifti(temporary, np.asarray(getattr(structure, name)).astype(kind), structure.affine)


def write_truth(path: str | Path, structure: Structure) -> None:
    """Write the true surface as PLY, mm RAS."""
    assert structure.truth is not None  # a phantom has one
    comment = f"CCCD phantom {structure.organ}, true surface; unit mm; SPACE=RAS"
    with atomic_path(path) as temporary:
        write_ply(temporary, structure.truth, comment)


def describe_scan(structure: Structure) -> pd.DataFrame:
    """One row of the table: grid and voxels of a scan, and volume, area and genus of its true surface."""
    truth, mask = structure.truth, np.asarray(structure.mask)
    assert truth is not None
    inside = int(np.count_nonzero(mask))
    spacing = structure.frame.spacing
    row: dict[str, Any] = {
        "organ": structure.organ,
        "slice_distance_mm": spacing[2],
        "pixel_i_mm": spacing[0],
        "pixel_j_mm": spacing[1],
        "size_i": mask.shape[0],
        "size_j": mask.shape[1],
        "size_k": mask.shape[2],
        "slices": int(mask.any(axis=(0, 1)).sum()),
        "voxels": inside,
        "voxels_ml": inside * spacing.prod() / 1000,
        "volume_ml": truth.volume / 1000,
        "area_cm2": truth.area / 100,
        "bodies": truth.count_bodies(),
        "genus": truth.genus,
        "triangles": len(truth.faces),
    }
    return pd.DataFrame([row])


def gather_tables(tables: Iterable[str | Path]) -> pd.DataFrame:
    """Rows of some tables, one below the other."""
    return pd.concat([read_table(table) for table in tables])
