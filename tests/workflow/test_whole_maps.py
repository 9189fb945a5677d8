"""A whole label map by one row of the sheet: every label a structure, and one scene of them all."""

import json

import nibabel as nib
import numpy as np

from cccd.geometry.ply import read_ply

NAMES = "label,name,color,code\n1,Left half,#ff0000,SCT^7771000\n2,Right half,,\n"


def test_a_row_for_all_labels_leaves_organs_that_share_their_walls(fresh_project):
    x, y, z = np.indices((26, 26, 26)) - 12.6
    labels = np.where(np.sqrt(x * x + y * y + z * z) < 9, np.where(x < 0, 1, 2), 0)
    labels[1, 1, 1] = 9
    folder = fresh_project.folder
    nib.save(nib.Nifti1Image(labels.astype(np.uint8), np.diag([1.5, 1.5, 1.5, 1])), folder / "map.nii.gz")
    (folder / "names.csv").write_text(NAMES)
    (folder / "tiny.tsv").write_text("case\torgan\tmask\tlabels\nball\t*\tmap.nii.gz\tnames.csv\n")
    run = fresh_project.snakemake("results/ball/scene.html", "results/ball/scene.glb")
    assert "label 9 (no name) is left out: a single voxel" in run.stderr
    scene = json.loads((fresh_project.results / "ball" / "scene.json").read_text())
    assert [(organ["organ"], organ["label"]) for organ in scene["organs"]] == [
        ("Left_half", 1),
        ("Right_half", 2),
    ]
    left, right = (
        read_ply(fresh_project.results / "ball" / name / "surface.ply")
        for name in ("Left_half", "Right_half")
    )
    assert left.is_closed_manifold
    assert right.is_closed_manifold
    common = {point.tobytes() for point in left.vertices} & {point.tobytes() for point in right.vertices}
    assert len(common) > 100
    assert fresh_project.planned("results/ball/scene.html") == {}
