"""Rows of a sheet, as planned: scripts that lead to contours, files that are inputs, what is refused."""

import os
import time
from pathlib import Path
from types import SimpleNamespace

import nibabel
import numpy as np
import pytest
from support import plans, scans
from support.refusals import refusal

from cccd.errors import InputError
from cccd_workflow.plan.outcome import report_failed_run
from cccd_workflow.plan.plan import Plan

plan_of, named = plans.plan_of, plans.named

A_BALL = {"case": "a", "organ": "ball"}
#: A row of each kind of input that no file decides, and the way to its contours.
KINDS = [
    ({"mask": "mask.nii.gz"}, "trace_contours"),
    ({"image": "image.nii.gz"}, "trace_contours"),
    ({"image": "image.nii.gz", "seed": "3,3,3"}, "order_contours"),
    ({"source": "phantom", "organ": "sphere"}, "trace_contours"),
    ({"image": "image.nii.gz", "boundary": "maps.nii.gz"}, "order_contours"),
    ({"mask": "mask.nii.gz", "boundary": "maps.nii.gz"}, "order_contours"),
    ({"source": "mni152_scan", "organ": "brain"}, "order_contours"),
    ({"source": "mni152_head", "organ": "brain", "seed": "9,9,9"}, "order_contours"),
    ({"source": "phantom_scan", "organ": "liver", "seed": "9,9,9"}, "order_contours"),
]


@pytest.mark.parametrize(("row", "way"), KINDS)
def test_the_kind_of_input_decides_what_leads_to_contours(row, way):
    row = A_BALL | row
    plan = plan_of(row)
    assert plan.cohort.contour_way(named(f"a/{row['organ']}")) == way
    assert plan.cohort.needs_network == (way == "order_contours")


@pytest.mark.parametrize(("row", "way"), KINDS)
def test_every_mask_is_ordered_where_that_is_asked_for(row, way):
    row = A_BALL | row
    plan = plan_of(row, curves={"ordering": "gnn"})
    assert plan.cohort.contour_way(named(f"a/{row['organ']}")) == "order_contours"


@pytest.mark.parametrize("ordering", ["auto", "gnn"])
def test_drawn_contours_are_taken_whatever_is_asked_for(ordering):
    drawn = scans.outlines(scans.organ(), np.eye(4))
    scans.write_structure_set(Path("contours"), {"ball": drawn})
    plan = plan_of(A_BALL | {"mask": "contours"}, curves={"ordering": ordering})
    assert plan.cohort.contour_way(named("a/ball")) == "take_contours"
    assert not plan.cohort.needs_network


def test_rows_that_train_are_not_reconstructed():
    scan = {"image": "i.nii.gz", "mask": "m.nii.gz"}
    rows = [
        {"case": role, "organ": "liver", "role": role} | scan for role in ("train", "reconstruct", "both")
    ]
    cohort = plan_of(*rows).cohort
    assert cohort.training == [("train", "liver")]
    assert cohort.reconstructed == [("reconstruct", "liver"), ("both", "liver")]


def test_a_changed_file_of_a_scan_is_an_input():
    for name in ("scan.mhd", "scan.raw", "mask.nii.gz"):
        Path(name).write_bytes(b"")
    Path("scan.mhd").write_text("ElementDataFile = scan.raw\n")
    plan = plan_of(A_BALL | {"image": "scan.mhd", "mask": "mask.nii.gz"})
    assert plan.cohort.source_files(named("a/ball")) == ["mask.nii.gz", "scan.mhd", "scan.raw"]


def test_a_file_that_is_missing_or_of_the_future_is_no_input():
    Path("mask.nii.gz").write_bytes(b"")
    os.utime("mask.nii.gz", (time.time() + 3600,) * 2)
    plan = plan_of(A_BALL | {"image": "nowhere.nii.gz", "mask": "mask.nii.gz"})
    assert plan.cohort.source_files(named("a/ball")) == []


