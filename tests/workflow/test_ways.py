"""The data decide the way to the contours: what masks, drawn contours and boundary maps wait for."""

import json

import h5py
import nibabel
import numpy as np
import pandas as pd
import pytest
import trimesh
from support import scans

import cccd

#: Loaded by every Python: whatever imports torch fails.
NO_TORCH = """
import sys
class NoTorch:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] == "torch":
            raise ImportError("this run was to do without torch")
sys.meta_path.insert(0, NoTorch())
"""

NETWORK = {"generate_graphs", "train_gnn", "adopt_gnn", "evaluate_gnn"}


def ball() -> np.ndarray:
    offset = np.indices((24, 24, 16)) - np.array([12, 12, 7.5]).reshape(3, 1, 1, 1)
    return (offset**2).sum(0) < 6.5**2


def outline(mask: np.ndarray) -> np.ndarray:
    """A mask's pixels beside its background in the slice."""
    edge = np.zeros_like(mask)
    for axis in (0, 1):
        for step in (1, -1):
            edge |= mask & ~np.roll(mask, step, axis)
    return edge


@pytest.fixture
def sheet(fresh_project):
    """A sheet of one structure of each kind, and what chooses it on the command line."""
    folder, mask = fresh_project.folder, ball()
    for name, data in {"mask": mask, "map": outline(mask), "image": 100.0 * mask}.items():
        image = nibabel.Nifti1Image(data.astype(np.float32), np.diag([1.0, 1.0, 2.0, 1.0]))
        nibabel.save(image, folder / f"{name}.nii.gz")
    (folder / "drawn").mkdir()
    drawn = scans.outlines(mask, np.diag([1.0, 1.0, 2.0, 1.0]))
    scans.write_structure_set(folder / "drawn" / "contours", {"ball": drawn})
    rows = [
        "case\torgan\timage\tmask\tboundary",
        "mask\tball\t\tmask.nii.gz\t",
        "scan\tball\timage.nii.gz\t\t",
        "file\tball\t\tdrawn/contours\t",
        "folder\tball\t\tdrawn\t",
        "map\tball\timage.nii.gz\t\tmap.nii.gz",
    ]
    (folder / "ways.tsv").write_text("\n".join(rows) + "\n")
    return ["--config", "cohort=ways.tsv", "train=auto"]


@pytest.mark.parametrize(("cases", "extra"), [(["mask", "file", "folder"], {}), (["map"], {"adopt_gnn": 1})])
def test_only_what_needs_the_network_waits_for_it(fresh_project, sheet, cases, extra):
    planned = fresh_project.planned(*sheet, "--", *surfaces_of(cases))
    assert planned == {"import_structure": len(cases), "loft_surface": len(cases)} | extra


def test_a_mask_is_ordered_by_the_network_when_that_is_asked_for(fresh_project, sheet):
    asked = [*sheet, "curves={ordering: gnn}", "--", *surfaces_of(["scan", "file"])]
    assert fresh_project.planned(*asked) == {
        "import_structure": 1,
        "import_image": 1,  # draws the region that it finds, too
        "loft_surface": 2,
        "adopt_gnn": 1,
    }


def surfaces_of(cases):
    """The files of some cases' surfaces."""
    return [f"results/{case}/ball/surface.ply" for case in cases]


def test_every_way_ends_in_the_same_layout(fresh_project, sheet):
    cases = {"mask": "traced mask", "folder": "contours as given", "map": "GNN"}
    targets = [f"results/{case}/ball/curves.h5" for case in cases]
    fresh_project.snakemake(*sheet, "--", *targets)
    layouts = []
    for case, method in cases.items():
        with h5py.File(fresh_project.results / case / "ball" / "contours.h5") as file:
            assert f'"method": "{method}"' in file.attrs["report"]
            layouts.append({name: part.dtype for name, part in file["ordered"].items()})
            assert len(np.unique(file["ordered/slice"][:])) == ball().any((0, 1)).sum()
    assert layouts[0] == layouts[1]
    assert layouts[2] == layouts[0] | {"uncertainty": np.float64}  # only a network doubts


def test_a_cohort_of_masks_and_contours_does_without_model_and_torch(fresh_project, sheet, tmp_path):
    lines = (fresh_project.folder / "ways.tsv").read_text().splitlines()
    rows = [f"{lines[0]}\trole", f"{lines[1]}\tboth", f"{lines[4]}\tmeasure"]
    (fresh_project.folder / "ways.tsv").write_text("\n".join(rows) + "\n")
    assert NETWORK.isdisjoint(fresh_project.planned(*sheet))
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text(NO_TORCH)
    env = fresh_project.surroundings()["env"] | {"PYTHONPATH": str(tmp_path / "site")}
    fresh_project.snakemake(*sheet, env=env)
    assert (fresh_project.results / "report.html").exists()
    assert not (fresh_project.results / "gnn").exists()
    assert not (fresh_project.results / "tables" / "junctions.csv").exists()
    ordering = pd.read_csv(fresh_project.results / "tables" / "ordering.csv")
    assert ordering["method"].tolist() == ["traced mask", "contours as given"]
    for case, path in {"mask": "mask.nii.gz", "folder": "drawn"}.items():
        cccd.reconstruct(cccd.read(fresh_project.folder / path)).write(tmp_path / f"{case}.ply")
        workflow = fresh_project.results / case / "ball" / "surface.ply"
        assert (tmp_path / f"{case}.ply").read_bytes() == workflow.read_bytes()


def test_slices_that_nobody_drew_are_filled_on_the_scans_grid(fresh_project, sheet):
    mask = ball()
    mask[:, :, np.setdiff1d(np.arange(16), [3, 6, 9, 11])] = False
    image = nibabel.Nifti1Image(mask.astype(np.uint8), np.diag([1.0, 1.0, 2.0, 1.0]))
    nibabel.save(image, fresh_project.folder / "some.nii.gz")
    rows = "case\torgan\tmask\tannotated\nsome\tball\tsome.nii.gz\tnonempty\n"
    (fresh_project.folder / "ways.tsv").write_text(rows)
    names = ("surface.nii.gz", "metrics.json", "report.html", "surface_inner.stl", "surface_outer.stl")
    files = [f"results/some/ball/{name}" for name in names]
    fresh_project.snakemake(*sheet, "--", *files)
    filled = nibabel.load(fresh_project.folder / files[0])
    assert np.array_equal(filled.affine, image.affine)
    values = np.asarray(filled.dataobj) > 0
    drawn = mask.any(axis=(0, 1))
    assert np.array_equal(values[:, :, drawn], mask[:, :, drawn])
    assert 2 * (values & ball()).sum() / (values.sum() + ball().sum()) > 0.93
    metrics = json.loads((fresh_project.folder / files[1]).read_text())
    assert any("annotated on 4 of 9 slices, 2 to 3 apart" in warning for warning in metrics["warnings"])
    assert metrics["surface"]["dice_3d"] > 0.95
    named = [row["slice"] for row in metrics["next_slices"]]
    assert named
    assert not drawn[named].any()
    assert [row["gap"] for row in metrics["next_slices"]] == [2, 2, 1]
    page = (fresh_project.folder / files[2]).read_text()
    assert f"Annotate slice {named[0]} next" in page
    volumes = [trimesh.load(fresh_project.folder / file).volume / 1000 for file in files[3:]]
    assert 0 < volumes[0] < metrics["surface"]["volume_ml"] < volumes[1]
