"""The page of the tables' columns names every column, and no other."""

import re
from pathlib import Path

from cccd.surface.between import DISTANCES
from cccd_workflow.report.measures import MEASURES

PAGE = Path(__file__).parents[3] / "docs" / "tables.md"


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