def test_a_row_without_its_mask_is_left_out_and_named_unless_it_was_imported(capsys):
    rows = [A_BALL | {"mask": "mask.nii.gz"}, {"case": "b", "organ": "ball", "mask": "nowhere.nii.gz"}]
    rows += [{"case": case, "organ": "ball", "mask": case} for case in ("empty", "others")]
    Path("mask.nii.gz").write_bytes(b"")
    Path("empty").mkdir()
    Path("others").mkdir()
    Path("others/cube.nii.gz").write_bytes(b"")
    config = {"cohort": str(plans.write_sheet(rows))}
    plan = Plan.make(config, plans.ROOT, omit_missing=True)
    cohort = plan.cohort
    assert cohort.reconstructed == [named("a/ball")]
    error, empty, others = cohort.missing.values()
    assert str(empty).startswith("sheet.tsv row 4: empty: no masks in this folder")
    assert str(others).startswith("sheet.tsv row 5: others: no mask of 'ball' in this folder")
    report_failed_run(plan)
    assert "--keep-going" not in capsys.readouterr().err  # the others ran
    assert str(error).startswith("sheet.tsv row 3: mask: there is no nowhere.nii.gz in ")
    assert "there is no nowhere" in refusal(cohort.row, named("b/ball"))
    imported = Path("results/b/ball/structure.h5")
    imported.parent.mkdir(parents=True)
    imported.write_bytes(b"")
    again = Plan.make(config, plans.ROOT, omit_missing=True).cohort
    assert again.reconstructed == [named("a/ball"), named("b/ball")]


@pytest.mark.parametrize("problem", ["there is no", "you may not read"])
def test_a_cohort_without_any_mask_is_refused(problem, monkeypatch):
    if problem == "you may not read":
        Path("mask.nii.gz").touch(mode=0)
        monkeypatch.setattr(os, "access", lambda path, _: bool(os.stat(path).st_mode & 0o400))  # root may
    config = {"cohort": str(plans.write_sheet([A_BALL | {"mask": "mask.nii.gz"}]))}
    with pytest.raises(InputError, match=rf"sheet\.tsv row 2: mask: {problem} mask\.nii\.gz"):
        Plan.make(config, plans.ROOT, omit_missing=True)


def test_the_mask_that_a_cohort_s_layout_implies_is_an_input():
    for name in ("volume-3.nii", "segmentation-3.nii"):
        Path(name).write_bytes(b"")
    plan = plan_of({"case": "a", "organ": "liver", "source": "lits17", "image": "volume-3.nii"})
    assert plan.cohort.source_files(named("a/liver")) == ["segmentation-3.nii", "volume-3.nii"]


def test_an_address_is_an_input_before_it_is_fetched():
    cohort = plan_of(A_BALL | {"mask": "https://example.org/scans/mask.nii.gz"}).cohort
    (path,) = cohort.source_files(named("a/ball"))
    folder, key, file = path.split("/")
    assert (folder, file) == ("downloads", "mask.nii.gz")
    fetched = cohort.remote_file(SimpleNamespace(key=key, file=file))
    assert fetched.address == "https://example.org/scans/mask.nii.gz"
    with pytest.raises(InputError, match=r"^sheet\.tsv: no address of downloads/0/mask\.nii\.gz; "):
        cohort.remote_file(SimpleNamespace(key="0", file=file))


@pytest.mark.parametrize(
    ("row", "what"),
    [
        ({"organ": "*", "mask": "https://example.org/map.nii.gz"}, "organ *"),
        ({"source": "lits17", "image": "https://example.org/volume-1.nii"}, "source lits17"),
    ],
)
def test_what_needs_a_folder_is_refused_by_an_address(row, what):
    problem = f"sheet.tsv row 2: {what} cannot be combined with an address; "
    assert refusal(plan_of, A_BALL | row) == problem + "download the files and name their folder"


def test_a_structure_that_is_not_in_the_sheet_is_refused():
    cohort = plan_of(A_BALL | {"mask": "mask.nii.gz"}).cohort
    said = refusal(cohort.row, named("a/bal"))
    assert said == "sheet.tsv: no structure a/bal; did you mean 'a/ball'?"
    assert "no case b; " in refusal(cohort.of_case, "b")
    assert "no row of role train" in refusal(cohort.training_files)


@pytest.mark.parametrize(("wanted", "share"), [("auto", True), (False, False)])
def test_a_row_for_a_whole_map_becomes_one_for_each_label(wanted, share):
    labels = np.zeros((12, 12, 12), np.uint8)
    labels[2:6, 2:10, 2:10], labels[6:10, 2:10, 2:10], labels[0, 0, 0] = 1, 2, 9
    nibabel.save(nibabel.Nifti1Image(labels, np.eye(4)), "map.nii.gz")
    Path("names.csv").write_text("label,name\n1,left\n2,right\n")
    row = {"case": "a", "organ": "*", "mask": "map.nii.gz", "labels": "names.csv"}
    cohort = plan_of(row, surface={"shared_walls": wanted}).cohort
    assert {name: row["label"] for name, row in cohort.rows.items()} == {
        ("a", "left"): "1",
        ("a", "right"): "2",
    }
    assert set(cohort.labels["a"]) == {"left", "right"}
    assert cohort.shared == ({"a": ["left", "right"]} if share else {})
    assert any("label 9" in note for note in cohort.notes)
