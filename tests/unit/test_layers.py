"""Imports run one way: the core loads no package around it, and no parts of a package know each other."""

import ast
import functools
import re
import shutil
import subprocess
import sys
from graphlib import TopologicalSorter

import pytest
from support import SCRIPTS

from cccd import plugins

#: Which packages each may import beside the core, without "cccd_". What they add to the core, they register.
PACKAGES = {
    "cccd": "",
    "cccd_networks": "",
    "cccd_segmentation": "networks",
    "cccd_datasets": "",
    "cccd_junctions": "networks",
    "cccd_dicom": "",
    "cccd_formats": "",
    "cccd_viewers": "meshes",
    "cccd_meshes": "dicom",
    "cccd_solids": "",
    "cccd_walls": "solids",
    "cccd_tetrahedra": "",
    "cccd_vessels": "meshes tetrahedra",
    "cccd_labels": "viewers",
    "cccd_shapes": "labels meshes viewers workflow",
    "cccd_workflow": "labels meshes networks segmentation tetrahedra viewers",
    "cccd_calibration": "datasets junctions meshes training workflow",
    "cccd_training": "datasets junctions networks segmentation",
    "cccd_paper": "datasets junctions networks segmentation training viewers workflow",
}

#: Jobs of the evidence and of the training; all others know the product alone.
BESIDE = "evaluate_gnn gather_phantoms generate_graphs train_gnn train_segmenter write_phantom"

#: Modules of the paper's networks.
PAPER_NETWORKS = ("network", "training", "general_gnn")

#: The only modules that may import these; a package's name stands for all that is in it.
ONLY = {
    "h5py": {"cccd.store", "cccd_shapes.files"},
    "monai": {
        *(f"cccd_segmentation.{name}" for name in ("plain_unet", "grids", "inference")),
        *(f"cccd_training.segmentation.{name}" for name in ("examples", "training", "scores")),
    },
    "torch": {
        *("cccd_networks.torch_files", "cccd_networks.devices"),
        *(f"cccd_segmentation.{name}" for name in ("networks", "plain_unet", "grids", "inference", "model")),
        *(f"cccd_junctions.{name}" for name in ("layers", "network", "graph_data", "energy", "checkpoint")),
        *("cccd_training", "cccd_paper.segmentation"),
        *(f"cccd_paper.junctions.{name}" for name in PAPER_NETWORKS),
    },
    "torch_geometric": {
        *(f"cccd_junctions.{name}" for name in ("layers", "network", "graph_data")),
        *(f"cccd_training.junctions.{name}" for name in ("data", "loss", "tasks")),
        *(f"cccd_paper.junctions.{name}" for name in PAPER_NETWORKS),
    },
    "snakemake": set(),
}


def name_of(path):
    """Dotted name of a module; of a package's ``__init__`` the package's."""
    return ".".join(path.relative_to(SCRIPTS).with_suffix("").parts).removesuffix(".__init__")


MODULES = {name_of(path): path for package in PACKAGES for path in sorted((SCRIPTS / package).rglob("*.py"))}


def imported(path):
    """Dotted names that a file imports, wherever in it; ``from a import b`` counts as ``a.b``."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name} imports relatively"
            found |= {f"{node.module}.{name.name}" for name in node.names}
    return found


@functools.cache
def all_imported():
    """What each module imports."""
    return {name: imported(path) for name, path in MODULES.items()}


def part_of(name):
    """The folder or single module right below a package."""
    return name.split(".")[1]


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_knows_only_those_before_it(package):
    known = {package, "cccd", *(f"cccd_{name}" for name in PACKAGES[package].split())}
    wrong = {
        name: other
        for name, others in all_imported().items()
        for other in others
        if name.split(".")[0] == package
        and other.split(".")[0] in PACKAGES
        and other.split(".")[0] not in known
    }
    assert wrong == {}


@pytest.mark.parametrize("package", PACKAGES)
def test_no_two_parts_of_a_package_know_each_other(package):
    inside = {name: others for name, others in all_imported().items() if name.startswith(f"{package}.")}
    graph = {part_of(name): set() for name in inside}
    for name, others in inside.items():
        known = {part_of(other) for other in others if other.startswith(f"{package}.")}
        graph[part_of(name)] |= known - {part_of(name)}
    TopologicalSorter(graph).prepare()  # a circle is an error


def test_the_core_names_other_packages_in_one_place():
    # a package that it does not name changes without its jobs running again
    assert {*plugins.PACKAGES} == {*PACKAGES} == {path.parent.name for path in SCRIPTS.glob("*/__init__.py")}
    quoted = re.compile(r"[\"'(]cccd_\w")
    named = {name for name, path in MODULES.items() if quoted.search(path.read_text(encoding="utf-8"))}
    assert {name for name in named if name.split(".")[0] == "cccd"} == {"cccd.plugins"}


@pytest.mark.parametrize("package", ONLY)
def test_few_modules_know_a_package(package):
    users = {
        name for name, others in all_imported().items() if any(o.split(".")[0] == package for o in others)
    }
    allowed = tuple(f"{name}." for name in ONLY[package])
    assert [name for name in users if not f"{name}.".startswith(allowed)] == []


def test_the_report_imports_no_algorithm():
    files = {"stage_files", "store", "__version__"}
    allowed = files | {"console", "containers", "geometry", "plugins", "report"}
    for name, others in all_imported().items():
        if name.startswith("cccd_workflow.report"):
            read = {part_of(other) for other in others if other.startswith(("cccd.", "cccd_workflow."))}
            assert read <= allowed, name


def test_a_job_calls_the_packages_alone():
    for script in sorted(SCRIPTS.glob("*.py")):
        known = {name.split(".")[0] for name in imported(script)}
        assert known <= {*PACKAGES, "logging", "operator", "pathlib", "shutil"}, script.name
        assert bool(known & {"cccd_paper", "cccd_training"}) == (script.stem in BESIDE.split()), script


#: Neither the other packages are there, nor what any extra brings.
ALONE = """
import sys, nibabel, numpy as np
from cccd.extras import EXTRAS
sys.modules.update(dict.fromkeys(sum(EXTRAS.values(), ())))
import cccd
from cccd.cli import main
from cccd.plugins import folders
from cccd.settings.root import validate_config
assert len(folders()) == 1
ball = np.indices((20, 20, 20)).astype(float) - 10
mask = np.hypot(np.hypot(*ball[:2]), ball[2]) <= 7
nibabel.save(nibabel.Nifti1Image(mask.astype(np.uint8), np.eye(4)), "ball.nii.gz")
names = ["ball.stl", "ball.ply", "ball.obj", "ball.glb", "ball.gii", "filled.nii.gz"]
assert main(["surface", "ball.nii.gz", *(word for name in names for word in ("-o", name))]) == 0
surface = cccd.reconstruct(mask, np.eye(4))
assert 1300 < surface.mesh.volume < 1550
assert not hasattr(validate_config({}), "comparisons")
"""


def test_the_product_makes_a_surface_of_a_mask_without_the_others_and_without_extras(tmp_path):
    shutil.copytree(SCRIPTS / "cccd", tmp_path / "cccd")  # with what Numba compiled
    run = subprocess.run([sys.executable, "-c", ALONE], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert {path.suffix for path in tmp_path.iterdir()} >= {".stl", ".ply", ".obj", ".glb", ".gii"}
