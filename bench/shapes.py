"""One spline for a cohort against the least that it must beat: a template that is moved to nearest points.

    python bench/shapes.py [--kept FOLDER] [--hippocampi N] [--bodies N] [--points N] [--table CSV]

Cohorts: mixtures of five smooth deformations of a body with two bumps and a hollow, whose correspondence is
known, and the hippocampi of /work/shared/data, where they are. All methods move the same template, which
rivals get from our last round. Each rival is shown at the better of its settings by the generalisation of
surfaces.
"""

import argparse
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "scripts"), str(ROOT / "tests"), str(ROOT / "tests/unit/shapes")]

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from scipy.interpolate import RBFInterpolator  # noqa: E402
from scipy.sparse import csr_array, diags_array  # noqa: E402
from test_cohort import body, deformed, on_body, subject  # noqa: E402

from cccd.geometry.distance import nearest_points  # noqa: E402
from cccd.geometry.mesh import Mesh  # noqa: E402
from cccd_shapes.cohort import aligned, fit_cohort  # noqa: E402
from cccd_shapes.fit import similarity, surface_rms  # noqa: E402
from cccd_shapes.statistics import ShapeModel, measure_model, principal_modes  # noqa: E402
from cccd_shapes.subjects import Row, Subject, read_subject  # noqa: E402
from cccd_shapes.template import Template  # noqa: E402

HIPPOCAMPI = Path("/work/shared/data/hippocampus_msd/labels")
#: Smoothing of thin plate splines, and rounds.
SMOOTHINGS, ROUNDS = (0.1, 1.0, 10.0), 4
#: Landmarks of the thin plate splines: every so many control points.
EACH = 4
#: Fields that bodies are mixed of, and their standard deviation by that of the tests.
FIELDS, SIZE = 5, 0.6
#: Modes at which generalisation and specificity are given.
MODES = (5, 10, 20)


