"""The wheel holds all that its commands need, and they work where there is no checkout."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile

import nibabel
import numpy as np
import pytest
from support import ROOT

PARTS = (
    "pyproject.toml",
    "README.md",
    "LICENSE",
    "Snakefile",
    "config",
    "envs",
    "profiles",
    "scripts",
    "workflow",
)

BUILD = "from setuptools.build_meta import build_wheel; build_wheel('.')"


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The wheel's content, unpacked as pip does."""
    setuptools = pytest.importorskip("setuptools")
    if int(setuptools.__version__.split(".")[0]) < 77:
        pytest.skip("the wheel is built by setuptools 77 or later (envs/checks.txt)")
    source = tmp_path_factory.mktemp("source")
    ignore = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for part in PARTS:
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, source / part, ignore=ignore)
        else:
            shutil.copy(ROOT / part, source)
    subprocess.run([sys.executable, "-c", BUILD], cwd=source, capture_output=True, check=True)
    (wheel,) = source.glob("cccd_surfaces-*.whl")
    site = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(wheel) as file:
        file.extractall(site)
    return site


def cccd(installed, *arguments, cwd):
    """Type a command in a folder that knows no checkout."""
    env = os.environ | {"PYTHONPATH": str(installed)}
    command = [sys.executable, "-m", "cccd", *arguments]
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, check=False)


def test_every_package_and_every_file_of_the_workflow_is_in_the_wheel(installed):
    named = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    scripts = ROOT / "scripts"
    files = [path for package in scripts.glob("cccd*") for path in package.rglob("*")]
    folders = [path.parent.relative_to(scripts) for path in files if path.name == "__init__.py"]
    assert set(named) == {".".join(folder.parts) for folder in folders} | {"cccd.pipeline"}
    for path in files:
        if path.is_file() and path.suffix in (".py", ".pyi", ".npz", ".txt", ".typed"):
            assert (installed / path.relative_to(scripts)).is_file(), path
    carried = [ROOT / "Snakefile", ROOT / "LICENSE", ROOT / "envs" / "cccd.yaml"]
    carried += [*(ROOT / "scripts").glob("*.py"), *(ROOT / "config").glob("*.[ty]*")]
    folders = [ROOT / "workflow", ROOT / "profiles"]
    carried += [path for folder in folders for path in folder.rglob("*") if path.is_file()]
    left = [path for path in carried if path.parent.name.startswith("phantom_")]  # for Table 3 alone
    assert left
    assert not [path for path in left if (installed / "cccd" / "pipeline" / path.relative_to(ROOT)).exists()]
    for path in set(carried) - set(left):
        inside = installed / "cccd" / "pipeline" / path.relative_to(ROOT)
        assert inside.read_bytes() == path.read_bytes(), path
    (points,) = installed.glob("cccd_surfaces-*.dist-info/entry_points.txt")
    assert "cccd = cccd.cli:main" in points.read_text()


def test_the_wheel_has_a_name_of_its_own_and_the_command_its_old_one(installed, tmp_path):
    (about,) = installed.glob("*.dist-info/METADATA")
    lines = about.read_text(encoding="utf-8").splitlines()
    assert "Name: cccd-surfaces" in lines  # "cccd" is somebody else's in the public registry
    needed = {
        re.match(r"Requires-Dist: ([\w.-]+)", line)[1] for line in lines if line.startswith("Requires-Dist")
    }
    assert "cccd" not in needed
    assert cccd(installed, "--version", cwd=tmp_path).stdout.startswith("cccd ")


def test_a_cohort_is_planned_from_the_wheel_alone(installed, tmp_path):
    mask = np.zeros((20, 20, 10), np.uint8)
    mask[4:16, 4:16, 2:8] = 1
    nibabel.save(nibabel.Nifti1Image(mask, np.diag([1, 1, 2, 1])), tmp_path / "box.nii.gz")
    (tmp_path / "sheet.tsv").write_text("case\torgan\tmask\nanna\tbox\tbox.nii.gz\n")
    plan = cccd(installed, "run", "sheet.tsv", "--cores", "1", "--", "--dry-run", cwd=tmp_path)
    assert plan.returncode == 0, plan.stderr
    assert "loft_surface" in plan.stdout + plan.stderr
    assert not (tmp_path / "results").exists()
