"""The registry names what exists, once, and is light enough to be read at every start of the workflow."""

import inspect
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

from cccd.comparisons.baselines.surfaces import FAMILIES, SURFACES
from cccd.comparisons.registry import COMPARISONS, INPUTS, ITEMS, SECTIONS, tables
from cccd.dependencies import imported_files
from cccd.lookup import find
from cccd.settings import comparisons
from cccd.settings.root import Settings

SCRIPTS = Path(__file__).parents[3] / "scripts"


def closure(comparison) -> set[str]:
    """Library files whose edit runs a comparison again."""
    modules = [function.rpartition(".")[0] for function in comparison.functions]
    files = imported_files(SCRIPTS / "compare_structure.py", SCRIPTS / "cccd", modules)
    return {path.relative_to(SCRIPTS / "cccd").as_posix() for path in files}


def test_keys_and_tables_are_unique():
    keys = [item.key for item in ITEMS]
    assert len(set(keys)) == len(keys)
    stems = [item.table for item in ITEMS if item.table is not None]
    assert len(set(stems)) == len(stems)
    assert set(tables()) <= set(stems)
    assert {item.section for item in ITEMS} - {"summary"} == set(SECTIONS)


@pytest.mark.parametrize("item", ITEMS, ids=lambda item: item.key)
def test_every_function_of_an_item_is_there(item):
    for function in (item.tabulate, item.note, item.plots):
        assert function is None or callable(find(function))


@pytest.mark.parametrize("comparison", COMPARISONS.values(), ids=lambda comparison: comparison.name)
def test_every_function_and_section_of_a_comparison_is_there(comparison):
    assert all(callable(find(function)) for function in comparison.functions)
    assert set(comparison.inputs) <= set(INPUTS)
    for section in comparison.settings.values():
        model = Settings()
        for part in section.split("."):
            model = getattr(model, part)


@pytest.mark.parametrize("comparison", COMPARISONS.values(), ids=lambda comparison: comparison.name)
def test_the_functions_of_a_comparison_accept_what_its_job_passes(comparison):
    passed = [*comparison.inputs, *comparison.settings, *(["seed"] if comparison.seeded else [])]
    for function in filter(None, (comparison.run, comparison.figures)):
        inspect.signature(find(function)).bind(**dict.fromkeys(passed))


def test_reading_the_registry_loads_nothing_heavy():
    probe = "import sys, cccd.comparisons.registry; print(*sys.modules)"
    run = subprocess.run(
        [sys.executable, "-c", probe], cwd=SCRIPTS, capture_output=True, text=True, check=True
    )
    assert {"numpy", "pandas", "scipy", "torch"}.isdisjoint(run.stdout.split())


def test_a_change_of_one_comparison_runs_no_other():
    own = {
        "corners": "comparisons/corner_comparison.py",
        "k_sweep": "comparisons/k_sweep.py",
        "active_contour": "comparisons/active_contour_comparison.py",
        "reconstruction": "comparisons/reconstruction_comparison.py",
        "stage_times": "comparisons/stage_times.py",
        "isosurfaces": "comparisons/isosurfaces.py",
        "thick_slices": "comparisons/thick_slices.py",
    }
    for name, module in own.items():
        holders = {other for other, comparison in COMPARISONS.items() if module in closure(comparison)}
        assert holders == {name}
    for comparison in COMPARISONS.values():  # a caption is no reason to compare again
        assert {"comparisons/registry.py", "comparisons/summary.py"}.isdisjoint(closure(comparison))


def test_the_configuration_knows_every_surface():
    field = comparisons.IsosurfaceSettings.model_fields["methods"]
    names = get_args(get_args(field.annotation)[0])
    assert set(names) == {*SURFACES, *FAMILIES}
