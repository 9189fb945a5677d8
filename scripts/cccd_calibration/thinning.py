"""Surfaces compared with those of the whole mask, or of another reader's: calibrations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from cccd.bands import Calibration, signs_of
from cccd.containers import Frame, Structure
from cccd.contours import trace_contours
from cccd.errors import InputError
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh
from cccd.inputs.annotation import EVERY_SLICE, NONEMPTY
from cccd.inputs.load import structure_of_array
from cccd.settings.root import Settings
from cccd.surface.loft import loft_in_plane
from cccd.surface.spline import SplineSolid
from cccd_calibration.conformal import fewest_organs, too_few_organs
from cccd_calibration.factors import Thinned, calibrate
from cccd_calibration.samples import largest_diameter
from cccd_workflow.surface_measures import mask_surface

#: Every n-th slice is kept.
EVERY = (2, 3, 4, 6, 8, 10)
#: Points on the true surface, and as many on the lofted one.
POINTS = 2000
#: Fewer slices with organ than this are no stack.
LEAST_SLICES = 4


@dataclass(frozen=True)
class Thinning:
    """What is kept of a mask.

    Attributes
    ----------
    axis : int
        Slices run along it.
    every, first : int
        Every n-th slice, from one on.
    block : int
        Pixels are averaged over squares with so many along an edge.
    drawn : bool
        Whether the other slices stay as slices that nobody drew.
    averaged : bool
        Whether slices are averaged as well, instead of one being taken.
    """

    axis: int
    every: int
    first: int = 0
    block: int = 1
    drawn: bool = False
    averaged: bool = False

    def of(self, mask: BoolArray, affine: FloatArray) -> tuple[BoolArray, FloatArray]:
        """Thin a mask; its affine (4, 4) with it."""
        blocks = np.full(3, self.block)
        blocks[self.axis] = self.every if self.averaged else 1
        mask, affine = averaged(mask, affine, blocks)
        if self.averaged:
            return mask, affine
        kept = np.zeros(mask.shape[self.axis], bool)
        kept[self.first :: self.every] = True
        if self.drawn:
            return mask & np.expand_dims(kept, [axis for axis in range(3) if axis != self.axis]), affine
        affine = affine.copy()
        affine[:3, 3] += self.first * affine[:3, self.axis]
        affine[:3, self.axis] *= self.every
        return np.compress(kept, mask, self.axis), affine


def averaged(mask: BoolArray, affine: FloatArray, blocks: FloatArray) -> tuple[BoolArray, FloatArray]:
    """Average a mask over blocks of so many voxels (3,), and cut it at one half."""
    a, b, c = (size // n for size, n in zip(mask.shape, blocks, strict=True))
    i, j, k = map(int, blocks)
    inner = mask[: a * i, : b * j, : c * k].reshape(a, i, b, j, c, k)
    moved = affine.copy()
    moved[:3, :3] *= blocks
    moved[:3, 3] += affine[:3, :3] @ ((blocks - 1) / 2)
    return inner.mean((1, 3, 5), dtype=np.float32) >= 0.5, moved


def calibrate_masks(
    structures: Iterable[Structure], count: int, settings: Settings, location: str
) -> Calibration:
    """Find the factors of the shipped scale on masks of every slice.

    Parameters
    ----------
    structures : iterable of Structure
        Each counts as an organ; made one by one, so that not all are in memory.
    count : int
        How many there are.
    settings : Settings
        Sections ``import``, ``curves`` and ``surface``; ``seed`` draws the slices.
    location : str
        What messages name.

    Raises
    ------
    InputError
        There are too few organs for bands of ``surface.band``, or one is no mask of every slice.
    """
    if count < fewest_organs(settings.surface.band):
        raise too_few_organs(location, count, settings.surface.band)
    rng = np.random.default_rng(settings.seed)
    stacks = [stack for structure in structures for stack in thin(structure, settings, rng)]
    organs = {stack.organ for stack in stacks}
    made_of = f"{len(stacks)} thinned stacks of {len(organs)} organs of {location}"
    return calibrate(stacks, Calibration.read(), made_of, settings.surface.band, location)


def thin(structure: Structure, settings: Settings, rng: np.random.Generator) -> Iterator[Thinned]:
    """Loft a mask's every n-th slice, from a random one on, and compare with the surface of all of them.

    Parameters
    ----------
    structure : Structure
        With a mask on every slice.
    settings : Settings
        Sections ``import``, ``curves`` and ``surface``.
    rng : Generator
        Draws the first slice and the points.

    Yields
    ------
    Thinned
        For each of `EVERY` that leaves `LEAST_SLICES`.

    Raises
    ------
    InputError
        The structure has no mask, or only some of its slices were drawn.
    """
    if structure.annotation is not None or structure.mask is None:
        name = f"{structure.case}/{structure.organ}"
        raise InputError(name, "not a mask on every slice", "calibrate with masks of all slices")
    for every in EVERY:
        how = Thinning(structure.frame.slice_axis, every, int(rng.integers(every)))
        thinned = thin_once(structure, how, settings, rng)
        if thinned is not None:
            yield thinned


def thin_once(
    structure: Structure, how: Thinning, settings: Settings, rng: np.random.Generator
) -> Thinned | None:
    """Loft what is kept of a structure's mask, and compare; None where too few slices are left."""
    name = f"{structure.case}/{structure.organ}"
    mask, affine = structure.mask, structure.affine
    assert mask is not None
    kept, grid = how.of(mask, affine)
    if np.count_nonzero(kept.any(axis=tuple(axis for axis in range(3) if axis != how.axis))) < LEAST_SLICES:
        return None
    reading = settings.import_.model_copy(update={"slice_axis": how.axis})
    rule = NONEMPTY if how.drawn else EVERY_SLICE
    thinned = structure_of_array(kept, grid, reading, name, rule)
    sections = thinned.sections(trace_contours(thinned))
    solid = loft_in_plane(sections, settings.surface)
    whole = Structure(
        structure.case, structure.organ, Frame(affine, how.axis, mask.shape), np.zeros(3, int), mask=mask
    )
    to_plane = np.linalg.inv(solid.stack.to_world).astype(np.float64)
    volume = np.count_nonzero(mask) * float(np.prod(structure.frame.spacing))
    return compare(name, solid, mask_surface(whole).transformed(to_plane), volume, rng)


