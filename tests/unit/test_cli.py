"""The command: what a newcomer types works; what cannot work ends in one line, with nothing half written."""

import ctypes
import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path
from threading import Thread

import nibabel
import numpy as np
import psutil
import pydicom
import pytest
import pyvista
import trimesh
from matplotlib.image import imread
from support import fresh, scans

import cccd
from cccd.cli import main
from cccd.commands import print_surface
from cccd.console import interruptible
from cccd_labels.label_maps import colour_of
from cccd_workflow.doctor import _extra

AFFINE = np.diag([1.0, 1.0, 2.5, 1.0])


def ball(centre=(12, 12, 6), radius=8.0):
    offset = (np.indices((24, 24, 13)) - np.array(centre).reshape(3, 1, 1, 1)).T * (1, 1, 2.5)
    return (np.linalg.norm(offset, axis=-1) <= radius).T


BALL_ML = ball().sum() * 2.5 / 1000


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder of inputs in which commands are typed."""
    monkeypatch.chdir(tmp_path)
    labels = ball().astype(np.uint8) * 5
    labels[2:5, 2:6, 2:9] = 7
    for name, data in {"liver": ball().astype(np.uint8), "labels": labels, "empty": 0 * labels}.items():
        nibabel.save(nibabel.Nifti1Image(data, AFFINE), tmp_path / f"{name}.nii.gz")
    return tmp_path


def files(folder):
    return {path.name for path in folder.rglob("*") if path.is_file()}


def contents(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_plain_mask_needs_few_modules_and_no_other_package(here):
    code = """
