"""What the pages and the report name is there: columns, packages, files."""

import ast
import re
import tomllib

from support import ROOT, SCRIPTS

from cccd_labels.between import DISTANCES
from cccd_workflow.report.facts import PACKAGES
from cccd_workflow.report.measures import MEASURES

PAGE = ROOT / "docs" / "tables.md"


def test_every_column_is_explained():
    sections = PAGE.read_text(encoding="utf-8").split("## ")
    named = [
        set(re.findall(r"`([a-z_0-9]+)`", "".join(re.findall(r"^\|[^|]*\|", part, re.M))))
        for part in sections
    ]
    boxes = {f"{side}_{axis}_mm" for side in ("lowest", "highest") for axis in "xyz"}  # from ... to ...
    columns = {"case", "organ", "warnings", *(measure.name for measure in MEASURES)}
    assert named[1] | boxes == columns
    assert named[2] == set(DISTANCES)


def test_the_packages_named_are_those_that_are_used():
    # what is declared is imported: tests/unit/test_environment.py
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [name for names in project["optional-dependencies"].values() for name in names]
    declared = {re.match(r"[\w.-]+", name)[0].lower() for name in [*project["dependencies"], *extras]}
    assert {name.lower() for name in PACKAGES} - {"snakemake"} <= declared


FOLDER = SCRIPTS / "cccd_workflow" / "report"


def test_the_reader_alone_names_files():
    named = {
        path.stem
        for path in FOLDER.glob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and " " not in node.value
        and node.value.endswith((".h5", ".ply"))
    }
    assert named == {"results"}
