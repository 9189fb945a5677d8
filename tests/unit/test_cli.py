"""The command: what a newcomer types works; what cannot work ends in one line, with nothing half written."""

import json
import os
import runpy
import subprocess
import sys
from pathlib import Path

import nibabel
import numpy as np
import pytest

import cccd
from cccd.cli import main
from cccd.doctor import _extra

ROOT = Path(__file__).parents[2]
SCANS = runpy.run_path(str(Path(__file__).parent / "volumes" / "scans.py"))
AFFINE = np.diag([1.0, 1.0, 2.5, 1.0])


def ball(centre=(12, 12, 6), radius=8.0):
    offset = (np.indices((24, 24, 13)) - np.array(centre).reshape(3, 1, 1, 1)).T * (1, 1, 2.5)
    return (np.linalg.norm(offset, axis=-1) <= radius).T


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


def test_a_mask_becomes_a_surface(here, capsys):
    assert main(["surface", "liver.nii.gz"]) == 0
    said = capsys.readouterr()
    assert "liver.ply" in said.out
    assert " ml, " in said.out
    cccd.reconstruct(cccd.read("liver.nii.gz")).write("library.ply")
    assert (here / "library.ply").read_bytes() == (here / "liver.ply").read_bytes()


def test_every_label_a_file_in_every_format_that_was_asked_for(here, capsys):
    asked = [
        "surface",
        "labels.nii.gz",
        "--all-labels",
        "-o",
        "out/organ.stl",
        "-o",
        "out/organ.nii.gz",
        "--json",
    ]
    assert main(asked) == 0
    made = json.loads(capsys.readouterr().out)["surfaces"]
    kinds = ("stl", "nii.gz")
    assert files(here / "out") == {f"organ_label_{label}.{kind}" for label in (5, 7) for kind in kinds}
    assert [surface["volume_ml"] for surface in made] == pytest.approx([2.145, 0.21], rel=0.1)


def test_a_file_of_settings_reaches_all_that_follows(here, capsys):
    pytest.importorskip("OCP", reason="the extra cad is not installed")
    (here / "coarse.yaml").write_text(
        "surface: {edge_voxels: 4, step_tolerance_mm: 2, solid: {first_patches: 60}}\n"
    )
    assert main(["surface", "liver.nii.gz", "-o", "a.ply", "-o", "a.step"]) == 0
    asked = ["surface", "liver.nii.gz", "-o", "b.ply", "-o", "b.step", "--configfile", "coarse.yaml"]
    assert main(asked) == 0
    sizes = {name: (here / name).stat().st_size for name in ("a.ply", "b.ply", "a.step", "b.step")}
    assert sizes["b.ply"] < sizes["a.ply"] / 2
    assert sizes["b.step"] < sizes["a.step"] / 2


