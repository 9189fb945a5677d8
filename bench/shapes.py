"""One spline for a cohort against the least that it must beat: a template that is moved to nearest points.

    python bench/shapes.py [--kept FOLDER] [--hippocampi N] [--bodies N] [--atria FOLDER]
        [--points N] [--table CSV]

Cohorts: mixtures of five smooth deformations of a body with two bumps and a hollow, whose correspondence is
known; the hippocampi of /work/shared/data; the four left atria of ShapeWorks (SCIInstitute/shapeworks-cloud,
swcc/examples/left_atrium) with its particles. Other rivals move the template of our last round. Each is shown
at the better of its settings by the generalisation of surfaces. Other cohorts' rows stay as they are.
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
import pyvista as pv  # noqa: E402
from scipy.interpolate import RBFInterpolator  # noqa: E402
from scipy.sparse import csr_array, diags_array  # noqa: E402
from scipy.spatial.transform import Rotation  # noqa: E402
from test_shapes import body, deformed, on_body, subject  # noqa: E402

from cccd.geometry.distance import nearest_points  # noqa: E402
from cccd.geometry.mesh import Mesh  # noqa: E402
from cccd_shapes.cohort import fit_cohort  # noqa: E402
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
#: Points with which the atria are fitted, too: about as many as ShapeWorks has particles there.
LIKE_SHAPEWORKS = 130
#: Modes at which generalisation and specificity are given.
MODES = {"bodies": 5, "hippocampi": 5, "atria": 2}


def main() -> None:
    """Measure all and write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path, default=ROOT / "docs/measured/shapes.csv")
    parser.add_argument("--kept", type=Path, default=Path("/tmp/cccd_shapes"))
    parser.add_argument("--hippocampi", type=int, default=0)
    parser.add_argument("--bodies", type=int, default=0)
    parser.add_argument("--atria", type=Path)
    parser.add_argument("--points", type=int, default=800)
    given = parser.parse_args()
    given.kept.mkdir(parents=True, exist_ok=True)
    cohorts: dict[str, list[Subject]] = {}
    if given.bodies:
        cohorts["bodies"] = [subject(f"body_{n:03}", mixture(n)) for n in range(given.bodies)]
    if given.hippocampi:
        cohorts["hippocampi"] = list(hippocampi(given.hippocampi, given.kept))
    if given.atria:
        cohorts["atria"] = atria(given.atria, given.kept)
    rows: list[dict[str, Any]] = []
    for name, subjects in cohorts.items():
        for points in (given.points, LIKE_SHAPEWORKS)[: 2 if name == "atria" else 1]:
            rows += measured(name, subjects, given.kept / f"{name}_{points}", points)
        rows += [shapeworks(given.atria, subjects)] if name == "atria" else []
    before = pd.read_csv(given.table).query("cohort not in @cohorts")
    table = pd.concat([before, pd.DataFrame(rows)])
    print(table.round(3).to_string())
    table.to_csv(given.table, index=False, float_format="%.4g")


def mixture(n: int) -> Mesh:
    """The body, moved by a random mixture of five fields."""
    scores = np.random.default_rng(n).normal(size=FIELDS) * SIZE
    fields = np.array([deformed(seed).vertices - body().vertices for seed in range(FIELDS)])
    return Mesh(body().vertices + np.tensordot(scores, fields, 1), body().faces)


def hippocampi(count: int, kept: Path) -> Iterator[Subject]:
    """Both parts of each hippocampus as one."""
    for path in sorted(HIPPOCAMPI.glob("*.nii.gz"))[:count]:
        name = path.name.removesuffix(".nii.gz")
        yield read_subject(Row(name, name, path, "1,2", False, ""), kept / "surfaces")


def atria(folder: Path, kept: Path) -> list[Subject]:
    """The groomed atria, which ShapeWorks' particles lie on, where they were scanned."""
    found = []
    for path in sorted((folder / "groomed").glob("*.vtk")):
        mesh = pv.read(path)
        pv.PolyData(mesh.points, mesh.faces).save(to := kept / f"{path.stem}.ply")
        found.append(read_subject(Row(path.stem, path.stem, to, None, False, ""), kept))
    return found


def shapeworks(folder: Path, subjects: list[Subject]) -> dict[str, Any]:
    """ShapeWorks' model: the mesh of one subject (the best), warped to the particles of each (biharmonic).

    Its example has no mesh of the mean: what is called so is the scan of the first atrium.
    """
    files = [folder / f"particles/{one.name}_local.particles" for one in subjects]
    particles = [np.loadtxt(file) for file in files]
    tried = []
    for own, one in zip(particles, subjects, strict=True):
        warps = [RBFInterpolator(own, to, kernel="linear", degree=1) for to in particles]
        shapes = [warp(one.mesh.vertices) for warp in warps]
        tried.append(figures("ShapeWorks, particles", shapes, subjects, one.mesh, "atria"))
    best = min(tried, key=lambda row: row["surface_generalisation_mm"])
    return {"cohort": "atria", "subjects": 4, "fit": 4, "control_points": len(particles[0])} | best


