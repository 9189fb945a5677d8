"""What the page says about the run: versions and the commit."""

from __future__ import annotations

import platform
import subprocess
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

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
    command = ["git", "-C", str(folder), "describe", "--always", "--abbrev=12", "--exclude=*"]
    command += ["--dirty= with uncommitted changes"]
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=10, check=True).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return "not from a git checkout"
