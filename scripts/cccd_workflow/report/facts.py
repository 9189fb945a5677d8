"""What the page says about the run: versions, the commit, inputs, and time and memory per rule."""

from __future__ import annotations

import platform
import subprocess
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import pandas as pd

__all__ = ["Provenance", "benchmark_table", "provenance"]

#: Packages whose version can change a number in the report.
PACKAGES = (
    "numpy",
    "scipy",
    "numba",
    "torch",
    "torch-geometric",
    "scikit-image",
    "opencv-contrib-python-headless",
    "shapely",
    "trimesh",
    "manifold3d",
    "pyvista",
    "vtk",
    "h5py",
    "nibabel",
    "SimpleITK",
    "pydicom",
    "highdicom",
    "nilearn",
    "pandas",
    "matplotlib",
    "jinja2",
    "snakemake",
)


class Provenance(NamedTuple):
    """``packages`` maps names to versions; ``commit`` says in words what the code was."""

    version: str
    commit: str
    machine: str
    packages: dict[str, str]


def provenance() -> Provenance:
    """Versions of this library, of what it stands on, and of the machine's platform."""
    import cccd

    found = {}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    machine = f"Python {platform.python_version()}, {platform.system()} on {platform.machine()}"
    return Provenance(cccd.__version__, _commit(Path(__file__).parent), machine, found)


def _commit(folder: Path) -> str:
    """Name the git commit of the code, with a word when files were edited since."""

    def git(*arguments: str) -> str | None:
        try:
            done = subprocess.run(
                ["git", "-C", str(folder), *arguments], capture_output=True, text=True, timeout=10, check=True
            )
        except (OSError, subprocess.SubprocessError):
            return None
        return done.stdout.strip()

    commit = git("rev-parse", "--short=12", "HEAD")
    if not commit:
        return "not from a git checkout"
    edited = git("status", "--porcelain", "--untracked-files=no", "--", ":/")
    return f"{commit} with uncommitted changes" if edited else commit


def benchmark_table(folder: Path | None) -> pd.DataFrame | None:
    """Time and memory per rule from Snakemake's benchmark files; None when there are none.

    Returns
    -------
    pandas.DataFrame or None
        One row per rule: ``rule``, ``jobs``, ``total_s``, ``longest_s``, ``cpu_s``, ``peak_memory_mb``;
        the slowest rule first.
    """
    if folder is None or not folder.is_dir():
        return None
    rows = []
    for path in sorted(folder.rglob("*.tsv")):
        try:
            measured = pd.read_csv(path, sep="\t", na_values="-")
        except (pd.errors.EmptyDataError, pd.errors.ParserError):
            continue
        if measured.empty or "s" not in measured:
            continue
        last = pd.to_numeric(measured.iloc[-1], errors="coerce")
        rows.append((path.stem, last["s"], last.get("cpu_time"), last.get("max_rss")))
    if not rows:
        return None
    jobs = pd.DataFrame(rows, columns=["rule", "s", "cpu", "rss"]).astype({"cpu": float, "rss": float})
    groups = jobs.groupby("rule")
    table = pd.DataFrame(
        {
            "jobs": groups.size(),
            "total_s": groups["s"].sum(),
            "longest_s": groups["s"].max(),
            "cpu_s": groups["cpu"].sum(min_count=1),
            "peak_memory_mb": groups["rss"].max(),
        }
    )
    return table.sort_values(["total_s", "longest_s"], ascending=False).reset_index()
