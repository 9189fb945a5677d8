"""Plain pytest where extras are missing: nothing fails, and what skips is named, to be run elsewhere."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]

WITHOUT = "import sys; sys.modules[sys.argv[1]] = None; import pytest; sys.exit(pytest.main(sys.argv[2:]))"
OPTIONS = ("-n", "0", "-p", "no:cacheprovider")


def pytest_without(module, *arguments, cwd=ROOT):
    """Run pytest in one process, which has no such module."""
    env = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    env["PYTHONPATH"] = str(ROOT / "scripts")
    command = [sys.executable, "-c", WITHOUT, module, *OPTIONS, *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, check=False)


def test_an_example_whose_extra_is_missing_skips_and_is_named(tmp_path):
    example = "scripts/cccd_tetrahedra/filling.py::cccd_tetrahedra.filling.fill_organs"
    skipped = tmp_path / "skipped"
    run = pytest_without(
        "pytetwild", "--skipped", skipped, example, "tests/unit/tetrahedra/test_mechanics.py"
    )
    assert run.returncode == 0, run.stdout
    assert "2 skipped" in run.stdout
    assert set(skipped.read_text().splitlines()) == {example, "tests/unit/tetrahedra/test_mechanics.py"}


def test_only_what_an_extra_would_bring_skips(tmp_path):
    shutil.copy(ROOT / "conftest.py", tmp_path)
    absent, wrong, broken = "import pytetwild.mesh", "import no_such_module", "import pydicom.no_such_module"
    texts = (
        f'def f{i}():\n    """\n    >>> {line}\n    """\n' for i, line in enumerate((absent, wrong, broken))
    )
    (tmp_path / "examples.py").write_text("\n".join(texts))
    run = pytest_without("pytetwild", "--doctest-modules", "examples.py", cwd=tmp_path)
    assert run.returncode == 1, run.stderr
    assert "2 failed, 1 skipped" in run.stdout