def test_tetrahedra_by_gmsh_are_asked_for_in_a_file(here, capsys, monkeypatch):
    (here / "by_gmsh.yaml").write_text("surface: {tetrahedra: {mesher: gmsh}}\n")
    monkeypatch.setenv("PATH", str(here))
    monkeypatch.setattr(sys, "executable", str(here / "python"))
    assert main(["surface", "liver.nii.gz", "-o", "a.msh", "--configfile", "by_gmsh.yaml"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "gmsh is not installed" in line
    assert not (here / "a.msh").exists()


def test_dicom_contours_and_what_check_says_of_them(here, capsys):
    pytest.importorskip("pydicom")
    (here / "drawn").mkdir()
    SCANS["write_structure_set"](here / "drawn" / "rt", {"Liver": SCANS["outlines"](ball(), AFFINE)})
    assert main(["surface", "drawn", "--label", "Liver"]) == 0
    assert main(["check", "drawn", "-o", "look.png"]) == 0
    said = capsys.readouterr().out
    assert all(word in said for word in ("drawn contours", "7 with organ", "2.5 mm apart", "1 Liver"))
    assert {"drawn.ply", "look.png"} <= files(here)


def test_check_says_axes_labels_and_cut_ends(here, capsys):
    nibabel.save(nibabel.Nifti1Image(ball((12, 12, 0)).astype(np.uint8), AFFINE), "cut.nii.gz")
    assert main(["check", "cut.nii.gz", "--json"]) == 0
    (said,) = json.loads(capsys.readouterr().out)
    assert said["grid"] == "24 x 24 x 13 voxels of 1 x 1 x 2.5 mm"
    assert "R, A, S" in said["axes"]
    assert any("first slice" in warning for warning in said["warnings"])
    assert main(["check", "labels.nii.gz"]) == 0
    assert "labels:    5, 7" in capsys.readouterr().out


WRONG = {
    "no file": (["surface", "livre.nii.gz"], "did you mean 'liver.nii.gz'"),
    "no folder": (["surface", "there/liver.nii.gz"], "nor its folder"),
    "a folder of nothing": (["surface", "nothing"], "no file in this folder"),
    "an empty mask": (["surface", "empty.nii.gz"], "the mask is empty"),
    "a label that is not there": (["surface", "labels.nii.gz", "--label", "6"], "choose one of 5, 7"),
    "an unknown suffix": (["surface", "liver.nii.gz", "-o", "a.tsl"], ".obj, .ply, "),
    "no folder to write into": (["surface", "liver.nii.gz", "-o", "liver.nii.gz/a.ply"], "not a folder"),
    "over the input": (["surface", "liver.nii.gz", "-o", "liver.nii.gz"], "that is the input"),
    "a folder as output": (["surface", "liver.nii.gz", "-o", "taken.ply"], "that is a folder"),
    "one output twice": (["surface", "liver.nii.gz", "-o", "a.ply", "-o", "a.ply"], "named twice"),
    "a label of one mask": (["surface", "liver.nii.gz", "--label", "liver"], "no label 'liver'"),
    "a sheet as mask": (["surface", "table.tsv"], "a table, not a volume"),
    "a mask as sheet": (["run", "liver.nii.gz"], "not a cohort sheet"),
    "no segmenter": (["segment", "liver.nii.gz", "--segmenter", "lvier"], "choose one of hippocampus"),
    "no report": (["report", "nothing"], "no structure is finished there"),
    "no sheet": (["run", "sheet.tsv"], "no such cohort sheet"),
    "no level": (["run", "nothing"], "participant"),
    "no masks in BIDS": (["run", "nothing", "out", "participant"], "no sub-*_mask.nii.gz"),
    "no finished structure": (["export", "nothing", "-o", "a.stl"], "surface.h5"),
    "no configuration": (["surface", "liver.nii.gz", "--configfile", "mine.yaml"], "mine.yaml: not there"),
    "a table as configuration": (["surface", "liver.nii.gz", "--configfile", "table.tsv"], "no YAML"),
    "a configuration of bytes": (["surface", "liver.nii.gz", "--configfile", "liver.nii.gz"], "no YAML"),
    "a word as configuration": (["surface", "liver.nii.gz", "--configfile", "word.yaml"], "no keys with"),
    "an unknown key": (
        ["surface", "liver.nii.gz", "--configfile", "key.yaml"],
        "surface.tetrahedra.meshr: unknown key; did you mean 'mesher'?",
    ),
    "not for Snakemake": (["surface", "liver.nii.gz", "--", "--dry-run"], "leave them out"),
}


@pytest.mark.parametrize(("arguments", "words"), WRONG.values(), ids=WRONG)
def test_what_cannot_work_ends_in_one_line(here, capsys, arguments, words):
    (here / "nothing").mkdir()
    (here / "taken.ply").mkdir()
    (here / "table.tsv").write_text("case\torgan\tmask\n")
    (here / "word.yaml").write_text("gmsh\n")
    (here / "key.yaml").write_text("surface: {tetrahedra: {meshr: gmsh}}\n")
    before = files(here)
    assert main(arguments) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("Error: ")
    assert words in line
    assert files(here) == before


def test_two_series_in_a_folder_are_refused(here, capsys):
    pytest.importorskip("pydicom")
    for name in ("first", "second"):
        SCANS["write_series"](here / "scan" / name, 100 * ball().astype(np.int16), AFFINE, uid=name)
    assert main(["surface", "scan"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "first" in line
    assert "second" in line


UNWRITABLE = {
    "not by root": (["surface", "nowhere.nii.gz", "-o", "/proc/a.ply"], "/proc/a.ply: nothing can be"),
    "nor below": (["surface", "nowhere.nii.gz", "-o", "/sys/new/a.stl"], "/sys/new/a.stl: nothing can be"),
    "no labels": (
        ["segment", "nowhere.nii.gz", "--segmenter", "a", "--labels", "/proc/a.nii"],
        "/proc/a.nii:",
    ),
    "no picture": (["check", "liver.nii.gz", "-o", "/proc/a.png"], "/proc/a.png: nothing can be"),
    "no results": (["run", "sheet.tsv", "--directory", "/proc"], "/proc/results: nothing can be"),
    "no sheet of BIDS": (["run", ".", "/proc/out", "participant"], "/proc/out/cohort.tsv: nothing can be"),
    "no report": (["report", ".", "-o", "/sys/a.html"], "/sys/a.html: nothing can be"),
    "below a file": (
        ["surface", "nowhere.nii.gz", "-o", "liver.nii.gz/b/a.ply"],
        "liver.nii.gz is not a folder",
    ),
}


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="there is no /proc")
@pytest.mark.parametrize(("arguments", "words"), UNWRITABLE.values(), ids=UNWRITABLE)
def test_what_cannot_be_written_is_refused_before_anything_is_read(here, capsys, arguments, words):
    (here / "sheet.tsv").write_text("case\torgan\tmask\na\tliver\tliver.nii.gz\n")
    before = files(here)
    assert main(arguments) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
    assert "give a folder of your own" in line
    assert files(here) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_rights_is_refused(here, capsys):
    here.chmod(0o500)
    try:
        assert main(["surface", "liver.nii.gz"]) == 1
    finally:
        here.chmod(0o700)
    assert f"nothing can be written in {here}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("suffix", "module", "extra"),
    [("step", "OCP", "cad"), ("msh", "pytetwild", "fe"), ("dcm", "pydicom", "dicom")],
)
def test_a_format_whose_extra_is_missing_is_refused_before_anything_is_read(
    here, capsys, monkeypatch, suffix, module, extra
):
    monkeypatch.setitem(sys.modules, module, None)
    assert main(["surface", "nowhere.nii.gz", "-o", f"liver.{suffix}"]) != 0
    said = capsys.readouterr().err.strip()
    assert said.splitlines() == [said]
    assert f"pip install 'cccd[{extra}]'" in said


def test_interrupting_leaves_nothing_half_written(here, capsys, monkeypatch):
    def interrupted(self, path, *settings):
        from cccd.store import atomic_path

        with atomic_path(path) as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    monkeypatch.setattr(cccd.Surface, "write", interrupted)
    before = files(here)
    assert main(["surface", "liver.nii.gz", "-o", "new/liver.ply"]) == 130
    assert capsys.readouterr().err.splitlines()[-1].startswith("Error: interrupted")
    assert files(here) == before


def test_a_bids_data_set_becomes_a_sheet_and_a_snakemake_command(here, capsys, monkeypatch):
    folder = here / "bids" / "derivatives" / "seg" / "sub-01" / "anat"
    folder.mkdir(parents=True)
    (here / "labels.nii.gz").rename(folder / "sub-01_dseg.nii.gz")
    (here / "liver.nii.gz").rename(folder / "sub-01_space-T1w_label-liver_mask.nii.gz")
    (folder / "sub-01_dseg.tsv").write_text("index\tname\n5\tLeft kidney\n")
    called = []
    monkeypatch.setattr(subprocess, "Popen", lambda command: called.append(command) or Finished())
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
    assert tail == [
        "--directory",
        str(here / "out"),
        "--config",
        sheet,
        "seed=7",
        "--cores",
        "3",
        "--dry-run",
        "results/a",
    ]
    assert main(["run", "bids", "out", "participant", "--participant-label", "02"]) == 1
    assert "sub-01" in capsys.readouterr().err


class Finished:
    def wait(self):
        return 0


def test_the_doctor_names_the_extra_that_is_missing():
    assert _extra("dicom", ("pydicom",)).works
    absent = _extra("none", ("no_such_module",))
    assert not absent.works
    assert "pip install 'cccd[none]'" in absent.detail


def test_help_is_there_at_once():
    code = (
        "import sys; from cccd.cli import main\ntry: main(['--help'])\nexcept SystemExit: print(*sys.modules)"
    )
    env = os.environ | {"PYTHONPATH": str(ROOT / "scripts")}
    run = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True)
    assert "cccd surface liver.nii.gz" in run.stdout
    assert "numpy" not in run.stdout.splitlines()[-1].split()
