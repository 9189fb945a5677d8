"""The whole pipeline on a tiny cohort: what it leaves, and what it does again after a change."""

import json

import h5py
import numpy as np
import pandas as pd
import pytest
import trimesh
from scipy.spatial import cKDTree

from cccd import store

STRUCTURES = [("tiny", "sphere"), ("tiny", "two_spheres")]
LOFT = "scripts/cccd/surface/loft.py"
AFTER_CURVES = {"loft_surface", "compare_structure", "measure_structure", "build_tables", "build_report"}


def test_everything_promised_is_there(tiny_run):
    for case, organ in STRUCTURES:
        folder = tiny_run.results / case / organ
        for name in (
            "structure.h5",
            "boundaries.h5",
            "contours.h5",
            "curves.h5",
            "surface.h5",
            "surface.ply",
            "metrics.json",
        ):
            assert (folder / name).stat().st_size > 0, name
        page = (folder / "report.html").read_text(encoding="utf-8")
        assert page.count('class="viewer"') == 1
    for name in ("gnn/graphs.h5", "gnn/model.pt", "gnn/history.csv", "tables/junctions.csv", "report.html"):
        assert (tiny_run.results / name).stat().st_size > 0, name


def test_no_temporary_or_failed_file_stays(tiny_run):
    assert not [path for path in tiny_run.results.rglob(".*") if path.is_file()]
    assert not list((tiny_run.folder / "logs").rglob("*.failed"))


@pytest.mark.parametrize("key", STRUCTURES)
def test_the_contract_of_contours_h5(tiny_run, key):
    folder = tiny_run.results / key[0] / key[1]
    with h5py.File(folder / "contours.h5") as contours, h5py.File(folder / "curves.h5") as curves:
        assert set(contours) == {"ordered"}
        for name in ("points", "offsets", "slice", "hole"):
            np.testing.assert_array_equal(contours["ordered"][name][:], curves["ordered"][name][:])
        for name in ("affine", "slice_axis", "shape"):
            np.testing.assert_array_equal(contours.attrs[name], curves.attrs[name])
        assert json.loads(contours.attrs["report"])["method"] == "traced mask"


def test_how_the_network_would_have_ordered_is_compared(tiny_run):
    table = pd.read_csv(tiny_run.results / "tables" / "ordering.csv")
    assert list(zip(table["case"], table["organ"], strict=True)) == STRUCTURES
    table = table[table["organ"] == "sphere"]  # the role of the other is measure
    assert (table["GNN against exact tracing, Dice"] == 1).all()  # outlines of phantoms need no repair
    assert (table["curves"] == table["curves_exact"]).all()


@pytest.mark.parametrize("key", STRUCTURES)
def test_the_contract_of_curves_h5(tiny_run, key):
    with h5py.File(tiny_run.results / key[0] / key[1] / "curves.h5") as file:
        offsets = file["ordered/offsets"][:]
        assert file["ordered/points"].dtype == np.float64
        assert offsets.dtype == np.int64
        assert offsets[-1] == len(file["ordered/points"]) == len(file["chain_codes/codes"])
        assert len(file["ordered/slice"]) == len(file["ordered/hole"]) == len(offsets) - 1
        degree = file["splines"].attrs["degree"]
        counts = np.diff(file["splines/offsets"][:])
        np.testing.assert_array_equal(np.diff(file["splines/knot_offsets"][:]), counts + 2 * degree + 1)
        assert file.attrs["affine"].shape == (4, 4)
        assert file.attrs["slice_axis"] in (0, 1, 2)


@pytest.mark.parametrize("key", STRUCTURES)
def test_the_surface_is_closed_and_encloses_the_phantom(tiny_run, key):
    folder = tiny_run.results / key[0] / key[1]
    mesh = trimesh.load(folder / "surface.ply", process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    truth = store.read_structure(folder / "structure.h5").truth.to_trimesh()
    assert mesh.volume == pytest.approx(truth.volume, rel=0.03)
    np.testing.assert_allclose(mesh.bounds, truth.bounds, atol=3)


def test_the_mesh_is_the_tessellation_of_the_control_mesh(tiny_run):
    folder = tiny_run.results / "tiny" / "sphere"
    (body,) = store.read_bodies(folder / "surface.h5")
    assert body.sign == 1
    mesh = trimesh.load(folder / "surface.ply", process=False)
    limits = body.tessellate(0).vertices
    assert cKDTree(mesh.vertices).query(limits)[0].max() < 1e-3
    assert body.tessellate(2).volume == pytest.approx(mesh.volume, rel=1e-5)


def test_metrics_are_plain_numbers(tiny_run):
    metrics = json.loads((tiny_run.results / "tiny" / "sphere" / "metrics.json").read_text())
    assert metrics["surface"]["dice_3d"] > 0.95


def test_tables_name_every_structure(tiny_run):
    table = pd.read_csv(tiny_run.results / "tables" / "structures.csv")
    assert list(zip(table["case"], table["organ"], strict=True)) == STRUCTURES


def test_a_touched_module_brings_back_nothing_and_an_edited_comment_only_what_follows(tiny_copy):
    module = tiny_copy.folder / LOFT
    module.touch()
    assert tiny_copy.planned() == {}  # nor does a second run
    module.write_text(module.read_text() + "\n# a comment\n")
    assert set(tiny_copy.planned()) - {"all"} == AFTER_CURVES


BEFORE_CURVES = {"train_gnn", "generate_graphs", "import_structure"}


@pytest.mark.parametrize(
    ("setting", "again", "kept"),
    [
        ("k: 5", {"fit_curves"}, {*BEFORE_CURVES, "evaluate_gnn", "loft_surface"}),
        ("sweep: [3, 9]", {"compare_structure"}, {*BEFORE_CURVES, "fit_curves", "loft_surface"}),
        ("ordering: gnn", {"import_structure", "fit_curves"}, {"train_gnn", "generate_graphs"}),
    ],
)
def test_another_setting_of_curves_brings_back_only_what_follows(tiny_copy, setting, again, kept):
    with (tiny_copy.folder / "tiny.yaml").open("a") as configuration:
        configuration.write(f"curves: {{{setting}}}\n")
    planned = set(tiny_copy.planned())
    assert again <= planned
    assert planned.isdisjoint(kept)


def test_a_moved_row_brings_back_nothing_of_its_structure(tiny_copy):
    sheet = tiny_copy.folder / "tiny.tsv"
    header, first, second = sheet.read_text().splitlines()
    sheet.write_text("\n".join([header, "", second, first]) + "\n")
    assert set(tiny_copy.planned()) - {"all"} <= {
        "build_tables",
        "build_report",
    }  # whose rows are in its order


def test_every_planned_job_asks_for_memory(fresh_project):
    plan = fresh_project.snakemake("--dry-run").stdout
    assert plan.count("mem_mb=") > 12
    assert "mem_mb=<TBD>" not in plan  # a group would go without it


def test_another_directory_works(fresh_project, tmp_path):
    elsewhere = tmp_path / "else where ü"
    sheet, tiny = fresh_project.folder / "tiny.tsv", fresh_project.folder / "tiny.yaml"
    arguments = ["--directory", elsewhere, "--configfile", tiny, "--config", f"cohort={sheet}"]
    fresh_project.snakemake(*arguments, "--", "results/tiny/sphere/structure.h5")
    assert (elsewhere / "results" / "tiny" / "sphere" / "structure.h5").exists()
    assert not fresh_project.results.exists()
