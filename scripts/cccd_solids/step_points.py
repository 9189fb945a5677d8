"""Points of a STEP file once each: OpenCASCADE writes those that surfaces and curves share many times."""

from __future__ import annotations

import re
from pathlib import Path

_POINT = re.compile(r"#(\d+) = CARTESIAN_POINT\('',(\([^)]*\))\);\n")
_REFERENCE = re.compile(r"#(\d+)")


def share_points(path: Path) -> None:
    """Keep the first of all equal points without names, and let what refers to the others refer to it."""
    text = path.read_text(encoding="latin-1")
    first: dict[str, str] = {}
    kept: dict[str, str] = {}
    for number, place in _POINT.findall(text):
        kept[number] = first.setdefault(place, number)

    def once(point: re.Match[str]) -> str:
        return point[0] if kept[point[1]] == point[1] else ""

    def referring(reference: re.Match[str]) -> str:
        return "#" + kept.get(reference[1], reference[1])

    path.write_text(_REFERENCE.sub(referring, _POINT.sub(once, text)), encoding="latin-1", newline="\n")
