"""Plain pytest where extras are missing: nothing fails, and what skips is named, to be run elsewhere."""

import os
import shutil
import subprocess
import sys

from support import ROOT

WITHOUT = "import sys; sys.modules[sys.argv[1]] = None; import pytest; sys.exit(pytest.main(sys.argv[2:]))"
OPTIONS = ("-n", "0", "-p", "no:cacheprovider", "--doctest-modules", "--skipped", "skipped", "--rootdir", ".")

#: What an example imports, and whether it skips where pytetwild, which an extra brings, is not there.
EXAMPLES = {"pytetwild.mesh": True, "no_such_module": False, "pydicom.no_such_module": False}


def test_only_what_an_extra_would_bring_skips_and_is_named(tmp_path):
    shutil.copy(ROOT / "conftest.py", tmp_path)
    texts = (f'def f{n}():\n    """\n    >>> import {name}\n    """\n' for n, name in enumerate(EXAMPLES))
    (tmp_path / "examples.py").write_text("\n".join(texts))
    (tmp_path / "test_whole.py").write_text('import pytest\n\npytest.importorskip("pytetwild")\n')
    env = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    env["PYTHONPATH"] = str(ROOT / "scripts")
    command = [sys.executable, "-c", WITHOUT, "pytetwild", *OPTIONS, "examples.py", "test_whole.py"]
    run = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert run.returncode == 1, run.stderr
    assert "2 failed, " in run.stdout
    skipped = [f"examples.py::examples.f{n}" for n, skips in enumerate(EXAMPLES.values()) if skips]
    assert set((tmp_path / "skipped").read_text().splitlines()) == {*skipped, "test_whole.py"}