def measured(name: str, subjects: list[Subject], folder: Path, points: int) -> list[dict[str, Any]]:
    """Measure ours and the rivals on one cohort."""
    fresh, begin = not folder.is_dir(), time.process_time()
    cohort = fit_cohort(subjects, folder, points)
    seconds = time.process_time() - begin
    subjects, template = [cohort.subjects[n] for n in cohort.used], cohort.template
    start = time.process_time()
    poses = [similarity(template, one.mesh) for one in subjects]
    pose_seconds = time.process_time() - start
    facts = {"cohort": name, "subjects": len(cohort.subjects), "fit": len(subjects)}
    facts["control_points"] = len(template.masses)
    sampler, mean = template.spline.sampler(1), template.spline.tessellate(1)
    found = [figures("CCCD", [sampler.matrix @ one for one in cohort.shapes], subjects, mean, name)]
    found[0]["cpu_seconds"] = seconds if fresh else np.nan  # kept fits take no time
    if name == "bodies":
        place = on_body(sampler.matrix @ cohort.shapes[0], subjects[0].mesh)
        truth = [on_body(place, body(), one.mesh) for one in subjects]
        found.append(figures("known correspondence", truth, subjects, mean, name))
    for method, settings in (("ICP, nearest points", (None,)), ("ICP, thin plate splines", SMOOTHINGS)):
        tried: list[dict[str, Any]] = []
        for smoothing in settings:
            begin = time.process_time()
            moved = [rival(template, one, pose, smoothing) for one, pose in zip(subjects, poses, strict=True)]
            seconds = time.process_time() - begin + pose_seconds
            tried.append(figures(method, moved, subjects, mean, name) | {"cpu_seconds": seconds})
        found.append(min(tried, key=lambda row: row["surface_generalisation_mm"]))
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
    method: str, shapes: list[np.ndarray], subjects: list[Subject], mean: Mesh, name: str
) -> dict[str, Any]:
    """Distances to the own surfaces, the model's measures, and errors where the truth is known."""
    meshes = [Mesh(points, mean.faces) for points in shapes]
    off = [surface_rms(mesh, one.mesh) for mesh, one in zip(meshes, subjects, strict=True)]
    found = {"method": method, "distance_rms_mm": np.mean(off), "distance_rms_most_mm": np.max(off)}
    found["crossing_subjects"] = sum(bool(len(mesh.self_intersections())) for mesh in meshes)
    if name == "bodies":
        numbers = [int(one.name[-3:]) for one in subjects]
        places = np.array([on_body(points, mixture(n)) for points, n in zip(shapes, numbers, strict=True)])
        error = np.linalg.norm(places - places.mean(axis=0), axis=2)
        found["correspondence_median_mm"] = round(float(np.median(error)), 4)
    k, weights = MODES[name], mean.vertex_areas / mean.area
    points = turned_together(np.array(shapes), mean.vertices, weights)
    model = principal_modes(points, csr_array(diags_array(weights)))
    quality = measure_model(model)
    made = [unseen(model, n, shapes[n], points[n], k) for n in range(len(shapes))]
    surface = [surface_rms(Mesh(one, mean.faces), own.mesh) for one, own in zip(made, subjects, strict=True)]
    found |= {"modes": k, "surface_generalisation_mm": np.mean(surface)}
    found["generalisation_mm"] = quality["generalisation_mm"][k - 1]
    return found | {"specificity_mm": quality["specificity_mm"][k - 1]}


def turned_together(shapes: np.ndarray, mean: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Shapes (N, P, 3), shifted and turned onto their mean."""
    shapes = shapes - np.einsum("p,npc->nc", weights, shapes)[:, None]
    mean = mean - weights @ mean
    for _ in range(20):
        turns = [Rotation.align_vectors(mean, one, weights)[0].as_matrix() for one in shapes]
        turned = np.einsum("npc,ndc->npd", shapes, np.array(turns))
        mean = turned.mean(axis=0)
    return turned


def unseen(model: ShapeModel, n: int, own: np.ndarray, turned: np.ndarray, k: int) -> np.ndarray:
    """Points (P, 3), in its own space, of the nearest shape to a subject that k modes of the others make.

    Distances of surfaces do not count how points slide along them, as those of points do.
    """
    place = model.scores * model.deviations
    others = np.delete(place, n, axis=0)
    middle = others.mean(axis=0)
    ways = np.linalg.svd(others - middle, full_matrices=False)[2][: min(k, len(others) - 1)]
    shape = model.mean + np.tensordot(middle + ways.T @ (ways @ (place[n] - middle)), model.modes, 1)
    turn = Rotation.align_vectors(own - own.mean(axis=0), turned - turned.mean(axis=0))[0]
    return turn.apply(shape - turned.mean(axis=0)) + own.mean(axis=0)


if __name__ == "__main__":
    main()
