"""Imports run one way: a module imports from its own package and from the layers before it."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LIBRARY = ROOT / "scripts" / "cccd"

#: Packages and single modules of the library, by layer; those of one layer do not know each other.
LAYERS = (
    ("errors", "tolerances", "lookup", "dependencies", "project"),
    ("extras", "disk_space", "devices"),
    ("settings", "geometry", "job", "remote", "sidecar_files"),
    ("containers", "metrics", "cohort", "dicom_objects", "model_header"),
    ("store",),
    ("volumes", "torch_files"),
    ("boundary", "tracing", "chaincode", "filling"),
    ("contours",),
    ("junctions", "curves", "segmentation"),
    ("surface",),
    ("solids",),
    ("tetrahedra",),
    ("reconstruction", "filling_training"),
    ("api",),
    ("pyvista_accessor", "label_survey"),
    ("comparisons",),
    ("report",),
    ("bids", "doctor", "workflow_command"),
    ("cli",),
)
LAYER = {name: number for number, layer in enumerate(LAYERS) for name in layer}

#: What the report may read of the comparisons: what they are called, and the tables that they left.
DESCRIPTIONS = {"registry", "summary", "measures", "numerals", "paper_k"}

#: Where graphs are PyTorch Geometric's.
GEOMETRIC = ("layers", "network", "graph_data", "data", "loss", "paper_network", "tasks")

#: Where the segmentation networks are.
SEGMENTING = (
    *("slices", "polar_unet", "kiunet", "unet3plus", "hdenseunet", "networks"),
    *("grids", "examples", "inference", "training", "model", "scores"),
)

#: The only modules that may import these.
ONLY = {
    "h5py": {"store"},
    "monai": {
        f"segmentation.{name}"
        for name in ("networks", "grids", "examples", "inference", "training", "scores")
    },
    "torch": {
        "torch_files",
        "devices",
        *(f"segmentation.{name}" for name in SEGMENTING),
        "filling_training.training",
        *(f"junctions.{name}" for name in (*GEOMETRIC, "energy", "checkpoint", "loop", "reranker_training")),
    },
    "torch_geometric": {f"junctions.{name}" for name in GEOMETRIC},
    "snakemake": set(),
}


def name_of(path):
    """Dotted name below ``cccd``; empty for the library's own ``__init__``."""
    parts = path.relative_to(LIBRARY).with_suffix("").parts
    return ".".join(part for part in parts if part != "__init__")


MODULES = {name_of(path): path for path in sorted(LIBRARY.rglob("*.py"))}


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


def own(path):
    """What a file imports of the library, below ``cccd``."""
    return {name.removeprefix("cccd.") for name in imported(path) if name.startswith("cccd.")}


def test_every_module_has_its_layer():
    there = {name.split(".")[0] for name in MODULES if name}
    assert there == set(LAYER)
    assert len(LAYER) == sum(map(len, LAYERS))


@pytest.mark.parametrize("name", [name for name in MODULES if name])
def test_imports_come_from_earlier_layers(name):
    here = name.split(".")[0]
    others = {imported_name.split(".")[0] for imported_name in own(MODULES[name])} - {here, "__version__"}
    assert {other for other in others if LAYER[other] >= LAYER[here]} == set()


@pytest.mark.parametrize("package", ONLY)
def test_few_modules_know_a_package(package):
    users = {
        name
        for name, path in MODULES.items()
        if any(part.split(".")[0] == package for part in imported(path))
    }
    assert users <= ONLY[package]


@pytest.mark.parametrize("name", [name for name in MODULES if name.split(".")[0] == "report"])
def test_the_report_imports_no_algorithm(name):
    read = own(MODULES[name]) - {"__version__"}
    assert {part.split(".")[0] for part in read} <= {
        "comparisons",
        "containers",
        "geometry",
        "lookup",
        "report",
        "store",
    }
    experiments = {part.split(".")[1] for part in read if part.split(".")[0] == "comparisons"}
    assert experiments <= DESCRIPTIONS


def test_what_the_report_reads_of_the_comparisons_knows_no_algorithm():
    for name in DESCRIPTIONS:
        read = own(MODULES[f"comparisons.{name}"])
        assert {part.split(".")[0] for part in read} <= {"comparisons", "lookup", "store"}, name
        beside = {part.split(".")[1] for part in read if part.startswith("comparisons.")}
        assert beside <= {*DESCRIPTIONS, "published"}, name


@pytest.mark.parametrize("script", sorted((ROOT / "scripts").glob("*.py")), ids=lambda path: path.stem)
def test_a_job_calls_the_library_alone(script):
    assert {name.split(".")[0] for name in imported(script)} <= {
        "cccd",
        "logging",
        "operator",
        "pathlib",
        "shutil",
    }