import sys
from cccd.cli import main
assert main(["surface", "liver.nii.gz"]) == 0
print(*(name for name in sys.modules if name.split(".")[0].startswith("cccd")))
"""
    names = fresh.python(code).splitlines()[-1].split()
    assert len(names) <= 60
    assert {name.split(".")[0] for name in names} == {"cccd"}


def test_a_mask_becomes_a_surface(here, capsys):
    assert main(["surface", "liver.nii.gz"]) == 0
    said = capsys.readouterr()
    assert not said.err  # nothing compiles on the way
    assert "liver.ply" in said.out
    assert " ml (" in said.out
    cccd.reconstruct(cccd.read("liver.nii.gz")).write("library.ply")
    assert (here / "library.ply").read_bytes() == (here / "liver.ply").read_bytes()


def test_every_label_a_file_in_every_format_that_was_asked_for(here, answer):
    asked = "surface labels.nii.gz --all-labels -o out/organ.stl -o out/organ.nii.gz"
    made = answer(*asked.split())["surfaces"]
    kinds = ("stl", "nii.gz")
    assert files(here / "out") == {f"organ_label_{label}.{kind}" for label in (5, 7) for kind in kinds}
    volumes = [surface["volume_ml"] for surface in made]
    assert volumes == pytest.approx([BALL_ML, 0.21], rel=4e-3)  # those of the slices


def test_a_whole_map_by_names_from_a_table_as_files_and_as_one_scene(here, capsys):
    (here / "names.csv").write_text("label,name,color\n5,liver,#ff0000\n7,spleen,#0000ff\n")
    asked = ["surface", "labels.nii.gz", "--all-labels", "--names", "names.csv"]
    assert main([*asked, "-o", "organs.glb", "-o", "organ.ply"]) == 0
    assert files(here) >= {"organs.glb", "organ_liver.ply", "organ_spleen.ply"}
    assert not [name for name in files(here) if name.startswith("organs_")]
    scene = trimesh.load(here / "organs.glb")
    assert set(scene.graph.nodes_geometry) == {"liver", "spleen"}
    for name, mesh in scene.geometry.items():
        alone = trimesh.load(here / f"organ_{name}.ply")
        assert mesh.volume == pytest.approx(alone.volume, rel=1e-3)
    assert tuple(scene.geometry["liver"].visual.material.main_color[:3]) == (255, 0, 0)
    assert "organs.glb" in capsys.readouterr().out.splitlines()


def test_labels_that_become_one_organ_are_told_before_any_work_and_once(here, capsys, monkeypatch):
    told, make = [], cccd.reconstruct

    def reconstruct(*given, **more):
        told.append(capsys.readouterr().err)
        return make(*given, **more)

    monkeypatch.setattr(cccd, "reconstruct", reconstruct)
    assert main(["surface", "labels.nii.gz"]) == 0
    (before,) = told
    (line,) = (line for line in before.splitlines() if line.startswith("warning: "))
    assert "labels.nii.gz" in line
    assert "2 labels are taken as one organ: 5, 7;" in line
    assert "--label NAME" in line
    assert "--all-labels" in line
    after = capsys.readouterr()
    assert "taken as one organ" not in after.out + after.err
    assert (here / "labels.ply").is_file()


@pytest.mark.filterwarnings("error")
def test_python_warns_of_labels_that_become_one_organ(here):
    labels = np.asarray(nibabel.load("labels.nii.gz").dataobj)
    words = "all 2 labels are taken as one organ: 5, 7; --label"
    with pytest.warns(UserWarning, match=words) as told:
        structure = cccd.read("labels.nii.gz")
    with pytest.warns(UserWarning, match=words) as told_of_array:
        cccd.reconstruct(labels, AFFINE)
    assert [warning.filename for warning in (*told, *told_of_array)] == [__file__] * 2
    cccd.reconstruct(structure)  # once is enough
    assert cccd.read("labels.nii.gz", 5).organ == "label_5"
    cccd.read("liver.nii.gz")


def test_a_file_of_settings_is_followed(here, capsys):
    (here / "smooth.yaml").write_text("surface: {smoothing: 30}\n")
    assert main(["surface", "liver.nii.gz", "-o", "a.ply"]) == 0
    assert main(["surface", "liver.nii.gz", "-o", "b.ply", "--configfile", "smooth.yaml"]) == 0
    assert main(["surface", "liver.nii.gz", "-o", "c.ply", "--smooth", "30"]) == 0
    assert (here / "b.ply").read_bytes() == (here / "c.ply").read_bytes()
    assert (here / "a.ply").read_bytes() != (here / "b.ply").read_bytes()


def test_dicom_contours_and_what_check_says_of_them(here, capsys):
    (here / "drawn").mkdir()
    scans.write_structure_set(here / "drawn" / "rt", {"Liver": scans.outlines(ball(), AFFINE)})
    assert main(["surface", "drawn", "--label", "Liver"]) == 0
    assert main(["check", "drawn", "-o", "look.png"]) == 0
    said = capsys.readouterr().out
    assert all(word in said for word in ("drawn contours", "7 with organ", "2.5 mm apart", "1 Liver"))
    assert {"drawn.ply", "look.png"} <= files(here)
    assert cccd.read("drawn", 1).organ == "Liver"


def test_check_says_axes_labels_and_cut_ends(here, answer):
    nibabel.save(nibabel.Nifti1Image(ball((12, 12, 0)).astype(np.uint8), AFFINE), "cut.nii.gz")
    (said,) = answer("check", "cut.nii.gz")
    assert said["grid"] == "24 x 24 x 13 voxels of 1 x 1 x 2.5 mm"
    assert "R, A, S" in said["axes"]
    assert any("first slice" in warning for warning in said["warnings"])


def test_slices_without_organ_are_said(here, answer):
    mask = ball((12, 12, 10)).astype(np.uint8)
    empty = np.flatnonzero(mask.any(axis=(0, 1)))[1:-1:2]
    mask[..., empty] = 0
    nibabel.save(nibabel.Nifti1Image(mask, AFFINE), "every_second.nii.gz")
    (said,) = answer("check", "every_second.nii.gz")
    assert said["slices"].endswith(" 5 mm apart")
    line = f"{len(empty)} slices between the organ's first and last are empty: filled from the others"
    assert line in said["warnings"]


def test_check_lists_and_draws_every_label(here, capsys, answer):
    labels = np.asarray(nibabel.load("labels.nii.gz").dataobj).astype(np.int16)
    labels[20, 20, 10] = 1000
    for name, side in {"right": 1.0, "left": -1.0}.items():  # towards which the first axis runs
        affine = np.diag([side, 1.0, 2.5, 1.0])
        nibabel.save(nibabel.Nifti1Image(labels, affine), f"{name}.nii.gz")
    (here / "dataset.json").write_text('{"labels": {"background": 0, "liver": 5, "kidney": 7}}')
    assert main(["check", "right.nii.gz"]) == 0
    said = capsys.readouterr()
    lines = ["5 liver, 2.09 ml", "7 kidney, 0.21 ml"]
    lines += ["1000, 0.0025 ml (a single voxel: too small for a surface)"]
    assert [line.split(maxsplit=1)[1] for line in said.out.splitlines() if line[:7] == "labels:"] == lines
    assert "--all-labels" in said.out
    assert not said.err
    (said,) = answer("check", "left.nii.gz")
    found = [(label["label"], label["name"], label["volume_ml"]) for label in said["labels"]]
    volumes = [2.5e-3 * np.count_nonzero(labels == value) for value in (5, 7, 1000)]
    assert [label[:2] for label in found] == [("5", "liver"), ("7", "kidney"), ("1000", "")]
    assert [label[2] for label in found] == pytest.approx(volumes)
    for name, kidney_is in {"right": 1, "left": -1}.items():  # on a radiologist's picture
        picture = (255 * imread(f"{name}_check.png")[..., :3]).round().astype(int)
        legend = picture.shape[1] * 0.7
        middle = {}
        for number in (1, 2, 3):
            colour = [int(colour_of(number)[at : at + 2], 16) for at in (1, 3, 5)]
            column = np.flatnonzero((abs(picture - colour) <= 2).all(axis=-1).any(axis=0))
            assert (column > legend).any()
            if number < 3:  # the single voxel lies on none of the slices
                middle[number] = np.median(column[column < picture.shape[1] // 4])
        assert (middle[2] - middle[1]) * kidney_is > 0


def test_check_of_one_label_or_one_of_many_draws_its_outline(here, answer):
    (one,) = answer("check", "liver.nii.gz")
    (chosen,) = answer("check", "labels.nii.gz", "--label", "7", "-o", "7.png")
    assert [label["label"] for label in one["labels"]] == ["1"]
    assert [label["label"] for label in chosen["labels"]] == ["5", "7"]
    assert chosen["slices"].startswith("7 with organ")
    assert {"liver_check.png", "7.png"} <= files(here)


def test_check_of_a_sheet_goes_through_all_rows(here, capsys):
    Path("names.csv").write_text("label,name\n5,liver\n7,kidney\n")
    rows = [
        "case organ mask label labels",
        "anna liver labels.nii.gz 5 ",
        "anna spleen labels.nii.gz 9 ",
        "bob * labels.nii.gz  names.csv",
        "carl * gone.nii.gz  ",
    ]
    Path("sheet.tsv").write_text("".join(row.replace(" ", "\t") + "\n" for row in rows))
    assert main(["check", "sheet.tsv", "--json"]) == 1
    said = capsys.readouterr()
    one, whole = json.loads(said.out)
    assert (one["picture"], whole["picture"]) == ("sheet_check/anna_liver.png", "sheet_check/bob.png")
    assert (one["case"], whole["case"]) == ("anna", "bob")
    assert [(label["label"], label["name"]) for label in whole["labels"]] == [("5", "liver"), ("7", "kidney")]
    assert (here / one["picture"]).is_file()
    assert (here / whole["picture"]).is_file()
    assert not list(here.glob("*.png"))
    first, second = said.err.splitlines()
    assert first.startswith("Error: sheet.tsv row 3: labels.nii.gz: it has no label '9'")
    assert second.startswith("Error: sheet.tsv row 5: mask: there is no gone.nii.gz")
    assert main(["check", "sheet.tsv", "-o", "one.png"]) == 1
    assert "each row has a picture of its own" in capsys.readouterr().err


def test_check_of_drawn_regions_and_of_a_folder_of_masks(here, answer):
    rois = {"Liver": ball(), "Vessel": ball(radius=3), "Point": ball(radius=1)}
    (here / "drawn").mkdir()
    drawn = {name: scans.outlines(mask, AFFINE) for name, mask in rois.items()}
    scans.write_structure_set(here / "drawn" / "rt", drawn)
    (here / "masks").mkdir()
    for name, mask in rois.items():
        nibabel.save(nibabel.Nifti1Image(mask.astype(np.uint8), AFFINE), here / "masks" / f"{name}.nii.gz")
    for folder, first, left in (("drawn", "1", []), ("masks", "Liver", ["Point"])):
        (said,) = answer("check", folder)
        assert {label["name"] for label in said["labels"]} == set(rois)
        assert said["labels"][0]["label"] == first
        assert said["labels"][0]["volume_ml"] == pytest.approx(BALL_ML, abs=1e-4)
        assert [label["name"] for label in said["labels"] if label["note"]] == left


def test_check_tells_probabilities_from_a_mask(here, capsys):
    offset = (np.indices((24, 24, 13)) - np.array((12, 12, 6)).reshape(3, 1, 1, 1)).T * (1, 1, 2.5)
    chance = 1 / (1 + np.exp(np.linalg.norm(offset, axis=-1) - 8)).T
    nibabel.save(nibabel.Nifti1Image(chance.astype(np.float32), AFFINE), here / "chance.nii.gz")
    assert main(["check", "chance.nii.gz"]) == 0
    assert "probabilities, traced at 0.5" in capsys.readouterr().out


WRONG = {
    "no file": ("surface livre.nii.gz", "did you mean 'liver.nii.gz'"),
    "no scan to segment": (
        "segment scan.nii.gz --segmenter hippocampus",
        "Error: scan: there is no scan.nii.gz",
    ),
    "no mesh to put on a scan": ("surface spleen.stl --like liver.nii.gz", "there is no spleen.stl"),
    "no folder": ("surface there/liver.nii.gz", "nor its folder"),
    "a folder of nothing": ("surface nothing", "no file in this folder"),
    "an empty mask": ("surface empty.nii.gz", "the mask is empty"),
    "a label that is not there": ("surface labels.nii.gz --label 6", "choose one of 5, 7"),
    "an unknown suffix": ("surface liver.nii.gz -o a.tsl", ".obj, .ply, "),
    "no folder to write into": ("surface liver.nii.gz -o liver.nii.gz/a.ply", "not a folder"),
    "over the input": ("surface liver.nii.gz -o liver.nii.gz", "that is the input"),
    "a folder as output": ("surface liver.nii.gz -o taken.ply", "that is a folder"),
    "a folder of organs": ("surface labels.nii.gz --all-labels -o all/", "name a file: all/all.ply, which"),
    "over the image": ("surface liver.nii.gz --image labels.nii.gz -o labels.nii.gz", "that is the input"),
    "over a mask of a folder": ("surface . --label liver -o liver.nii.gz", "that is the input"),
    "a picture over the input": ("check liver.nii.gz -o liver.nii.gz", "end its name with .png"),
    "a folder as picture": ("check liver.nii.gz -o folder.png", "that is a folder"),
    "a SEG of no series": (
        "surface liver.nii.gz -o a.ply -o a.seg.dcm",
        "a.seg.dcm: a SEG needs its DICOM series",
    ),
    "one output twice": ("surface liver.nii.gz -o a.ply -o a.ply", "named twice"),
    "a label of one mask": ("surface liver.nii.gz --label liver", "no label 'liver'"),
    "names of one label": ("surface labels.nii.gz --names names.csv", "add --all-labels"),
    "no process": ("surface labels.nii.gz --all-labels --cores 0", "give 1 or more"),
    "one label and all": ("surface labels.nii.gz --label 5 --all-labels", "leave --label out"),
    "a threshold upside down": ("surface liver.nii.gz --threshold 300:100", "300.0, 100.0) is not a range"),
    "a folder of boundary maps": ("surface nothing --boundary", "a folder, not a volume"),
    "a sheet as mask": ("surface table.tsv", "a table, not a volume"),
    "a mask as sheet": ("run liver.nii.gz", "not a cohort sheet"),
    "no segmenter": ("segment liver.nii.gz --segmenter lvier", "choose one of hippocampus"),
    "no report": ("report nothing", "no structure is finished there"),
    "no sheet": ("run sheet.tsv", "no such cohort sheet"),
    "no level": ("run nothing", "participant"),
    "no masks in BIDS": ("run nothing out participant", "no sub-*_mask.nii.gz"),
    "no finished structure": ("export absent -o a.stl", "absent/surface.h5"),
    "no configuration": ("surface liver.nii.gz --configfile mine.yaml", "mine.yaml: not there"),
    "a table as configuration": ("surface liver.nii.gz --configfile table.tsv", "no YAML"),
    "a configuration of bytes": ("surface liver.nii.gz --configfile liver.nii.gz", "no YAML"),
    "a word as configuration": ("surface liver.nii.gz --configfile word.yaml", "no keys with"),
    "an unknown key": (
        "surface liver.nii.gz --configfile key.yaml",
        "surface.tetrahedra.element: unknown key; did you mean 'elements'?",
    ),
    "not for Snakemake": ("surface liver.nii.gz -- --dry-run", "leave them out"),
}

WRONG |= {
    f"segment {options}": (f"segment liver.nii.gz --segmenter hippocampus {options}", words)
    for options, words in {
        "--labels liver.nii.gz": "that is the input",
        "--labels a.ply": "end its name with .nii.gz",
        "--organ liver": "trained to find hippocampus, not liver",
        "--labels a.nii.gz -o a.nii.gz": "named twice",
    }.items()
}


@pytest.mark.parametrize(("arguments", "words"), WRONG.values(), ids=WRONG)
def test_what_cannot_work_ends_in_one_line(here, refused, arguments, words):
    (here / "nothing").mkdir()
    (here / "taken.ply").mkdir()
    (here / "folder.png").mkdir()
    (here / "table.tsv").write_text("case\torgan\tmask\n")
    (here / "word.yaml").write_text("gmsh\n")
    (here / "key.yaml").write_text("surface: {tetrahedra: {element: tet10}}\n")
    before = contents(here)
    assert words in refused(*arguments.split())
    assert contents(here) == before


@pytest.mark.parametrize("command", [["check"], ["surface"], ["surface", "--all-labels"]])
def test_the_folder_one_is_in_has_a_name(here, refused, monkeypatch, command):
    (here / "nothing").mkdir()
    monkeypatch.chdir(here / "nothing")
    assert refused(*command, ".").startswith("Error: nothing: there is no file in this folder")


@pytest.fixture(scope="module")
def written_image(tmp_path_factory):
    folder = tmp_path_factory.mktemp("image")
    grey = np.where(ball(), 100, -900).astype(np.int16)
    grey += np.random.default_rng(0).integers(-20, 20, grey.shape).astype(np.int16)
    scans.write_series(folder / "scan", grey, AFFINE)
    scans.write_nifti(folder / "scan.nii.gz", grey, AFFINE)
    return folder


@pytest.fixture
def image_alone(here, written_image):
    """An image alone, as a series, a file of it, and NIfTI: a bright ball in air."""
    return shutil.copytree(written_image, here, dirs_exist_ok=True)


@pytest.mark.parametrize("command", ["surface", "check"])
@pytest.mark.parametrize("name", ["scan", "scan.nii.gz", "scan/000.dcm"])
@pytest.mark.parametrize(
    "label", [[], ["--label", "liver"], ["--label", "5"]], ids=["none", "name", "number"]
)
def test_no_organ_is_found_in_an_image_without_a_mask(image_alone, refused, command, name, label):
    before = files(image_alone)
    line = refused(command, name, *label)
    assert name.rsplit("/", 1)[-1] in line
    assert "--threshold LOW:HIGH" in line
    assert "--image" in line
    assert files(image_alone) == before


@pytest.mark.parametrize("name", ["scan", "scan.nii.gz"])
@pytest.mark.parametrize("window", [[], ["0:"], ["-200:300"]], ids=str)
def test_a_threshold_is_called_one(image_alone, answer, name, window):
    (made,) = answer("surface", name, "--threshold", *window)["surfaces"]
    assert made["organ"] == "threshold"
    assert made["files"] == ["scan_threshold.ply"]
    assert made["volume_ml"] == pytest.approx(2.145, rel=0.05)
    assert any("no mask; the organ is found by a threshold" in warning for warning in made["warnings"])
    (said,) = answer("check", "--threshold", *window, name)  # before the input as well
    assert (said["organ"], said["picture"]) == ("threshold", "scan_threshold_check.png")
    assert "grey values" in said["input"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("scan.nii.gz --threshold --label liver", "a threshold does not find organs"),
        ("scan.nii.gz --threshold --image liver.nii.gz", "give only the image"),
        ("scan.nii.gz --threshold --all-labels", "has no labels"),
        ("scan --all-labels", "an image without a mask"),
        ("scan.nii.gz --threshold 150", "'150' is not a range; give LOW:HIGH"),
        ("scan.nii.gz --threshold :", "is not a range"),
        ("scan.nii.gz --threshold 200:100", "is not a range"),
        ("scan.nii.gz --threshold 3000:", "no region between 3000"),
        ("scan.nii.gz --seed 1,2", "scan.nii.gz: seed '1,2' is not known; give a voxel 120,88,40 or a box"),
        ("scan.nii.gz --seed 0,0,0", "lies in the background"),
        ("scan.nii.gz --seed 99,0,0", "seed 99,0,0 lies outside the scan"),
        ("scan.nii.gz --seed 3,3,3 --label liver", "a seed cannot be combined with a label"),
        ("scan.nii.gz --seed 3,3,3 --threshold", "a seed cannot be combined with a threshold"),
        ("scan.nii.gz --seed 3,3,3 --all-labels", "--seed: an image without a mask has no labels"),
    ],
)
def test_thresholds_and_seeds_that_cannot_be_meant(image_alone, refused, arguments, words):
    assert words in refused("surface", *arguments.split())


@pytest.mark.parametrize("name", ["scan", "scan.nii.gz"])
def test_a_seed_says_where_the_organ_is(image_alone, answer, name):
    middle = ",".join(str(int(index)) for index in np.argwhere(ball()).mean(axis=0))
    (made,) = answer("surface", name, "--seed", middle)["surfaces"]
    assert (made["organ"], made["files"]) == ("seeded", ["scan_seeded.ply"])
    assert made["volume_ml"] == pytest.approx(2.145, rel=0.06)
    assert any(f"no mask; the organ is grown from seed {middle}" in warning for warning in made["warnings"])


def test_what_cannot_be_referred_to_is_said_before_the_work(image_alone, refused, monkeypatch):
    file = min((image_alone / "scan").iterdir())
    image = pydicom.dcmread(file)
    del image.SOPClassUID, image.file_meta.MediaStorageSOPClassUID
    pydicom.dcmwrite(file, image, enforce_file_format=False)
    monkeypatch.setattr(cccd, "reconstruct", None)
    before = files(image_alone)
    for suffix in ("dcm", "seg.dcm", "stl.dcm"):
        asked = ("surface", "liver.nii.gz", "--image", "scan", "-o", "a.ply", "-o", f"a.{suffix}")
        assert f"{file.name}: it has no SOPClassUID" in refused(*asked)
    assert files(image_alone) == before


def test_a_threshold_in_python(image_alone):
    with pytest.raises(cccd.InputError, match="an image without a mask, so it has no label 'liver'"):
        cccd.read("scan", "liver")
    with pytest.raises(cccd.InputError, match="an image without a mask"):
        cccd.labels("scan")
    for threshold in (True, (0, None), (-200, 300)):
        structure = cccd.read("scan", threshold=threshold)
        assert structure.organ == "threshold"
        assert structure.mask.sum() == ball().sum()


UNWRITABLE = {
    "not by root": ("surface nowhere.nii.gz -o /proc/a.ply", "/proc/a.ply: the folder"),
    "nor below": ("surface nowhere.nii.gz -o /sys/new/a.stl", "/sys/new/a.stl: the folder"),
    "no labels": ("segment nowhere.nii.gz --segmenter a --labels /proc/a.nii", "/proc/a.nii:"),
    "no picture": ("check liver.nii.gz -o /proc/a.png", "/proc/a.png: the folder"),
    "no results": ("run sheet.tsv --directory /proc", "/proc/results: the folder"),
    "no sheet of BIDS": ("run . /proc/out participant", "/proc/out/cohort.tsv: the folder"),
    "no report": ("report . -o /sys/a.html", "/sys/a.html: the folder"),
    "below a file": ("surface nowhere.nii.gz -o liver.nii.gz/b/a.ply", "liver.nii.gz is not a folder"),
}


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="there is no /proc")
@pytest.mark.parametrize(("arguments", "words"), UNWRITABLE.values(), ids=UNWRITABLE)
def test_what_cannot_be_written_is_refused_before_anything_is_read(here, refused, arguments, words):
    (here / "sheet.tsv").write_text("case\torgan\tmask\na\tliver\tliver.nii.gz\n")
    before = files(here)
    line = refused(*arguments.split())
    assert words in line
    assert "give a folder that you can write to" in line
    assert files(here) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_rights_is_refused(here, refused):
    here.chmod(0o500)
    try:
        assert f"the folder {here} is not writable" in refused("surface", "liver.nii.gz")
    finally:
        here.chmod(0o700)


def test_a_signal_is_heard_where_c_calls_back_as_compilers_do():
    callback = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGTERM))
    with pytest.raises(KeyboardInterrupt), interruptible():
        (callback(), time.sleep(5))


def test_interrupting_ends_tetrahedra_at_once_and_leaves_nothing(here, capsys):
    pytest.importorskip("pytetwild", reason="the extra fe is not installed")
    (here / "fine.yaml").write_text(
        "surface: {tetrahedra: {edge_mm: 1, tolerance_mm: .01, most: 10000000}}\n"
    )
    before, asked = files(here), []

    def interrupt():
        while not psutil.Process().children():
            time.sleep(0.2)
        asked.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGTERM)

    Thread(target=interrupt, daemon=True).start()
    assert main(["surface", "liver.nii.gz", "-o", "new/liver.msh", "--configfile", "fine.yaml"]) == 143
    assert time.monotonic() - asked[0] < 10
    assert capsys.readouterr().err.splitlines()[-1].startswith("Error: interrupted")
    assert files(here) == before


def test_a_bids_data_set_becomes_a_sheet_and_a_snakemake_command(here, refused, monkeypatch):
    folder = here / "bids" / "derivatives" / "seg" / "sub-01" / "anat"
    folder.mkdir(parents=True)
    (here / "labels.nii.gz").rename(folder / "sub-01_dseg.nii.gz")
    (here / "liver.nii.gz").rename(folder / "sub-01_space-T1w_label-liver_mask.nii.gz")
    (folder / "sub-01_dseg.tsv").write_text("index\tname\n5\tLeft kidney\n")
    called = []
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: called.append(command) or Finished())
    asked = ["run", "bids", "out", "participant", "--cores", "3"]
    assert main([*asked, "--", "--dry-run", "--config", "seed=7", "results/a"]) == 0
    rows = [line.split("\t") for line in (here / "out" / "cohort.tsv").read_text().splitlines()[1:]]
    assert [row[:2] + row[3:] for row in rows] == [
        ["sub-01_seg", "Left_kidney", "5"],
        ["sub-01_seg", "label_7", "7"],
        ["sub-01_seg", "liver", ""],
    ]
    (command,) = called
    tail = command[command.index("--directory") :]
    sheet = f"cohort={here / 'out' / 'cohort.tsv'}"
    words = f"--directory {here / 'out'} --config {sheet} seed=7 --cores 3 --dry-run results/a"
    assert tail == words.split(" ")
    assert "sub-01" in refused("run", "bids", "out", "participant", "--participant-label", "02")


def test_options_of_a_surface_stand_in_groups(capsys):
    with pytest.raises(SystemExit):
        main(["surface", "--help"])
    said = capsys.readouterr().out.splitlines()
    groups = ["what is read:", "what is written:", "all labels:", "the surface:"]
    assert [line for line in said if line in groups] == groups


def test_pieces_are_counted(here, capsys):
    mask = np.concatenate([ball(), ball()]).astype(np.uint8)
    nibabel.save(nibabel.Nifti1Image(mask, AFFINE), "two.nii.gz")
    assert main(["surface", "two.nii.gz"]) == 0
    assert " mm, 2 pieces, " in capsys.readouterr().out


class Finished:
    def wait(self):
        return 0


def test_the_workflow_takes_the_common_options_of_snakemake(here, monkeypatch):
    called = []
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: called.append(command) or Finished())
    (here / "sheet.tsv").write_text("case\torgan\tmask\na\tliver\tliver.nii.gz\n")
    (here / "own.yaml").write_text("compare: true\n")
    asked = ["run", "sheet.tsv", "--configfile", "own.yaml", "--keep-going", "--dry-run"]
    assert main([*asked, "--", "surfaces"]) == 0
    (command,) = called
    assert command[command.index("--configfile") + 1] == str(here / "own.yaml")
    assert command[-3:] == ["--keep-going", "--dry-run", "surfaces"]
    assert main(["run", "sheet.tsv", "--configfile", "nowhere.yaml"]) == 1


def test_a_profile_names_the_plugin_that_it_needs(here, refused):
    (here / "sheet.tsv").write_text("case\torgan\tmask\na\tliver\tliver.nii.gz\n")
    (here / "own").mkdir()
    (here / "own" / "config.yaml").write_text("executor: no-such\n")
    said = "Error: --profile own: snakemake-executor-plugin-no-such is not installed; run pip install "
    line = refused("run", "sheet.tsv", "--profile", "own")
    assert line == f"{said}snakemake-executor-plugin-no-such"


def test_the_doctor_names_the_extra_that_is_missing():
    assert _extra("dicom", ("pydicom",)).works
    absent = _extra("none", ("no_such_module",))
    assert not absent.works
    assert "pip install '.[none]'" in absent.detail


def test_no_command_shows_the_help_at_once():
    said = fresh.python("import sys; from cccd.cli import main; assert main([]) == 0; print(*sys.modules)")
    assert "cccd surface liver.nii.gz" in said
    assert "numpy" not in said.splitlines()[-1].split()


def test_triangles_of_one_size_are_counted_and_measured(here, capsys, refused, answer):
    (made,) = answer("surface", "liver.nii.gz", "--triangles", "1500", "-o", "liver.stl")["surfaces"]
    assert made["triangles"] == pytest.approx(1500, rel=0.02)
    assert 0 < made["chord_error_mm"] < 0.3
    print_surface(made)
    assert f"  {made['spline_ml']:.3f} ml (" in capsys.readouterr().out  # the interval is the spline's
    line = refused("surface", "labels.nii.gz", "--all-labels", "--edge-mm", "2", "-o", "all.stl")
    assert "--edge-mm: neighbours that share a wall" in line
    assert files(here) == {"liver.nii.gz", "labels.nii.gz", "empty.nii.gz", "liver.stl"}


def test_materials_come_from_the_scan(here, refused):
    pytest.importorskip("pytetwild", reason="the extra fe is not installed")
    grey = np.broadcast_to(10 * (np.arange(24) - 12)[:, None, None], ball().shape).astype(np.int16)
    nibabel.save(nibabel.Nifti1Image(grey, AFFINE), here / "ct.nii.gz")
    (here / "tissue.csv").write_text("hu_from,hu_to,density,young_mpa,poisson\n,0,0.9,1,0.4\n0,,1.0,5,0.45\n")
    (here / "fe.yaml").write_text("surface: {tetrahedra: {elements: tet10, edge_mm: 6, tolerance_mm: .5}}\n")
    asked = ["surface", "liver.nii.gz", "--materials", "tissue.csv", "--configfile", "fe.yaml"]
    assert main([*asked, "--image", "ct.nii.gz", "-o", "liver.vtu"]) == 0
    solid = pyvista.read("liver.vtu").extract_cells_by_type(pyvista.CellType.QUADRATIC_TETRA)
    expected = 10 * (solid.cell_centers().points[:, 0] - 12)  # a ramp's mean is its value at the centroid
    assert solid["grey"] == pytest.approx(expected, abs=3)
    assert solid["young"][expected > 30] == pytest.approx(5)
    assert solid["young"][expected < -30] == pytest.approx(1)
    assert "liver: materials need the grey values of its scan" in refused(*asked, "-o", "liver.feb")
    assert "--materials: no output has tetrahedra" in refused(*asked, "-o", "liver.ply")
    assert not (here / "liver.feb").exists()
