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
from cccd.geometry.subdivision import ControlMesh
from cccd.store import read_bodies, read_report, write_control_meshes
from cccd_labels.processes import worker_processes
from cccd_shapes import FEWEST, FROM_MEAN, ROUNDS
from cccd_shapes.fit import Fit, centroid, fit_template
from cccd_shapes.statistics import distances_to_others, principal_modes
from cccd_shapes.subjects import Subject, fingerprint
from cccd_shapes.template import Template, control_mesh_of

#: Points at which distances to surfaces are compared, within so many radii of the middle.
PROBES, PROBED = 400, 1.5
#: Triangles that are enough for that.
ROUGH = 2000
#: Rounds of generalised Procrustes alignment, and the change of the mean, by its size, at which it ends.
ALIGNING_ROUNDS, STILL = 20, 1e-7
#: A subject may be so many usual deviations farther than the median from what others explain, ...
UNLIKE = 6.0
#: ... each at least this share of the organ's radius.
LIKE = 0.01
#: Changes with what makes a fit: fits that another version kept are made again.
VERSION = 3


@dataclass(frozen=True, eq=False)
class Cohort:
    """A template on all subjects of a cohort."""

    subjects: list[Subject]  # in the order of their names
    fits: list[Fit]  # in each subject's mm
    template: Template
    problems: list[str]  # why a subject does not fit; empty for those that do

    @classmethod
    def judged(cls, subjects: list[Subject], fits: list[Fit], template: Template) -> Cohort:
        """Find out which subjects, in the order of their names, do not fit; fewer than three are an error."""
        problems = [problem_of(fit, one.tolerance) for fit, one in zip(fits, subjects, strict=True)]
        if problems.count("") >= FEWEST:
            problems = _unlike(fits, template, problems)
        return cls(subjects, fits, template, problems).checked()

    def checked(self) -> Cohort:
        """Refuse a cohort of which fewer than three subjects fit."""
        if len(self.used) < FEWEST:
            one, problem = next((s, p) for s, p in zip(self.subjects, self.problems, strict=True) if p)
            hint = "check that all are the same organ, or use more --points or a larger --tolerance"
            said = f"{problem}; only {len(self.used)} of {len(self.fits)} subjects fit"
            raise InputError(f"{one.row.where}, {one.name}", said, hint)
        return self

    @property
    def used(self) -> IntArray:
        """Numbers of the subjects that fit: those that mean and modes are of."""
        return np.array([n for n, problem in enumerate(self.problems) if not problem], np.int64)

    @property
    def shapes(self) -> FloatArray:
        """Control points (U, V, 3) of those that fit, in mm."""
        return np.array([self.fits[n].spline.vertices for n in self.used])

    def mean(self) -> Template:
        """Template of the next round: the mean of those that fit, all of one size."""
        shapes = aligned(self.shapes, self.template, scaled=True)
        return Template(self.template.spline.moved(shapes.mean(axis=0)))


def fit_cohort(
    subjects: Iterable[Subject], folder: Path, points: int, processes: int = 1, rounds: int = ROUNDS
) -> Cohort:
    """Fit one template to all subjects, in several rounds.

    Parameters
    ----------
    subjects : iterable of Subject
        With different names.
    folder : path
        Each subject's fit of each round is kept there, and used again where nothing has changed.
    points : int
        Control points of the template, about.
    processes : int
        How many subjects are fitted at once.
    rounds : int
        Each has the mean of the last as its template.

    Returns
    -------
    Cohort
        All subjects; a fit that is none has its problem.

    Raises
    ------
    InputError
        Fewer than three subjects fit.
    """
    ordered = sorted(subjects, key=lambda subject: subject.name)
    before: Iterable[Fit | None] = repeat(None)
    if rounds == 1:
        template = first_template(ordered, points)
    else:
        last = fit_cohort(ordered, folder, points, processes, rounds - 1)
        template, before = last.mean(), last.fits if rounds >= FROM_MEAN else before
    _ = template.modes  # once, and not in each process
    with ExitStack() as stack:
        run: Callable[..., Iterable[Fit]] = map
        if processes > 1:
            run = stack.enter_context(worker_processes(min(processes, len(ordered)))).map
        done = run(_kept_fit, repeat(template), before, ordered, repeat(folder / f"round_{rounds}"))
        fits = list(tqdm(done, f"round_{rounds}", len(ordered), leave=False, disable=None))
    return Cohort.judged(ordered, fits, template)


