"""The report shows what others computed: its reader alone names files. Imports are in test_layers.py."""

import ast
from pathlib import Path

FOLDER = Path(__file__).parents[3] / "scripts" / "cccd_workflow" / "report"


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
