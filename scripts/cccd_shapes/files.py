"""What the statistics of a cohort leave: splines and meshes with the same faces, modes, tables, p values."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pandas as pd

from cccd.containers import Frame
from cccd.geometry._vtk import xml_of
from cccd.geometry.arrays import FloatArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd.store import atomic_path, write_table
from cccd.surface.surface import LoftedSurface, write_files
from cccd_shapes.cohort import Cohort
from cccd_shapes.statistics import GroupTest, ModelQuality, ShapeModel

__all__ = ["write_fits", "write_groups", "write_model", "write_scores", "write_subjects"]

#: Subdivisions of the meshes.
DRAWN = 2
#: Modes that are drawn: those of this share of the variance, and at most so many.
SHOWN_SHARE, SHOWN_MOST = 0.95, 10
#: Standard deviations at which they are.
SHOWN_AT = (-2, -1, 1, 2)


def write_subjects(path: Path, cohort: Cohort) -> None:
    """Write a row for each subject: whether the template fits, and why not."""
    rows = [
        {
            "name": subject.name,
            "group": subject.row.group,
            "mirrored": "yes" if subject.row.mirrored else "no",
            "volume_ml": mesh.volume / 1000,
            "own_volume_ml": subject.mesh.volume / 1000,
            "distance_rms_mm": fit.rms,
            "tolerance_mm": tolerance,
            "crossings": fit.crossings,
            "closed": "yes" if mesh.is_closed_manifold else "no",
            "distortion_log2": fit.distortion,
            "fits": "no" if problem else "yes",
            "problem": problem,
        }
        for subject, fit, tolerance, problem in zip(
            cohort.subjects, cohort.fits, cohort.tolerances, cohort.problems, strict=True
        )
        for mesh in [fit.spline.tessellate(DRAWN)]
    ]
    write_table(path, pd.DataFrame(rows))


def write_fits(folder: Path, cohort: Cohort, aligned: FloatArray) -> None:
    """Write each subject's spline and mesh in its own mm RAS, and points for ShapeWorks.

    Parameters
    ----------
    folder : Path
    cohort : Cohort
    aligned : (U, V, 3) float64
        Control points of the subjects that fit, aligned: of the ``_world`` points.
    """
    for subject, fit in zip(cohort.subjects, cohort.fits, strict=True):
        spline = fit.spline.transformed(subject.to_world)
        _write_spline(folder / "fitted" / subject.name, spline, subject.frame)
        _write_particles(folder / "particles" / f"{subject.name}_local.particles", spline)
    for number, points in zip(cohort.used, aligned, strict=True):
        name = f"{cohort.subjects[number].name}_world.particles"
        _write_particles(folder / "particles" / name, cohort.template.spline.moved(points))


def _write_spline(folder: Path, spline: ControlMesh, frame: Frame) -> None:
    """Write ``surface.h5`` and ``surface.ply`` of a spline, as ``cccd export`` reads them."""
    report = {"control_points": len(spline.vertices), "warnings": []}
    surface = LoftedSurface([spline], spline.tessellate(DRAWN), frame, report)
    write_files(surface, folder / "surface.h5", folder / "surface.ply")


def _write_particles(path: Path, spline: ControlMesh) -> None:
    """Write the limits of the control points as ShapeWorks has its particles: x, y and z, a line for each."""
    with atomic_path(path) as part:
        np.savetxt(part, spline.tessellate(0).vertices, "%.6f")


def write_model(folder: Path, cohort: Cohort, model: ShapeModel, quality: ModelQuality) -> list[str]:
    """Write mean, modes and how good they are; return a line for each drawn shape that crosses itself."""
    frame, spline = cohort.subjects[0].frame, cohort.template.spline
    with atomic_path(folder / "modes.h5") as part, h5py.File(part, "w", track_order=True) as file:
        for name, values in (
            ("mean", model.mean), ("modes", model.modes), ("deviations_mm", model.deviations),
            ("quads", spline.quads), ("scores", model.scores),
        ):  # fmt: skip
            file.create_dataset(name, data=values, compression="gzip", track_times=False)
        file.attrs["names"] = [cohort.subjects[number].name for number in cohort.used]
    count = len(quality.compactness)
    table = {
        "modes": np.arange(1, 1 + count),
        "deviation_mm": model.deviations[:count],
        "compactness": quality.compactness,
        "generalisation_mm": quality.generalisation,
        "generalisation_error_mm": quality.generalisation_error,
        "specificity_mm": quality.specificity,
        "specificity_error_mm": quality.specificity_error,
    }
    write_table(folder / "modes.csv", pd.DataFrame(table))
    _write_spline(folder / "mean", spline.moved(model.mean), frame)
    warnings: list[str] = []
    shown = min(SHOWN_MOST, 1 + int(np.searchsorted(model.compactness, SHOWN_SHARE)), len(model.deviations))
    for number in range(shown):
        for at in SHOWN_AT:
            name = f"mode_{number + 1}_{'plus' if at > 0 else 'minus'}_{abs(at)}"
            shape = spline.moved(model.shape([0.0] * number + [float(at)]))
            _write_spline(folder / "modes" / name, shape, frame)
            if crossing := len(shape.tessellate(DRAWN).self_intersections()):
                warnings.append(f"{name} passes through itself at {crossing} places")
    return warnings


def write_scores(path: Path, cohort: Cohort, model: ShapeModel) -> None:
    """Write the scores of the subjects, in standard deviations, a column for each mode."""
    subjects = [cohort.subjects[number] for number in cohort.used]
    table = pd.DataFrame({"name": [s.name for s in subjects], "group": [s.row.group for s in subjects]})
    columns = [f"mode_{number}" for number in range(1, 1 + model.scores.shape[1])]
    write_table(path, pd.concat([table, pd.DataFrame(model.scores, columns=columns)], axis=1))


def write_groups(path: Path, mean: Mesh, test: GroupTest) -> None:
    """Write the mean surface with p values at its vertices, and the difference of the groups (VTP, mm)."""
    outwards = np.einsum("pc,pc->p", test.difference, mean.vertex_normals)
    data = mean.to_polydata()
    data.point_data["p"] = test.p_points
    data.point_data["p_uncorrected"] = test.p_points_alone
    data.point_data["difference_mm"] = test.difference
    data.point_data["difference_outwards_mm"] = outwards
    data.field_data["p_of_all_modes"] = [test.p]
    data.field_data["SpaceUnit"] = ["mm"]
    with atomic_path(path) as part:
        part.write_text(xml_of(data), encoding="ascii")
