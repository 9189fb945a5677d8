"""What every structure's own files hold, gathered into tables over the cohort."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import pandas as pd

__all__ = ["compactness", "gather", "structures"]

#: Columns of the cohort's overview, and where they stand in ``metrics.json``.
OVERVIEW = {
    "slices": ("curves", "slices"),
    "curves": ("curves", "curves"),
    "boundary_points": ("curves", "boundary_points"),
    "spline_control_points": ("curves", "control_points"),
    "spline_dice_median": ("curves", "dice_median"),
    "spline_dice_p5": ("curves", "dice_p5"),
    "area_kept": ("curves", "area_kept"),
    "dice_3d": ("surface", "dice_3d"),
    "assd_mm": ("surface", "assd_mm"),
    "hd95_mm": ("surface", "hd95_mm"),
    "volume_ml": ("surface", "volume_ml"),
    "volume_bias": ("surface", "volume_bias"),
    "closed_manifold": ("surface", "closed_manifold"),
    "self_intersections": ("surface", "self_intersections"),
    "control_points": ("surface", "control_points"),
    "control_bytes": ("surface", "control_bytes"),
    "compactness": ("surface", "compactness"),
}


def gather(files: Iterable[str | Path]) -> pd.DataFrame:
    """Stack the structures' tables ``<case>/<organ>/comparisons/<name>.csv``, each row with its names."""
    parts = []
    for file in map(Path, files):
        if not file.read_text(encoding="utf-8").strip():
            continue  # a structure that this comparison cannot be made on
        part = pd.read_csv(file)
        case, organ = file.parts[-4:-2]
        parts.append(part.drop(columns=["case", "organ"], errors="ignore").assign(case=case, organ=organ))
    if not parts:
        return pd.DataFrame(columns=["case", "organ"])
    table = pd.concat(parts, ignore_index=True)
    return table[["case", "organ", *table.columns.drop(["case", "organ"])]]


def _look_up(metrics: Mapping, path: tuple[str, ...]):
    for key in path:
        metrics = metrics.get(key, {})
    return None if metrics == {} else metrics


def _read(files: Iterable[str | Path]) -> list[dict]:
    return [json.loads(Path(file).read_text(encoding="utf-8")) for file in files]


def structures(files: Iterable[str | Path]) -> pd.DataFrame:
    """One row per structure from its ``metrics.json``; what it cannot have stays empty."""
    rows = [
        {"case": metrics["case"], "organ": metrics["organ"]}
        | {name: _look_up(metrics, path) for name, path in OVERVIEW.items()}
        | {"warnings": len(metrics["warnings"])}
        for metrics in _read(files)
    ]
    return pd.DataFrame(rows, columns=["case", "organ", *OVERVIEW, "warnings"])


def compactness(files: Iterable[str | Path]) -> pd.DataFrame:
    """Bytes per slice of every way to keep a structure's contours; the paper: 19.2 KB to 1.03 KB."""
    return pd.DataFrame(
        [
            {
                "case": metrics["case"],
                "organ": metrics["organ"],
                **metrics["curves"].get("bytes_per_slice", {}),
            }
            for metrics in _read(files)
        ]
    )
