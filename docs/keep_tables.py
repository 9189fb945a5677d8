"""Keep what the measured page shows of a run: small CSV files in ``docs/measured``, committed with the page.

python docs/keep_tables.py RESULTS
"""

from __future__ import annotations

import platform
import subprocess
import sys
from pathlib import Path

import pandas as pd

_SURFACE = (
    "case", "organ", "method", "chosen", "setting", "dice_3d", "assd_mm", "hd95_mm", "volume_bias",
    "curvature_per_area_mm", "closed_manifold", "self_intersections", "genus", "genus_true",
    "normals_median_deg", "bytes", "seconds",
)  # fmt: skip

#: The run's tables and the columns that the page needs.
TABLES: dict[str, tuple[str, ...]] = {
    "structures": (
        "case", "organ", "slices", "dice_3d", "assd_mm", "hd95_mm", "volume_bias", "closed_manifold",
        "self_intersections", "genus", "genus_true", "normals_median_deg", "normals_p90_deg",
        "control_points", "control_bytes", "compactness",
    ),
    "surfaces": _SURFACE,
    "thick_slices": (*_SURFACE, "slice_distance_mm", "every_nth"),
    "table1_corners": (
        "organ", "image", "method", "parameters", "corners", "on_boundary", "false_percent",
        "paper_corners", "paper_on_boundary", "paper_false_percent",
    ),
    "table2_fuse": (
        "organ", "image", "method", "parameters", "order", "dice_percent", "control_points",
        "self_intersecting_percent", "paper_dice_percent", "paper_control_points",
    ),
    "figure11_rates": (
        "organ", "image", "method", "parameters", "control_points", "TP rate", "FP rate", "TN rate",
        "FN rate", "ACC", "MC", "PRE", "SPEC", "DSC", "JI",
    ),
    "table3_segmentation": (
        "organ", "method", "parameters", "boundary_pixels_used", "of_boundary_pixels", "dice_percent",
        "memory_kb", "outline_kb", "note", "paper_boundary_pixels_used", "paper_dice_percent",
        "paper_memory_kb",
    ),
    "table4_reconstruction": (
        "organ", "points", "method", "given", "n_points", "connected", "disconnected", "closed_percent",
        "dice_percent", "rank", "paper_connected", "paper_disconnected",
    ),
    "figure15_snakes": ("organ", "method", "setting", "radius", "offset", "dice_percent", "least", "most"),
    "k_sweep": (
        "case", "organ", "detector", "criterion", "parameters", "values", "share", "too_few", "ACC", "DSC",
        "JI", "rotation", "scale", "noise",
    ),
    "table5_times": (
        "organ", "method", "parameters", "corner_ms", "curve_ms", "paper_corner_s", "paper_curve_s",
    ),
    "algorithm_1": (
        "case", "organ", "method", "slices", "closed", "control_points", "share", "dice_2d", "dice_3d",
        "assd_mm", "hd95_mm", "volume_bias", "genus", "genus_true", "seconds",
    ),
    "stage_times": ("case", "organ", "method", "total_ms", "surface_ms", "closed_share", "dice_3d"),
    "corner_surfaces": (
        "case", "organ", "k", "slices", "share", "dice_2d", "dice_3d", "assd_mm", "stack_bytes", "seconds",
    ),
    "junctions": ("decoder", "kind", "maps", "correct", "dice"),
    "map_surfaces": (
        "case", "organ", "method", "slices", "decided", "dice_3d", "assd_mm", "hd95_mm",
    ),
    "segmenters": ("case", "organ", "method", "given", "dice_percent", "assd_mm"),
    "compactness": ("case", "organ", "spline", "chain_code", "png", "raw"),
}  # fmt: skip

#: Of these tables the page shows some rows alone.
_ROWS = {
    "junctions": "kind == 'all ten'",
}


def keep_tables(results: Path, folder: Path) -> None:
    """Copy what the page shows of a run's ``results/tables`` into a folder, in four digits.

    Parameters
    ----------
    results : path
        ``results/`` of a finished run; ``benchmarks/`` stands beside it.
    folder : path
        Gets a CSV file per table, and ``run.csv``: what ran, where, and how long.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name, columns in TABLES.items():
        table = pd.read_csv(results / "tables" / f"{name}.csv")
        table = table.query(_ROWS[name]) if name in _ROWS else table
        kept = [column for column in columns if column in table]
        table[kept].to_csv(folder / f"{name}.csv", index=False, float_format="%.4g")
    _run_facts(results.parent).to_csv(folder / "run.csv", index=False, float_format="%.4g")


def _run_facts(run: Path) -> pd.DataFrame:
    """Processor seconds of a run's jobs, rule by rule, and the machine and version that they ran on."""
    jobs = []
    for file in sorted((run / "benchmarks").rglob("*.tsv")):
        spent = pd.read_csv(file, sep="\t")
        place = file.relative_to(run / "benchmarks").parent.as_posix()
        seconds = pd.to_numeric(spent["cpu_time"], errors="coerce").sum()
        jobs.append({"fact": "cpu_s", "place": place, "rule": file.stem, "value": round(float(seconds), 1)})
    commit = subprocess.run(
        ["git", "-C", str(run), "rev-parse", "--short", "HEAD"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    model = [line for line in Path("/proc/cpuinfo").read_text().splitlines() if "model name" in line]
    facts = {
        "commit": commit.stdout.strip() or "unknown",
        "jobs": len(jobs),
        "processor seconds": round(sum(job["value"] for job in jobs)),
        "machine": model[0].partition(":")[2].strip() if model else platform.machine(),
        "python": platform.python_version(),
    }
    named = [{"fact": name, "place": "", "rule": "", "value": value} for name, value in facts.items()]
    return pd.DataFrame([*named, *jobs])


if __name__ == "__main__":
    keep_tables(Path(sys.argv[1]).resolve(), Path(__file__).resolve().parent / "measured")
