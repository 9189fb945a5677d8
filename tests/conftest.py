"""A tiny cohort, run for real: the pipeline in a copy of the project, so that tests may edit modules."""

import fcntl
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PARTS = ("Snakefile", "profiles", "workflow", "scripts", "config", "envs")


@dataclass
class Project:
    """A copy of the project and how to run it."""

    folder: Path

    @property
    def results(self) -> Path:
        return self.folder / "results"

    def snakemake(self, *arguments, check=True, **options) -> subprocess.CompletedProcess:
        """Run ``snakemake --cores 2`` with the tiny configuration; raises with its output when it fails."""
        run = subprocess.run(self.command(*arguments), **(self.surroundings() | options), check=False)
        if check and run.returncode:
            raise AssertionError(f"snakemake ended with {run.returncode}\n{run.stdout}\n{run.stderr}")
        return run

    def command(self, *arguments) -> list[str]:
        base = [sys.executable, "-m", "snakemake", "--configfile", "tiny.yaml", "--cores", "2"]
        return [*base, *map(str, arguments)]

    def surroundings(self) -> dict:
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        return {
            "cwd": self.folder,
            "env": os.environ | threads | {"PWD": str(self.folder)},
            "capture_output": True,
            "encoding": "utf-8",
            "timeout": 1200,
        }

    def planned(self, *arguments) -> dict[str, int]:
        """Rule -> number of jobs that a run would start now."""
        lines = self.snakemake("--dry-run", *arguments).stdout.splitlines()
        if "Job stats:" not in lines:
            return {}
        table = lines[lines.index("Job stats:") + 3 :]
        rows = [line.split() for line in table[: table.index("")]]
        return {rule: int(count) for rule, count in rows if rule != "total"}


def copy_project(folder: Path) -> Project:
    """Copy the project's sources and write the tiny cohort and its configuration beside them."""
    # what Numba compiled comes along: it goes by the sources' times, which the copy keeps
    ignore = shutil.ignore_patterns(".snakemake", "results")
    for part in PARTS:
        source = ROOT / part
        if source.is_dir():
            shutil.copytree(source, folder / part, ignore=ignore)
        else:
            folder.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, folder)
    tiny = Path(__file__).parent / "tiny"
    shutil.copy(tiny / "tiny.yaml", folder)
    shutil.copy(tiny / "tiny.tsv", folder)
    return Project(folder)


@pytest.fixture(scope="session")
def tiny_run(tmp_path_factory) -> Project:
    """The tiny cohort, reconstructed from the import to the report. Shared: leave it as it is."""
    base = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:  # one run for all workers, which have folders of their own
        base = base.parent
    folder = base / "tiny" / "project"
    with (base / "tiny.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "results" / "report.html").exists():
            shutil.rmtree(folder, ignore_errors=True)
            copy_project(folder).snakemake()
    return Project(folder)


@pytest.fixture
def tiny_copy(tiny_run, tmp_path) -> Project:
    """A copy of the finished tiny run, times kept, to break and to repair."""
    shutil.copytree(tiny_run.folder, tmp_path / "project", symlinks=True)
    return Project(tmp_path / "project")


@pytest.fixture
def fresh_project(tmp_path) -> Project:
    """The project before its first run."""
    return copy_project(tmp_path / "project")
