import textwrap
from pathlib import Path

import pytest
from support import SCRIPTS, fresh

from cccd.plugins import folders, table
from cccd_workflow.dependencies import imported_files

LIBRARIES = folders()


@pytest.fixture
def tree(tmp_path):
    def write(name, text=""):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    write("lib/__init__.py")
    write("lib/a.py", "from . import b")
    write("lib/b.py", "import numpy\ndef f():\n    from lib.sub.c import g")
    write("lib/sub/__init__.py", "from ..d import x")
    write("lib/sub/c.py", "import lib.a")
    write("lib/d.py")
    write("lib/stranger.py")
    return write


def test_closure_follows_relative_nested_circular_and_package_imports(tree, tmp_path):
    script = tree("run.py", "from lib.a import thing\nimport os")
    names = {path.relative_to(tmp_path).as_posix() for path in imported_files(script, [tmp_path / "lib"])}
    assert names == {f"lib/{name}.py" for name in ("__init__", "a", "b", "d", "sub/__init__", "sub/c")}


def test_modules_that_are_given_by_name_are_followed(tree, tmp_path):
    script = tree("run.py", "import os")
    names = {path.name for path in imported_files(script, [tmp_path / "lib"], ["lib.stranger", "lib.sub.c"])}
    assert names == {"__init__.py", "stranger.py", "c.py", "a.py", "b.py", "d.py"}


def test_other_packages_are_followed_and_strangers_are_not(tree, tmp_path):
    tree("beside/__init__.py")
    tree("beside/a.py", "from lib.d import x\nimport stranger.b")
    tree("stranger/b.py")
    script = tree("run.py", "import beside.a")
    found = imported_files(script, [tmp_path / "lib", tmp_path / "beside"])
    names = {path.relative_to(tmp_path).as_posix() for path in found}
    assert names == {"beside/__init__.py", "beside/a.py", "lib/__init__.py", "lib/d.py"}


def test_submodule_taken_from_its_package_counts(tree, tmp_path):
    script = tree("run.py", "from lib import stranger")
    names = {path.name for path in imported_files(script, [tmp_path / "lib"])}
    assert names == {"__init__.py", "stranger.py"}


#: A module of the report, which shows what all others make.
REPORT = "../cccd_workflow/report/render.py"

#: What an edit of must not run a stage again, by the stage's script.
LATER = {
    "import_structure": [
        *("surface/loft.py", REPORT, "settings/surface.py", "settings/curves.py"),
        *("curves/fitting.py", "../cccd_junctions/network.py"),
    ],
    "fit_curves": ["surface/loft.py", REPORT],
    "train_gnn": ["surface/loft.py", REPORT, "settings/surface.py", "settings/curves.py"],
    "loft_surface": [
        "settings/junctions.py",
        "../cccd_junctions/network.py",
        "../cccd_labels/shared_walls.py",
    ],
    "take_surface": ["settings/junctions.py", "../cccd_junctions/network.py"],
}


@pytest.mark.parametrize("script", LATER)
def test_an_edit_runs_no_stage_before_it_again(script):
    later = {(SCRIPTS / "cccd" / module).resolve() for module in LATER[script]}
    assert all(path.is_file() for path in later)
    readers = [reader.read.rpartition(".")[0] for reader in table("READERS").values()]
    modules = readers if script == "import_structure" else []
    assert later & set(imported_files(SCRIPTS / f"{script}.py", LIBRARIES, modules)) == set()


@pytest.mark.parametrize("name", ["import_structure", "loft_surface", "measure_structure"])
def test_the_closure_holds_every_module_that_a_script_really_loads(name):
    script = SCRIPTS / f"{name}.py"
    probe = """
        import ast, pathlib, sys
        tree = ast.parse(pathlib.Path(sys.argv[1]).read_text())
        tree.body = [node for node in tree.body if isinstance(node, (ast.Import, ast.ImportFrom))]
        exec(compile(tree, sys.argv[1], "exec"))
        assert not {"matplotlib", "numba", "pandas", "torch"} & sys.modules.keys()  # .2 s and more each
        names = [name for name in sys.modules if name.split(".")[0].startswith("cccd")]
        tables = {part for name in names if name.endswith(".plugin") for part in (name, name.split(".")[0])}
        modules = [sys.modules[name] for name in names if name not in tables - {"cccd"}]
        print(*(module.__file__ for module in modules), sep="\\n")
    """
    loaded = {Path(line) for line in fresh.python(textwrap.dedent(probe), script).split()}
    assert loaded <= set(imported_files(script, LIBRARIES))