def compare(organ: str, solid: SplineSolid, truth: Mesh, volume: float, rng: np.random.Generator) -> Thinned:
    """Compare a lofted surface with the true one in the plane's mm and height, of ``volume`` mm^3."""
    mesh, slices = solid.mesh, solid.stack.slices
    rows, offset = sample_offsets(mesh, truth if truth.volume > 0 else truth.reversed(), rng)
    return Thinned(
        organ,
        slices.ratio,
        (mesh.vertices[rows] / slices.pixel).astype(np.float32),
        signs_of(mesh, slices)[rows].astype(np.float32),
        (offset / slices.pixel).astype(np.float32),
        (volume - mesh.volume) / (mesh.area * slices.pixel),
        (truth.area - mesh.area) / (mesh.area * mesh.curvature_per_area * slices.pixel),
        (largest_diameter(truth.vertices) - largest_diameter(mesh.vertices)) / slices.pixel,
    )


def sample_offsets(mesh: Mesh, truth: Mesh, rng: np.random.Generator) -> tuple[IntArray, FloatArray]:
    """Vertices (2 N,) of a mesh, and how far in mm the true surface lies outside them.

    The first half is drawn by area, the second half is nearest to points of the true surface.
    """
    area = mesh.vertex_areas
    here = rng.choice(len(area), POINTS, p=area / area.sum())
    points = truth.sample(POINTS, rng)
    there = cKDTree(mesh.vertices).query(points)[1]
    offset = np.concatenate([-to_mesh(mesh.vertices[here], truth), to_mesh(points, mesh)])
    return np.concatenate([here, there]), offset
