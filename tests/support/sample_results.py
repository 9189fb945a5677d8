"""A small but real result folder: an organ with an analytic surface, written by the library's own writers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import trimesh

from cccd import store
from cccd.bands import Band
from cccd.chaincode import chain_codes
from cccd.containers import FittedCurves, Frame, Structure
from cccd.contours import trace_contours
from cccd.curves.fitting import corner_splines
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd.settings.junctions import BoundarySettings
from cccd.store import read_ply, write_ply
from cccd.surface.control_mesh import join_in_pairs, split_to_quads
from cccd_junctions.boundary import extract_boundaries
from cccd_viewers.page_files import write_view
from cccd_workflow import stage_files
from cccd_workflow.report.render import render_surface
from cccd_workflow.view import make_view

RADII = np.array([24.0, 30.0, 21.0])
BAND = {"inner": 1.5, "outer": 2.5}
BOUNDARIES = BoundarySettings(source="mask")


def radius(direction: np.ndarray) -> np.ndarray:
    """Distance from the centre to the surface in unit directions (n, 3): an ellipsoid with two soft lobes."""
    ellipsoid = 1 / np.maximum(np.linalg.norm(direction / RADII, axis=1), 1e-9)
    return ellipsoid * (
        1 - 0.18 * np.exp(-((direction[:, 0] / 0.25) ** 2)) * (direction[:, 1] > 0) * direction[:, 1]
    )


def make_structure(case: str, organ: str, warnings: tuple[str, ...] = ()) -> tuple[Structure, np.ndarray]:
    """The structure, and the world coordinates of its centre."""
    shape = (64, 76, 28)
    affine = np.diag([-1.0, -1.0, 2.0, 1.0])  # LPS voxels, as CT comes
    affine[:3, 3] = (40.0, 30.0, -100.0)
    centre = affine[:3, :3] @ (np.array(shape) / 2) + affine[:3, 3]
    index = np.stack(np.indices(shape), -1).reshape(-1, 3)
    offset = index @ affine[:3, :3].T + affine[:3, 3] - centre
    distance = np.linalg.norm(offset, axis=1)
    mask = distance <= radius(offset / np.maximum(distance, 1e-9)[:, None])
    image = np.where(mask, 110.0, -60.0) + np.random.default_rng(1).normal(0, 12, len(mask))
    frame = Frame(affine, 2, shape)
    provenance = {"source": "phantom", "files": [{"path": f"{case}.nii.gz", "sha256": "ab" * 32}]}
    structure = Structure(
        case,
        organ,
        frame,
        np.zeros(3, int),
        image=image.reshape(shape).astype(np.float32),
        mask=mask.reshape(shape),
        provenance=provenance,
        warnings=list(warnings),
    )
    return structure, centre


def write_results(folder: Path, case: str, organ: str, warnings: tuple[str, ...] = ()) -> None:
    """Everything that the stages leave for one structure."""
    structure, centre = make_structure(case, organ, warnings)
    store.write_structure(folder / "structure.h5", structure)
    boundaries = extract_boundaries(structure, BOUNDARIES)
    stage_files.write_boundaries(folder / "boundaries.h5", boundaries)
    curves = trace_contours(structure)
    corner = np.concatenate([np.arange(len(part)) % max(1, len(part) // 24) == 0 for part in curves])
    splines = corner_splines(curves, corner)
    codes = chain_codes(curves.points, curves.offsets)
    stage_files.write_curves(
        folder / "curves.h5", FittedCurves(curves, codes, curves.points[corner], splines.offsets, splines)
    )
    mesh = trimesh.creation.icosphere(subdivisions=4)
    vertices = centre + mesh.vertices * radius(np.asarray(mesh.vertices))[:, None]
    write_ply(folder / "surface.ply", Mesh(np.array(vertices), np.array(mesh.faces)), "a test")
    write_sample_view(folder)
    net, faces = vertices, np.array(mesh.faces, np.int64)
    points, quads, _ = split_to_quads(net, *join_in_pairs(Mesh(net, faces)))
    store.write_control_meshes(
        folder / "surface.h5", [ControlMesh(points, quads)], structure.frame, {"warnings": []}
    )
    store.write_json(
        folder / "metrics.json", make_metrics(case, organ, np.random.default_rng(len(case + organ)), warnings)
    )


def write_sample_view(folder: Path) -> None:
    """What the viewer shows of the structure in a folder."""
    mesh = read_ply(folder / "surface.ply")
    inner, outer = (np.full(len(mesh.vertices), side) for side in (BAND["inner"], BAND["outer"]))
    view = make_view(
        store.read_structure(folder / "structure.h5"),
        stage_files.read_boundaries(folder / "boundaries.h5"),
        stage_files.read_curves(folder / "curves.h5"),
        mesh,
        Band(inner, outer, 0.9, 1.0, False),
    )
    write_view(folder / "view.h5", view)


def make_metrics(case: str, organ: str, rng: np.random.Generator, warnings: tuple[str, ...] = ()) -> dict:
    """Metrics of the shape that the pipeline writes."""
    return {
        "case": case,
        "organ": organ,
        "surface": {
            "volume_ml": 1000 + 100 * rng.random(),
            "volume_low_ml": 990.0,
            "volume_high_ml": 1110.0,
            "area_mm2": 50_000 + 1000 * rng.random(),
            "bounding_box_mm": [[-10.0, -20.0, 0.0], [90.0, 60.0, 70.5]],
            "centroid_mm": [40.0, 20.0, 35.0],
            "reference": "true surface",
            "dice_3d": 1 - 0.01 * rng.random(),
            "assd_mm": 0.2 + 0.3 * rng.random(),
            "volume_bias": 0.003 * rng.standard_normal(),
            "control_points": int(rng.integers(800, 3000)),
            "control_bytes": int(rng.integers(10_000, 40_000)),
            "compactness": float(rng.uniform(100, 300)),
        },
        "curves": {"slices": 24, "bytes_per_slice": {"pixels": 700.0, "chain_code": 90.0}},
        "ordering": {"method": "traced mask"},
        "warnings": list(warnings),
    }


def write_run(root: Path, structures: list[tuple[str, str]], picture: bool = True) -> Path:
    """A whole run's results and benchmarks; the results' folder is returned."""
    results = root / "results"
    for case, organ in structures:
        folder = results / case / organ
        write_results(
            folder, case, organ, ("Cut by the field of view at the top.",) if organ == "liver" else ()
        )
        if picture:
            render_surface(folder / "surface.ply", folder / "picture.png", pixels=200)
    epochs = np.arange(1, 31)
    history = pd.DataFrame({"epoch": epochs, "train_loss": 0.7 / epochs, "validation_loss": 0.8 / epochs})
    history["validation_f1"] = 1 - 0.4 / epochs
    (results / "gnn").mkdir(parents=True)
    history.to_csv(results / "gnn" / "history.csv", index=False)
    (results / "tables").mkdir()
    pd.DataFrame(
        {"method": ["Harris", "<b>CCCD</b>"], "corners": [716, 189], "false_share_percent": [67.5, 0.0]}
    ).to_csv(results / "tables" / "table1_corners.csv", index=False)
    benchmarks = root / "benchmarks" / structures[0][0] / structures[0][1]
    benchmarks.mkdir(parents=True)
    measured = {"s": 2.5, "h:m:s": "0:00:02", "max_rss": 310.5, "cpu_time": 2.4}
    pd.DataFrame([measured]).to_csv(benchmarks / "loft_surface.tsv", sep="\t", index=False)
    return results
