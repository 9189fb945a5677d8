"""Fit one template to a whole cohort: from its medoid first, then from its mean.

Subjects are taken in the order of their names, so that the order of rows changes no bit of what comes out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path

import numpy as np
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation
from tqdm import tqdm

from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray, IntArray
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh
from cccd.store import read_bodies, read_report, write_control_meshes
from cccd_labels.processes import worker_processes
from cccd_shapes.fit import Fit, centroid, fit_template
from cccd_shapes.statistics import distances_to_others, principal_modes
from cccd_shapes.subjects import FEWEST, Subject, fingerprint
from cccd_shapes.template import Template, control_mesh_of

__all__ = ["Cohort", "aligned", "fit_cohort", "medoid", "problem_of"]

#: Rounds: the template is the medoid in the first, the mean of those that fit in the others. In the last ones
#: all control points move by themselves from the mean on, so that none slides without need.
ROUNDS, FROM_MEAN = 2, 3
#: Points at which distances to surfaces are compared, within so many radii of the middle.
PROBES, PROBED = 400, 1.5
#: Triangles that are enough for that.
ROUGH = 2000
#: Rounds of generalised Procrustes alignment, and the change of the mean, by its size, at which it ends.
ALIGNING_ROUNDS, STILL = 20, 1e-7
#: Largest root mean square distance of a fitted surface to the subject's own, in pixels.
TOLERANCE_PIXELS = 0.5
#: Quads may change their areas by a factor of 2 to this power (rms), ...
DISTORTED = 1.0
#: ... and a subject may be so many usual deviations farther than the median from what others explain, ...
UNLIKE = 6.0
#: ... each at least this share of the organ's radius.
LIKE = 0.01
#: Changes with what makes a fit: fits that another version kept are made again.
VERSION = 2


@dataclass(frozen=True, eq=False)
class Cohort:
    """A cohort with one template on all subjects, in the order of their names."""

    subjects: list[Subject]
    fits: list[Fit]  # in each subject's mm
    tolerances: FloatArray  # (N,) largest distance (rms, mm) at which a fit is good
    template: Template  # of the last round
    problems: list[str]  # why a subject does not fit; empty for those that do

    @property
    def used(self) -> IntArray:
        """Numbers of the subjects that fit: those that mean and modes are of."""
        return np.array([n for n, problem in enumerate(self.problems) if not problem], np.int64)

    @property
    def doubts(self) -> FloatArray:
        """Standard deviations (U, V) in mm of the surfaces of those that fit, by their bands."""
        places = [self.template.limits @ self.fits[n].spline.vertices for n in self.used]
        return np.array([self.subjects[n].doubt(at) for n, at in zip(self.used, places, strict=True)])


def fit_cohort(
    subjects: Iterable[Subject],
    folder: Path,
    points: int,
    tolerance: float | None = None,
    processes: int = 1,
) -> Cohort:
    """Fit one template to all subjects.

    Parameters
    ----------
    subjects : iterable of Subject
        With different names.
    folder : Path
        Each subject's fit of each round is kept there, and used again where nothing has changed.
    points : int
        Control points of the template, about.
    tolerance : float, optional
        Largest distance (rms, mm) of a fit to the subject's own surface; default `TOLERANCE_PIXELS`.
    processes : int
        How many subjects are fitted at once.

    Raises
    ------
    InputError
        Fewer than three subjects fit.
    """
    ordered = sorted(subjects, key=lambda subject: subject.name)
    limits = np.array([tolerance or TOLERANCE_PIXELS * subject.pixel for subject in ordered])
    spline = control_mesh_of(medoid(ordered).mesh, points)
    template = Template(spline.moved(spline.vertices - spline.tessellate(0).vertices.mean(axis=0)))
    fits: list[Fit] = []
    problems: list[str] = []
    for number in range(1, 1 + ROUNDS + FROM_MEAN):
        starts: Iterable[FloatArray | None] = repeat(None)
        if fits:
            used = [fit.spline.vertices for fit, problem in zip(fits, problems, strict=True) if not problem]
            template = Template(spline.moved(aligned(np.array(used), template, scaled=True).mean(axis=0)))
            if number > ROUNDS:
                starts = [_posed(template, fit.spline) for fit in fits]
        before, fits = fits, _fit_all(template, starts, ordered, folder / f"round_{number}", processes)
        if number > ROUNDS:  # who is too far from the mean keeps the last fit
            both = zip(before, fits, limits, strict=True)
            fits = [old if problem_of(new, limit) else new for old, new, limit in both]
        problems = [problem_of(fit, limit) for fit, limit in zip(fits, limits, strict=True)]
        if problems.count("") >= FEWEST:
            problems = _unlike(fits, template, problems)
        if problems.count("") < FEWEST:
            one, problem = next((s.name, p) for s, p in zip(ordered, problems, strict=True) if p)
            raise InputError(
                one,
                f"{problem}; only {problems.count('')} of {len(fits)} subjects fit",
                "check that all are the same organ, or use more --points or a larger --tolerance",
            )
    return Cohort(ordered, fits, limits, template, problems)


def _posed(template: Template, spline: ControlMesh) -> FloatArray:
    """Control points (V, 3) of a template, moved by the similarity to a spline with its quads."""
    weight = template.masses / template.masses.sum()
    points, to = template.limits @ template.spline.vertices, template.limits @ spline.vertices
    middle, there = weight @ points, weight @ to
    turn = Rotation.align_vectors(to - there, points - middle, weight)[0]
    size = np.sqrt((weight @ (to - there) ** 2).sum() / (weight @ (points - middle) ** 2).sum())
    return np.asarray(size * turn.apply(template.spline.vertices - middle) + there, float)


def medoid(subjects: Sequence[Subject]) -> Subject:
    """Return the subject that is nearest to all others, once all have one middle and one area.

    It has as many handles as most have.
    """
    draw = np.random.default_rng(0)
    way = draw.normal(size=(PROBES, 3))
    probes = PROBED * way / np.linalg.norm(way, axis=1, keepdims=True) * np.cbrt(draw.random((PROBES, 1)))
    distances = np.array(
        [to_mesh(probes, _normalised(subject.mesh.simplified(ROUGH))) for subject in subjects]
    )
    genus = [subject.mesh.genus for subject in subjects]
    usual = np.array(genus) == max(sorted(set(genus)), key=genus.count)
    return subjects[int(np.argmin(np.where(usual, cdist(distances, distances).sum(axis=1), np.inf)))]


def _normalised(mesh: Mesh) -> Mesh:
    return Mesh((mesh.vertices - centroid(mesh)) / np.sqrt(mesh.area / (4 * np.pi)), mesh.faces)


def aligned(shapes: FloatArray, template: Template, scaled: bool) -> FloatArray:
    """Align shapes (N, V, 3) of control points to their mean (generalised Procrustes analysis).

    The template's areas weigh the points, its axes are those of the result; ``scaled`` makes sizes equal.
    """
    limits, weight = template.limits, template.masses / template.masses.sum()
    on_surface = np.array([limits @ shape for shape in shapes])
    middles = np.einsum("p,npc->nc", weight, on_surface)
    centred, shapes = on_surface - middles[:, None], shapes - middles[:, None]
    sizes = np.sqrt(np.einsum("p,npc->n", weight, centred**2))
    if scaled:
        by = (sizes.mean() / sizes)[:, None, None]
        centred, shapes = centred * by, shapes * by
    mean = limits @ template.spline.vertices
    for _ in range(ALIGNING_ROUNDS):
        turns = np.array([Rotation.align_vectors(mean, one, weight)[0].as_matrix() for one in centred])
        turned = np.einsum("npc,ndc->npd", centred, turns)
        before, mean = mean, turned.mean(axis=0)
        if np.abs(mean - before).max() < STILL * sizes.mean():
            break
    return np.einsum("npc,ndc->npd", shapes, turns)


def problem_of(fit: Fit, tolerance: float) -> str:
    """Why a fit is none; empty for a good one."""
    found = {
        f"{fit.rms:.3g} mm (rms) from its own surface, more than {tolerance:.3g}": fit.rms > tolerance,
        f"passes through itself at {fit.crossings} places": fit.crossings,
        f"its quads' areas change {2**fit.distortion:.2g}-fold (rms)": fit.distortion > DISTORTED,
    }
    return "; ".join(problem for problem, there in found.items() if there)


def _unlike(fits: Sequence[Fit], template: Template, problems: list[str]) -> list[str]:
    """Add those to the problems that no mixture of the others comes near."""
    shapes = aligned(np.array([fit.spline.vertices for fit in fits]), template, scaled=True)
    off = distances_to_others(principal_modes(shapes, template.metric))
    usual = float(np.median(off))
    spread = max(1.4826 * float(np.median(np.abs(off - usual))), 0.1 * usual, LIKE * template.radius)
    said = [f"{away:.3g} mm (rms) from all mixtures of the others, which are {usual:.3g}" for away in off]
    far = off > usual + UNLIKE * spread
    return ["; ".join([p] * bool(p) + [s] * bool(f)) for p, s, f in zip(problems, said, far, strict=True)]


# One file for each fit --------------------------------------------------------------------------------


def _fit_all(
    template: Template,
    starts: Iterable[FloatArray | None],
    subjects: Sequence[Subject],
    folder: Path,
    processes: int,
) -> list[Fit]:
    """Fit a template to subjects, several at once, with a line that shows how far it is."""
    with ExitStack() as stack:
        run: Callable[..., Iterable[Fit]] = map
        if processes > 1:
            run = stack.enter_context(worker_processes(min(processes, len(subjects)))).map
        done = run(_fit_one, repeat(template.spline), starts, subjects, repeat(folder))
        return list(tqdm(done, folder.name, len(subjects), leave=False, disable=None))


_TEMPLATES: dict[str, Template] = {}


def _fit_one(spline: ControlMesh, start: FloatArray | None, subject: Subject, folder: Path) -> Fit:
    """Fit a template to a subject, or read the fit that was kept."""
    key = fingerprint(VERSION, spline.vertices, spline.quads)
    made_of = fingerprint(key, start, subject.mesh.vertices, subject.mesh.faces)
    path = folder / f"{subject.name}.h5"
    if path.is_file():
        report = read_report(path)
        if report.get("made_of") == made_of:
            (kept,) = read_bodies(path)
            return Fit(kept, report["rms_mm"], report["crossings"], report["distortion"])
    if key not in _TEMPLATES:  # its modes are computed once in each process
        _TEMPLATES.clear()
        _TEMPLATES[key] = Template(spline)
    fit = fit_template(_TEMPLATES[key], subject.mesh, start)
    report = {"made_of": made_of, "rms_mm": fit.rms, "crossings": fit.crossings, "distortion": fit.distortion}
    write_control_meshes(path, [fit.spline], subject.frame, report)
    return fit
