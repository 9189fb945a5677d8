"""Baselines at their best: a grid of settings scored cheaply, and those chosen from it measured in full."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pyvista as pv

from cccd.containers import Structure
from cccd.geometry.distance import unsigned_to_mesh
from cccd.geometry.mesh import Mesh
from cccd_paper.comparisons.baselines.surfaces import Family, Program
from cccd_paper.comparisons.paper_k import AS_SMOOTH, AS_SMOOTH_SLACK, BEST, DEFAULTS
from cccd_paper.comparisons.timing import timed
from cccd_paper.comparisons.volume_meshes import Smoothing, windowed_sinc
from cccd_workflow.surface_measures import Reference, measure_mesh

#: Points on each surface by which distances are measured, and by which settings are chosen.
SAMPLES, FEW_SAMPLES = 10_000, 2_000
#: Edges by which the bending of a candidate is estimated.
_EDGES = 50_000


class Truth:
    """The surface that candidates are held against, and points on it."""

    def __init__(self, reference: Reference, seed: int = 0) -> None:
        self.reference = reference
        self.points = reference.mesh.sample(FEW_SAMPLES, np.random.default_rng(seed))


class _Candidate(NamedTuple):
    assd: float
    bending: float
    shape: Mesh
    smoothing: Smoothing | None
    name: str
    seconds: float


class _Scorer:
    """ASSD and bending of one mesh with its vertices here and there: what its faces decide is found once."""

    def __init__(self, mesh: Mesh, truth: Truth) -> None:
        rng = np.random.default_rng(0)
        self.mesh, self.truth = mesh, truth
        pairs = Mesh(mesh.vertices, mesh.faces).dihedrals  # of a copy, which does not keep them
        self.edges = len(pairs.edges)
        taken = rng.integers(self.edges, size=_EDGES)
        self.ends, self.sides = pairs.edges[taken], pairs.faces[taken]
        self.sampled = rng.choice(len(mesh.faces), FEW_SAMPLES, p=mesh.face_areas / mesh.area)
        self.weights = rng.dirichlet(np.ones(3), FEW_SAMPLES)
        self.areas, self.area = mesh.face_areas[self.sampled], mesh.area

    def score(self, vertices: np.ndarray) -> tuple[float, float]:
        moved = Mesh(vertices, self.mesh.faces)
        drawn: Any = pv.PolyData(moved.to_vtk())  # for few points libigl's boxes cost four times as much
        _, nearest = drawn.find_closest_cell(self.truth.points, return_closest_point=True)
        there = np.linalg.norm(nearest - self.truth.points, axis=1)
        points = np.einsum("pc,pcx->px", self.weights, vertices[moved.faces[self.sampled]])
        back = unsigned_to_mesh(points, self.truth.reference.mesh)
        return float(there.mean() + back.mean()) / 2, self._bending(moved)

    def _bending(self, moved: Mesh) -> float:
        """Estimate `Mesh.curvature_per_area` from some of the edges, and how some of the faces grew."""
        first, second = (Mesh(moved.vertices, moved.faces[side]).unit_normals for side in self.sides.T)
        sine = np.linalg.norm(np.cross(first, second), axis=1)
        angle = np.arctan2(sine, np.einsum("ec,ec->e", first, second))
        length = np.linalg.norm(np.subtract(*moved.vertices[self.ends.T]), axis=1)
        grown = Mesh(moved.vertices, moved.faces[self.sampled]).face_areas / self.areas
        return float((angle * length).mean()) * self.edges / (self.area * float(grown.mean()))


def tuned_rows(
    family: Family | Program, structure: Structure, measured: Structure, truth: Truth, ours_bends: float
) -> Iterator[dict[str, Any]]:
    """Rows of one baseline at its best settings.

    Parameters
    ----------
    family : Family or Program
        The baseline.
    structure : Structure
        What it reconstructs.
    measured : Structure
        What its surfaces are measured against, in full.
    truth : Truth
        The surface of ``measured``.
    ours_bends : float
        ``curvature_per_area_mm`` of our own surface.

    Yields
    ------
    dict
        The columns of `measure_mesh`, ``method``, ``chosen``, ``setting`` and processor ``seconds``: a row
        for the setting of the smallest ASSD, one for the smallest among those that bend at most 1.05 times as
        ours does, where there are such, and one for a program's own; those that are the same share a row.
    """
    candidates = sorted(_candidates(family, structure, truth), key=lambda one: (one.assd, one.bending))
    calm = next((one for one in candidates if one.bending <= AS_SMOOTH_SLACK * ours_bends), None)
    own = str(family.default) if isinstance(family, Program) else None
    default = next((one for one in candidates if one.name == own), None)
    wanted = {BEST: candidates[0], AS_SMOOTH: calm, DEFAULTS: default}
    for one in candidates:
        why = ", ".join(name for name, chosen in wanted.items() if chosen is one)
        if not why:
            continue
        mesh, smoothing_s = one.shape, 0.0
        if one.smoothing is not None:
            mesh, smoothing_s = timed(windowed_sinc, mesh, one.smoothing.rounds, one.smoothing.pass_band)
        yield {
            "method": family.title,
            "chosen": why,
            "setting": one.name,
            **measure_mesh(mesh, measured, reference=truth.reference, samples=SAMPLES),
            "seconds": one.seconds + smoothing_s,
        }


def _candidates(family: Family | Program, structure: Structure, truth: Truth) -> Iterator[_Candidate]:
    """Score every setting of a family; nothing but the isosurface is kept of each."""
    unsmoothed = "" if isinstance(family, Program) else "no smoothing"
    for shape, mesh, seconds in family.meshes(structure):
        scorer = _Scorer(mesh, truth)
        for setting in family.smoothings:
            name = ", ".join(filter(None, (shape, unsmoothed if setting is None else str(setting))))
            moved = mesh if setting is None else windowed_sinc(mesh, setting.rounds, setting.pass_band)
            yield _Candidate(*scorer.score(moved.vertices), mesh, setting, name, seconds)
