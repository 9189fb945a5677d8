"""The pins of the pip and conda environments, the library's own bounds and what it imports agree."""

import ast
import re
import sys
import tomllib

import yaml
from support import ROOT

from cccd.extras import EXTRAS

#: Declared and imported by nobody here: decoders that pydicom finds by name.
PLUGINS = {"pylibjpeg", "pylibjpeg-libjpeg", "pylibjpeg-openjpeg"}
#: Extras that no test environment needs, or that only checks.txt has.
UNPINNED = {
    "boto3",
    "botocore",
    "cadquery-ocp-novtk",
    "itk-morphologicalcontourinterpolation",
    "lib3mf",
    "open3d",
    "pytetwild",
    "usd-core",
    "zarr",
}
#: Imported in an environment of its own alone, or by a program that brings it: nothing here needs them.
ELSEWHERE = {"napari", "slicer_core"}
#: Pinned and not imported by the library: what runs it, what tests it, and the scan that a package brings.
TOOLS = {"snakemake", "pytest", "pytest-cov", "pytest-xdist", "hypothesis", "slicerio"}
#: Distributions whose module has another name.
DISTRIBUTIONS = {
    "cv2": "opencv-contrib-python-headless",
    "OCP": "cadquery-ocp-novtk",
    "PIL": "pillow",
    "pxr": "usd-core",
    "itk": "itk-morphologicalcontourinterpolation",
    "skimage": "scikit-image",
    "torch_geometric": "torch-geometric",
    "SimpleITK": "simpleitk",
    "vtkmodules": "vtk",
    "yaml": "pyyaml",
    "fast_simplification": "fast-simplification",
    "igl": "libigl",
    "pydantic_core": "pydantic",
}


def pins(lines):
    return dict(re.fullmatch(r"([\w.-]+)==(\S+)", line).groups() for line in lines)


def requirements():
    lines = (ROOT / "envs" / "requirements.txt").read_text().splitlines()
    return pins(line for line in lines if line and not line.startswith("#"))


def test_conda_twin_has_the_same_pins():
    environment = yaml.safe_load((ROOT / "envs" / "cccd.yaml").read_text())
    (twin,) = (part["pip"] for part in environment["dependencies"] if isinstance(part, dict))
    assert pins(twin) == requirements()


def normalised(names):
    return {re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", name)[0]).lower() for name in names}


def imported():
    """Distributions that the library and the job scripts import, inside functions too."""
    modules = set()
    for path in (ROOT / "scripts").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                modules.update(alias.name.split(".")[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and not node.level:
                modules.add(node.module.split(".")[0])
    modules -= {*ELSEWHERE, *sys.stdlib_module_names}
    modules = {name for name in modules if name.split("_")[0] != "cccd"}
    return {DISTRIBUTIONS.get(name, name) for name in modules}


def test_what_is_declared_is_imported_and_pinned():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = normalised(name for names in project["optional-dependencies"].values() for name in names)
    declared = normalised(project["dependencies"])
    used = (declared | extras) - {"cccd-surfaces"}  # extras name one another
    assert used == imported() | PLUGINS | {"snakemake"}
    assert (used | TOOLS) - UNPINNED == normalised(requirements())


def brought(extra, extras):
    """Distributions of an extra, and of those that it names."""
    named = [re.findall(r"\[(.+)\]", name) for name in extras[extra]]
    further = [part for names in named if names for part in names[0].split(",")]
    plain = [name for name, names in zip(extras[extra], named, strict=True) if not names]
    return normalised(plain).union(*(brought(part, extras) for part in further))


def test_every_extra_says_which_modules_it_brings():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    assert set(EXTRAS) == set(extras) - {"all"}
    assert normalised([project["name"]]) == normalised(extras["all"])
    for extra, modules in EXTRAS.items():
        names = normalised(DISTRIBUTIONS.get(module, module) for module in modules)
        assert names == brought(extra, extras) - PLUGINS - normalised(project["dependencies"])


def test_one_version():
    import cccd

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    newest = re.search(r"^## \[(\d.*)\] - (.*)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "cccd.__version__"}
    assert cccd.__version__ == citation["version"] == newest[1]
    assert str(citation["date-released"]) == newest[2]


def test_the_conda_recipe_asks_for_what_the_wheel_asks_for():
    import cccd

    text = (ROOT / "recipe" / "meta.yaml").read_text()
    assert f'version = "{cccd.__version__}"' in text
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    run = re.search(r"  run:\n(.*?)\n\n", text, re.DOTALL)[1]
    asked = {line.strip(" -").replace(" ", "") for line in run.splitlines()}
    assert asked - {"python>={{python_min}}"} == set(project["dependencies"])