def main() -> None:
    """Measure all and write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path, default=ROOT / "docs/measured/shapes.csv")
    parser.add_argument("--kept", type=Path, default=Path("/tmp/cccd_shapes"))
    parser.add_argument("--hippocampi", type=int, default=195)
    parser.add_argument("--bodies", type=int, default=20)
    parser.add_argument("--points", type=int, default=800)
    given = parser.parse_args()
    rows: list[dict[str, Any]] = []
    bodies = [subject(f"body_{n:03}", mixture(n)) for n in range(given.bodies)]
    rows += measured("bodies", bodies, given.kept / "bodies", given.points)
    if HIPPOCAMPI.is_dir() and given.hippocampi:
        found = list(hippocampi(given.hippocampi, given.kept))
        rows += measured("hippocampi", found, given.kept / "hippocampi", given.points)
    table = pd.DataFrame(rows)
    print(table.round(3).to_string())
    table.to_csv(given.table, index=False, float_format="%.4g")


def mixture(n: int) -> Mesh:
    """The body, moved by a random mixture of five fields."""
    scores = np.random.default_rng(n).normal(size=FIELDS) * SIZE
    fields = np.array([deformed(seed).vertices - body().vertices for seed in range(FIELDS)])
    return Mesh(body().vertices + np.tensordot(scores, fields, 1), body().faces)


def moved_with(places: np.ndarray, mesh: Mesh) -> np.ndarray:
    """Where places on the body are on a mixture: `on_body` the other way round."""
    return on_body(places, body(), mesh)


def hippocampi(count: int, kept: Path) -> Iterator[Subject]:
    """Both parts of each hippocampus as one."""
    for path in sorted(HIPPOCAMPI.glob("*.nii.gz"))[:count]:
        name = path.name.removesuffix(".nii.gz")
        yield read_subject(Row(name, name, path, "1,2", False, ""), kept / "surfaces")


def measured(name: str, subjects: list[Subject], folder: Path, points: int) -> list[dict[str, Any]]:
    """Measure ours and the rivals on one cohort."""
    fresh, begin = not folder.is_dir(), time.process_time()
    cohort = fit_cohort(subjects, folder, points)
    seconds = time.process_time() - begin
    subjects, template = [cohort.subjects[n] for n in cohort.used], cohort.template
    start = time.process_time()
    poses = [similarity(template, one.mesh) for one in subjects]
    pose_seconds = time.process_time() - start
    ours = [cohort.fits[n].spline.vertices for n in cohort.used]
    facts = {"cohort": name, "subjects": len(cohort.subjects), "fit": len(subjects)}
    facts["control_points"] = len(template.masses)
    sampler = template.spline.sampler(1)
    found = [figures("CCCD", [sampler.matrix @ one for one in ours], subjects, template, name)]
    found[0]["cpu_seconds"] = seconds if fresh else np.nan  # kept fits take no time
    if name == "bodies":
        place = on_body(sampler.matrix @ ours[0], subjects[0].mesh)
        truth = [moved_with(place, one.mesh) for one in subjects]
        found.append(figures("known correspondence", truth, subjects, template, name))
    for method, settings in (("ICP, nearest points", (None,)), ("ICP, thin plate splines", SMOOTHINGS)):
        tried: list[dict[str, Any]] = []
        for smoothing in settings:
            begin = time.process_time()
            moved = [rival(template, one, pose, smoothing) for one, pose in zip(subjects, poses, strict=True)]
            seconds = time.process_time() - begin + pose_seconds
            tried.append(figures(method, moved, subjects, template, name) | {"cpu_seconds": seconds})
        found.append(min(tried, key=lambda row: row[f"surface_generalisation_{MODES[0]}_mm"]))
    return [facts | row for row in found]


def rival(template: Template, one: Subject, pose: np.ndarray, smoothing: float | None) -> np.ndarray:
    """Points (P, 3) of the template that lie on a subject: the nearest ones, after a smooth warp if asked."""
    points = template.spline.tessellate(1).vertices @ pose[:3, :3].T + pose[:3, 3]
    marks = np.arange(0, len(template.masses), EACH)
    for _ in range(0 if smoothing is None else ROUNDS):
        to = nearest_points(points[marks], one.mesh)
        points = RBFInterpolator(points[marks], to, smoothing=smoothing or 0.0)(points)
    return nearest_points(points, one.mesh)


def figures(
    method: str, shapes: list[np.ndarray], subjects: list[Subject], template: Template, name: str
) -> dict[str, Any]:
    """Distances to the own surfaces, the model's measures, and errors where the truth is known."""
    mean = template.spline.tessellate(1)
    found: dict[str, Any] = {"method": method}
    meshes = [Mesh(points, mean.faces) for points in shapes]
    off = [surface_rms(mesh, one.mesh) for mesh, one in zip(meshes, subjects, strict=True)]
    found |= {"distance_rms_mm": np.mean(off), "distance_rms_most_mm": np.max(off)}
    found["crossing_subjects"] = sum(bool(len(mesh.self_intersections())) for mesh in meshes)
    if name == "bodies":
        numbers = [int(one.name[-3:]) for one in subjects]
        places = np.array([on_body(points, mixture(n)) for points, n in zip(shapes, numbers, strict=True)])
        error = np.linalg.norm(places - places.mean(axis=0), axis=2)
        found["correspondence_median_mm"] = round(float(np.median(error)), 4)
    points = _aligned(np.array(shapes), template)
    weights = csr_array(diags_array(mean.vertex_areas / mean.area))
    model = principal_modes(points, weights)
    quality = measure_model(model)
    made = [unseen(model, n, shapes[n], points[n], MODES[0]) for n in range(len(shapes))]
    found[f"surface_generalisation_{MODES[0]}_mm"] = np.mean(
        [surface_rms(Mesh(one, mean.faces), own.mesh) for one, own in zip(made, subjects, strict=True)]
    )
    for k in MODES:
        if k <= len(quality.compactness):
            found[f"generalisation_{k}_mm"] = quality.generalisation[k - 1]
            found[f"specificity_{k}_mm"] = quality.specificity[k - 1]
    return found


def unseen(model: ShapeModel, n: int, own: np.ndarray, turned: np.ndarray, k: int) -> np.ndarray:
    """Points (P, 3), in its own space, of the nearest shape to a subject that k modes of the others make.

    Distances of surfaces do not count how points slide along them, as those of points do.
    """
    place = model.scores * model.deviations
    others = np.delete(place, n, axis=0)
    middle = others.mean(axis=0)
    ways = np.linalg.svd(others - middle, full_matrices=False)[2][: min(k, len(others) - 1)]
    shape = model.mean + np.tensordot(middle + ways.T @ (ways @ (place[n] - middle)), model.modes, 1)
    centre = turned.mean(axis=0)
    turn = _rotation(turned - centre, own - own.mean(axis=0))
    return (shape - centre) @ turn.T + own.mean(axis=0)


def _rotation(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Rotation (3, 3) from centred points to centred points."""
    u, _, v = np.linalg.svd(after.T @ before)
    return u @ np.diag([1, 1, np.sign(np.linalg.det(u @ v))]) @ v


def _aligned(shapes: np.ndarray, template: Template) -> np.ndarray:
    """Align points of the surfaces by rotation, by the limits of the control points, which come first."""
    count = len(template.masses)
    inverse = np.linalg.pinv(template.limits.toarray())
    controls = np.array([inverse @ shape[:count] for shape in shapes])
    turned = aligned(controls, template, scaled=False)
    made = []
    for shape, before, after in zip(shapes, controls, turned, strict=True):
        turn = _rotation(before - before.mean(0), after - after.mean(0))
        made.append((shape - before.mean(0)) @ turn.T + after.mean(0))
    return np.array(made)


if __name__ == "__main__":
    main()
