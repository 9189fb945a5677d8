import sys

import numpy as np
import pandas as pd
import pytest

from cccd.containers import Frame, Structure
from cccd.errors import InputError
from cccd_paper.comparisons import programs
from cccd_paper.comparisons.baselines.surfaces import FAMILIES, Program
from cccd_paper.comparisons.paper_k import BEST, DEFAULTS
from cccd_paper.comparisons.tuning import Truth, tuned_rows
from cccd_workflow.surface_measures import Reference

PROGRAMS = {name: family for name, family in FAMILIES.items() if isinstance(family, Program)}
SIZE = np.array([14.0, 15.0, 12.0])


@pytest.fixture(scope="module")
def structure():
    """Two ellipsoids on a sagittal, mirrored scan, cropped: slices along the first axis."""
    index = np.stack(np.meshgrid(*map(np.arange, (18, 40, 80)), indexing="ij"), axis=-1)
    spacing = np.array([2.0, 1.0, 1.0])
    mask = np.zeros(index.shape[:3], bool)
    for middle in ((9, 20, 20), (9, 20, 60)):
        mask |= np.sum((((index - middle) * spacing) / SIZE) ** 2, axis=-1) <= 1
    affine = np.diag([-2.0, 1.0, 1.0, 1.0])
    affine[:3, 3] = (50, -20, 7)
    return Structure("case", "organ", Frame(affine, 0, (30, 60, 100)), np.array([5, 7, 11]), mask=mask)


def available(name):
    if not PROGRAMS[name].available():
        pytest.skip(f"{PROGRAMS[name].package} is not there")
    return PROGRAMS[name]


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_keeps_every_part_where_it_is(structure, name):
    program = available(name)
    ((mesh, seconds),) = program.run(structure, [program.default])
    assert seconds > 0
    frame = structure.frame
    centre = frame.affine[:3, :3] @ (np.array([9, 20, 40]) + structure.origin) + frame.affine[:3, 3]
    assert (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2 == pytest.approx(centre, abs=0.3)
    assert mesh.volume == pytest.approx(2 * 4 / 3 * np.pi * SIZE.prod(), rel=0.05)


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_stands_at_its_best_and_at_its_defaults(structure, name):
    program = available(name)
    truth = Truth(Reference.of(structure))
    rows = pd.DataFrame(tuned_rows(program, structure, structure, truth, ours_bends=0.2))
    own = rows[rows["chosen"].str.contains(DEFAULTS)]
    assert own["setting"].tolist() == [str(program.default)]
    assert rows.loc[rows["chosen"].str.contains(BEST), "assd_mm"].item() <= own["assd_mm"].item() + 0.01


@pytest.mark.parametrize("program", PROGRAMS.values(), ids=list(PROGRAMS))
def test_the_grid_holds_the_defaults_and_no_name_twice(program):
    assert program.default in program.settings
    names = [str(setting) for setting in program.settings]
    assert len(set(names)) == len(names)
    assert [name for name in names if name.endswith("its defaults")] == [str(program.default)]


@pytest.mark.parametrize("python", [sys.executable, "/nowhere/python"])
def test_a_python_without_slicer_core_is_named(monkeypatch, structure, python):
    monkeypatch.setenv(programs.SLICER_PYTHON, python)
    with pytest.raises(InputError, match=f"CCCD_SLICER_PYTHON {python}: .*pip install slicer-core"):
        list(programs.by_slicer(structure, [programs.Slicer()]))