def first_template(subjects: Sequence[Subject], points: int) -> Template:
    """Make the template of the first round: the spline, of so many control points, of the medoid."""
    spline = control_mesh_of(_medoid(subjects).mesh, points)
    return Template(spline.moved(spline.vertices - spline.tessellate(0).vertices.mean(axis=0)))


def fit_subject(template: Template, subject: Subject, before: Fit | None = None) -> Fit:
    """Fit a template to a subject: the job of one round and one subject.

    With a fit of the round before, all control points move by themselves, from the template in the place of
    that fit; where this fails, as for a subject that is too far from the mean, that fit stays.
    """
    if before is None:
        return fit_template(template, subject.mesh)
    fit = fit_template(template, subject.mesh, _posed(template, before.spline))
    return before if problem_of(fit, subject.tolerance) else fit


def _posed(template: Template, spline: ControlMesh) -> FloatArray:
    """Control points (V, 3) of a template, moved by the similarity to a spline with its quads."""
    weight = template.masses / template.masses.sum()
    points, to = template.limits @ template.spline.vertices, template.limits @ spline.vertices
    middle, there = weight @ points, weight @ to
    turn = Rotation.align_vectors(to - there, points - middle, weight)[0]
    size = np.sqrt((weight @ (to - there) ** 2).sum() / (weight @ (points - middle) ** 2).sum())
    return np.asarray(size * turn.apply(template.spline.vertices - middle) + there, float)


def _medoid(subjects: Sequence[Subject]) -> Subject:
    """Return the subject that is nearest to all others, once all have one middle and one area.

    It has as many handles as most have.
    """
    draw = np.random.default_rng(0)
    way = draw.normal(size=(PROBES, 3))
    probes = PROBED * way / np.linalg.norm(way, axis=1, keepdims=True) * np.cbrt(draw.random((PROBES, 1)))
    rough = [subject.mesh.simplified(ROUGH) for subject in subjects]
    sizes = [np.sqrt(mesh.area / (4 * np.pi)) for mesh in rough]
    distances = np.array(
        [to_mesh(probes * a + centroid(one), one) / a for one, a in zip(rough, sizes, strict=True)]
    )
    genus = np.array([subject.mesh.genus for subject in subjects])
    kinds, counts = np.unique(genus, return_counts=True)
    usual = genus == kinds[counts.argmax()]
    return subjects[int(np.argmin(np.where(usual, cdist(distances, distances).sum(axis=1), np.inf)))]


def aligned(shapes: FloatArray, template: Template, scaled: bool) -> FloatArray:
    """Align shapes to their mean: generalised Procrustes analysis (Gower 1975).

    Parameters
    ----------
    shapes : (N, V, 3) float64
        Control points, in mm.
    template : Template
        Its areas weigh the points; the aligned shapes, around 0, have its axes.
    scaled : bool
        Make all sizes equal as well.
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


def _kept_fit(template: Template, before: Fit | None, subject: Subject, folder: Path) -> Fit:
    """Fit a template to a subject, or read the fit that was kept."""
    start = (before.spline.vertices, subject.tolerance) if before else ()
    mesh, path, spline = subject.mesh, folder / f"{subject.name}.h5", template.spline
    made_of = fingerprint(VERSION, spline.vertices, spline.quads, *start, mesh.vertices, mesh.faces)
    if path.is_file() and read_report(path).get("made_of") == made_of:
        return read_fit(path)
    fit = fit_subject(template, subject, before)
    write_fit(path, fit, subject, made_of)
    return fit


def write_fit(path: str | Path, fit: Fit, subject: Subject, made_of: str = "") -> None:
    """Write a fit as a spline, with how good it is and what it is made of."""
    report = {"made_of": made_of, "rms_mm": fit.rms, "crossings": fit.crossings}
    write_control_meshes(path, [fit.spline], subject.frame, report)


def read_fit(path: str | Path) -> Fit:
    """Read what `write_fit` wrote."""
    report, (spline,) = read_report(path), read_bodies(path)
    return Fit(spline, report["rms_mm"], report["crossings"])
