"""The report shows what others computed: it imports no stage, and its reader alone names the files."""

import ast
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[3] / "scripts" / "cccd" / "report"
STAGES = ("boundary", "chaincode", "curves", "junctions", "metrics", "surface", "tracing", "volumes")


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.py")), ids=lambda path: path.stem)
def test_no_stage_is_imported_and_no_file_named(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    imported = {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    imported |= {name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names}
    assert not {name for name in imported if name.split(".")[1:2] and name.split(".")[1] in STAGES}
    assert "h5py" not in imported
    texts = [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " not in node.value
    ]
    named = [text for text in texts if text.endswith((".h5", ".ply"))]
    assert not named or path.stem == "results"
