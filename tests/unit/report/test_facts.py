"""What the page says of the run."""

import re
import tomllib
from pathlib import Path

from cccd_workflow.report.facts import PACKAGES

ROOT = Path(__file__).parents[3]


def test_the_packages_named_are_those_that_are_used():
    # what is declared is imported: tests/unit/test_environment.py
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [name for names in project["optional-dependencies"].values() for name in names]
    declared = {re.match(r"[\w.-]+", name)[0].lower() for name in [*project["dependencies"], *extras]}
    assert {name.lower() for name in PACKAGES} - {"snakemake"} <= declared
