"""A whole label map by one row of the sheet: every label a structure, and one scene of them all."""

import json
from importlib.util import find_spec

import nibabel as nib
import numpy as np
import pandas as pd
import pytest

import cccd
from cccd.store import read_bodies, read_ply

#: Files of whole cases, by the module that they need and their format.
CASE_FORMATS = {
    "OCP": {"step": "scene.step"},
    "pytetwild": {"msh": "volume.msh", "vtu": "volume.vtu", "inp": "volume.inp"},
}
NAMES = "label,name,color,code\n1,Left half,#ff0000,SCT^7771000\n2,Right half,,\n"


def test_a_row_for_all_labels_leaves_organs_that_share_their_walls(fresh_project):
    x, y, z = np.indices((26, 26, 26)) - 12.6
    labels = np.where(np.sqrt(x * x + y * y + z * z) < 9, np.where(x < 0, 1, 2), 0)
    labels[1, 1, 1] = 9
    folder = fresh_project.folder
    nib.save(nib.Nifti1Image(labels.astype(np.uint8), np.diag([1.5, 1.5, 1.5, 1])), folder / "map.nii.gz")
    (folder / "names.csv").write_text(NAMES)
    (folder / "tiny.tsv").write_text("case\torgan\tmask\tlabels\nball\t*\tmap.nii.gz\tnames.csv\n")
    asked = {module: names for module, names in CASE_FORMATS.items() if find_spec(module)}
    sizes = {
        "step_tolerance_mm": 0.5,
        "tetrahedra": {"edge_mm": 8.0, "tolerance_mm": 0.5},
    }
    formats = {"case_formats": [form for names in asked.values() for form in names]}
    config = ["--config", f"surface={json.dumps(sizes | formats)}"]
    targets = ["scene.html", "scene.glb", *(file for names in asked.values() for file in names.values())]
    files = [f"results/ball/{target}" for target in (*targets, "distances.csv", "Left_half/metrics.json")]
    run = fresh_project.snakemake(*files, *config)
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
    assert len(common) > 50  # a plane needs few triangles
    # the library makes the same, and neither keeps a spline that is not the surface
    alone, _ = cccd.reconstruct_labels(folder / "map.nii.gz", table=folder / "names.csv")
    for surface, mesh in zip(alone, (left, right), strict=True):
        assert np.array_equal(surface.vertices, mesh.vertices)
        assert (
            surface.bodies == read_bodies(fresh_project.results / "ball" / surface.name / "surface.h5") == []
        )
    metrics = json.loads((fresh_project.results / "ball" / "Left_half" / "metrics.json").read_text())
    assert metrics["surface"]["control_bytes"] == 0
    assert "compactness" not in metrics["surface"]
    between = pd.read_csv(fresh_project.results / "ball" / "distances.csv").iloc[0]
    assert list(between[:3]) == ["ball", "Left_half", "Right_half"]
    assert between["low_mm"] == between["distance_mm"] == 0 < between["high_mm"]
    check_case_formats(fresh_project.results / "ball", scene)
    assert fresh_project.planned(*files, *config) == {}
    everything = fresh_project.planned("--forceall", *config)
    assert everything["measure_distances"] == 1
    assert everything.get("fill_case", 0) == ("pytetwild" in asked)
    assert everything.get("export_scene", 0) == ("OCP" in asked)
    missing = sorted(set(CASE_FORMATS) - set(asked))
    if missing:
        pytest.skip(f"{', '.join(missing)} not installed: files of whole cases are not all tried")


def check_case_formats(folder, scene):
    """Tetrahedra and solids of the case have the organs' names, volumes and colours."""
    volumes = {organ["organ"]: organ["volume_ml"] for organ in scene["organs"]}
    if (folder / "volume.msh").exists():
        report = json.loads((folder / "volume.json").read_text())
        groups = {"wall_Left_half", "wall_Right_half", "interface_Left_half_Right_half"}
        assert set(report["groups"]) == groups
        for name, organ in report["organs"].items():
            assert organ["volume_ml"] == pytest.approx(volumes[name], rel=0.03)
        metrics = json.loads((folder / "Left_half" / "metrics.json").read_text())
        assert metrics["tetrahedra"] == {"seconds": report["seconds"], **report["organs"]["Left_half"]}
        for form in ("msh", "inp"):
            text = (folder / f"volume.{form}").read_text().lower()
            assert all(name.lower() in text for name in (*groups, *volumes))
        grid = pytest.importorskip("pyvista").read(folder / "volume.vtu")
        assert list(grid.field_data["region_names"]) == list(volumes)
        assert set(grid.field_data["group_names"]) == groups
    if (folder / "scene.step").exists():
        report = json.loads((folder / "scene_step.json").read_text())
        for name, organ in report["organs"].items():
            assert (organ["valid"], organ["free_edges"], organ["bodies"]) == (True, 0, 1)
            assert organ["volume_ml"] == pytest.approx(volumes[name], rel=5e-3)
        text = (folder / "scene.step").read_text()
        assert all(f"PRODUCT('{name}'" in text for name in volumes)
        # red is the table's colour of the left half
        assert "DRAUGHTING_PRE_DEFINED_COLOUR('red')" in text
