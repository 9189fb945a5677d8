"""The pins of the pip and conda environments and the library's own bounds agree."""

import re
import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]


def pins(lines):
    return dict(re.fullmatch(r"([\w.-]+)==(\S+)", line).groups() for line in lines)


def requirements():
    lines = (ROOT / "envs" / "requirements.txt").read_text().splitlines()
    return pins(line for line in lines if line and not line.startswith("#"))


def test_conda_twin_has_the_same_pins():
    environment = yaml.safe_load((ROOT / "envs" / "cccd.yaml").read_text())
    (twin,) = (part["pip"] for part in environment["dependencies"] if isinstance(part, dict))
    assert pins(twin) == requirements()


def test_library_dependencies_are_pinned():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    pinned = {re.sub(r"[-_.]+", "-", name).lower() for name in requirements()}
    wanted = {
        re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", item)[0]).lower() for item in project["dependencies"]
    }
    assert wanted <= pinned


def test_one_version():
    import cccd

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert project["version"] == cccd.__version__ == citation["version"]
