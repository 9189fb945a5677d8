"""What the statistics of a cohort leave: splines and meshes with the same faces, modes, tables, p values."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd

from cccd.containers import Frame
from cccd.geometry.arrays import FloatArray
from cccd.geometry.mesh import Mesh, xml_of
from cccd.geometry.subdivision import ControlMesh
from cccd.project import PROJECT
from cccd.store import atomic_path, write_table
from cccd.surface.surface import LoftedSurface, write_files
from cccd_shapes.cohort import Cohort
from cccd_shapes.series import Series
from cccd_shapes.statistics import GroupTest, ShapeModel, measure_model
from cccd_shapes.subjects import MIRROR
from cccd_viewers.page_files import View
from cccd_viewers.viewer import packed, surface_figure
from cccd_workflow.report.templates import shared_facts, write_page

#: Modes that are drawn: those of this share of the variance, at most so many; at which standard deviations.
SHOWN_SHARE, SHOWN_MOST, SHOWN_AT = 0.95, 10, (-2, -1, 1, 2)


def write_subjects(path: Path, cohort: Cohort) -> None:
    """Write a row for each subject: whether the template fits, and why not."""
    rows = [
        {
            "name": subject.name,
            "group": subject.row.group,
            "time": subject.row.time,
            "volume_ml": mesh.volume / 1000,
            "own_volume_ml": subject.mesh.volume / 1000,
            "distance_rms_mm": fit.rms,
            "tolerance_mm": subject.tolerance,
            "crossings": fit.crossings,
            "closed": "yes" if mesh.is_closed_manifold else "no",
            "fits": "no" if problem else "yes",
            "problem": problem,
        }
        for subject, fit, problem in zip(cohort.subjects, cohort.fits, cohort.problems, strict=True)
        for mesh in [fit.spline.tessellate()]
    ]
    write_table(path, pd.DataFrame(rows))


def write_fits(folder: Path, cohort: Cohort, aligned: FloatArray) -> None:
    """Write each subject's spline and mesh in its own mm RAS, and points for ShapeWorks.

    Its ``_world`` points are of the aligned (U, V, 3) control points of the subjects that fit. scikit-shapes
    reads the meshes as they are.
    """
    for subject, fit in zip(cohort.subjects, cohort.fits, strict=True):
        spline = fit.spline.transformed(MIRROR) if subject.row.mirrored else fit.spline
        _write_spline(folder / "fitted" / subject.name, spline, subject.frame)
        _write_particles(folder / "particles" / f"{subject.name}_local.particles", spline)
    for number, points in zip(cohort.used, aligned, strict=True):
        name = f"{cohort.subjects[number].name}_world.particles"
        _write_particles(folder / "particles" / name, cohort.template.spline.moved(points))


def _write_spline(folder: Path, spline: ControlMesh, frame: Frame) -> None:
    """Write ``surface.h5`` and ``surface.ply`` of a spline, as ``cccd export`` reads them."""
    report = {"control_points": len(spline.vertices), "warnings": []}
    surface = LoftedSurface([spline], spline.tessellate(), frame, report)
    write_files(surface, folder / "surface.h5", folder / "surface.ply")


def _write_particles(path: Path, spline: ControlMesh) -> None:
    """Write the limits of the control points as ShapeWorks has its particles: x, y and z, a line for each."""
    with atomic_path(path) as part:
        np.savetxt(part, spline.tessellate(0).vertices, "%.6f")


def write_model(folder: Path, cohort: Cohort, model: ShapeModel, made: Mapping[str, Any]) -> list[str]:
    """Write mean, modes and a page of all; return a line for each drawn shape that crosses itself."""
    frame, spline = cohort.subjects[0].frame, cohort.template.spline
    arrays = {"mean": model.mean, "modes": model.modes, "deviations_mm": model.deviations}
    arrays |= {"quads": spline.quads, "scores": model.scores}
    _write_arrays(folder / "modes.h5", arrays, "names", [cohort.subjects[n].name for n in cohort.used])
    shown = min(SHOWN_MOST, 1 + int(np.searchsorted(model.compactness, SHOWN_SHARE)), len(model.deviations))
    write_table(folder / "modes.csv", pd.DataFrame(measure_model(model)))
    _write_spline(folder / "mean", spline.moved(model.mean), frame)
    warnings: list[str] = []
    for number in range(shown):
        for at in SHOWN_AT:
            name = f"mode_{number + 1}_{'plus' if at > 0 else 'minus'}_{abs(at)}"
            shape = spline.moved(model.shape([0.0] * number + [float(at)]))
            _write_spline(folder / "modes" / name, shape, frame)
            if crossing := len(shape.tessellate().self_intersections()):
                warnings.append(f"{name} passes through itself at {crossing} places")
    facts = {**made, "warnings": [*made["warnings"], *warnings]}
    _write_page(folder / "modes.html", spline.moved(model.mean), model, shown, facts)
    return warnings


def _write_arrays(path: Path, arrays: Mapping[str, Any], name: str, value: Any) -> None:
    with atomic_path(path) as part, h5py.File(part, "w", track_order=True) as file:
        for key, values in arrays.items():
            file.create_dataset(key, data=values, compression="gzip", track_times=False)
        file.attrs[name] = value


def _write_page(path: Path, mean: ControlMesh, model: ShapeModel, shown: int, made: dict[str, Any]) -> None:
    """Write a page with a slider for each of the first modes: it needs no server."""
    matrix, mesh = mean.sampler(1).matrix, mean.tessellate(1)
    moves = [(matrix @ mode).T for mode in model.deviations[:shown, None, None] * model.modes[:shown]]
    figure = surface_figure(View({"surface": mesh}, {}, len(mesh.faces), "", {}))
    del figure["layout"]["updatemenus"]
    data = packed({"mean": mesh.vertices.T.round(3).tolist(), "modes": np.round(moves, 3).tolist()})
    shares = np.diff(model.compactness[:shown], prepend=0)
    context = {"title": "Mean and modes", "made": made, "shares": shares, "moves": data}
    context |= {"figure": packed(figure), **shared_facts({})}
    write_page(path, PROJECT / "workflow" / "report", "modes.html.j2", context)


def write_scores(path: Path, cohort: Cohort, model: ShapeModel) -> None:
    """Write the scores of the subjects, in standard deviations, a column for each mode."""
    subjects = [cohort.subjects[number] for number in cohort.used]
    table = pd.DataFrame({"name": [s.name for s in subjects], "group": [s.row.group for s in subjects]})
    columns = [f"mode_{number}" for number in range(1, 1 + model.scores.shape[1])]
    write_table(path, pd.concat([table, pd.DataFrame(model.scores, columns=columns)], axis=1))


def write_series(folder: Path, series: Series) -> None:
    """Write the series' splines in time (``series.h5``) and its volumes (``series.csv``)."""
    arrays = {"coefficients": series.coefficients, "knots": series.knots, "quads": series.spline.quads}
    _write_arrays(folder / "series.h5", arrays, "period", series.period or np.nan)
    columns = ["time", "volume_ml", "volume_low_ml", "volume_high_ml"]
    write_table(folder / "series.csv", pd.DataFrame(series.volumes, columns=columns))


def write_groups(path: Path, mean: Mesh, test: GroupTest) -> None:
    """Write the mean surface with p values at its vertices, and the difference of the groups (VTP, mm)."""
    data = mean.to_polydata()
    data.point_data["p"] = test.p_points
    data.point_data["p_uncorrected"] = test.p_points_alone
    data.point_data["difference_mm"] = test.difference
    data.point_data["difference_outwards_mm"] = np.einsum("pc,pc->p", test.difference, mean.vertex_normals)
    data.field_data["p_of_all_modes"] = [test.p]
    data.field_data["SpaceUnit"] = ["mm"]
    with atomic_path(path) as part:
        part.write_text(xml_of(data), encoding="ascii")
