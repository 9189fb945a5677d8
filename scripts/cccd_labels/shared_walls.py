"""Organs of one scan with shared walls: every wall between two of them is one surface.

The labels' signed distances, each interpolated between its own slices, meet on one grid: a node belongs to
the label that it lies deepest in (`cccd_labels.label_fields`), and a wall runs where two distances are equal.
The walls are low-passed once, as the surface of an organ alone is, and moved until each label holds the
volume of its voxels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from cccd.bands import Slices
from cccd.containers import Frame, Structure
from cccd.errors import InputError
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, connected_parts, offsets_of
from cccd.geometry.collisions import MovingTriangles
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import LoftSettings
from cccd.store import read_report, read_structure
from cccd.surface.checks import crossing
from cccd.surface.distances import find_borders
from cccd.surface.loft import band_of
from cccd.surface.smooth_mesh import ROUNDS, default_wave
from cccd.surface.surface import LoftedSurface
from cccd_labels.conforming import ConformingSurface, low_passed, read_conforming
from cccd_labels.label_fields import LabelFields, box_of, gathered, label_sections, level_blocks
from cccd_labels.surface_nets import split_again, surface_nets, well_composed
from cccd_labels.voxels import check_walls
from cccd_labels.wall_decimation import simplified

#: Organs with a voxel of both within so many voxels of some voxel are smoothed together.
GROUP_VOXELS = 1
#: The filter moves a vertex at most by so many pixels: what is one voxel thin keeps its voxels.
MOST_SMOOTHED = 0.5
#: The filter does less where neighbours move the same way: by so much for each pixel, on the mean over some
#: rounds. A wall that moves as a whole takes from one of its organs: one that is a voxel thin would close.
LESS, SHIFT_ROUNDS = 6.0, 8
#: mm: vertices so near to where the scan ends lie there.
SAME_PLANE = 1e-9
#: Waves that go, in those of an organ alone: the edges of nets are even, so they are smoothed more. With 1
#: walls are up to 5 % farther from the truth, with .6 they bend more.
NET_WAVE = 0.75
#: Triangles lie within so many pixels of the walls: with twice as many they are up to 10 % farther.
TOLERANCE = 0.025
#: Walls move by at most so many pixels to give every organ the volume of its voxels.
MOST_OFFSET = 0.5
#: Moves that do.
VOLUME_ROUNDS = 4
#: A volume that is off by more than this share is reported.
VOLUME = 0.01
#: Times that vertices of triangles that pass through each other go halfway back, and the share of these pairs
#: that has to part each time: what does not passes through itself where it began, too.
UNFOLDING_ROUNDS, PARTED = 10, 0.1


@dataclass(frozen=True, eq=False)
class SharedWalls:
    """What came of it.

    Attributes
    ----------
    surface : ConformingSurface
        In mm RAS; labels are the organs' keys, and all have names.
    facts : dict of int to dict
        What the slices tell of each organ: plain JSON; see `cccd_labels.label_fields.LevelBlock`.
    pinched : int
        Places of the grid at which a region touches itself.
    passing : int
        Pairs of triangles that pass through each other.
    """

    surface: ConformingSurface
    facts: dict[int, dict[str, Any]]
    pinched: int
    passing: int

    @classmethod
    def joined(cls, parts: Sequence[SharedWalls]) -> SharedWalls:
        """Take together what touches nowhere."""
        none, one = np.zeros((0, 3), np.int64), [part.surface for part in parts]
        starts = offsets_of([len(each.vertices) for each in one])
        triangles = [each.triangles + start for each, start in zip(one, starts, strict=False)]
        surface = ConformingSurface(
            np.concatenate([none.astype(float), *(each.vertices for each in one)]),
            np.concatenate([none, *triangles]),
            np.concatenate([none[:, :2], *(each.regions for each in one)]),
            {label: name for each in one for label, name in sorted(each.names.items())},
        )
        facts = {label: known for part in parts for label, known in part.facts.items()}
        return cls(surface, facts, sum(part.pinched for part in parts), sum(part.passing for part in parts))

    def report(self) -> dict[str, Any]:
        """Tell what is to be said about it, as plain JSON."""
        return {
            "pinched": self.pinched,
            "self_intersections": self.passing,
            "walls": len(self.surface.pairs),
            "organs": {str(label): known for label, known in self.facts.items()},
        }

    def organ(self, label: int, structure: Structure, settings: LoftSettings) -> LoftedSurface:
        """Give one organ's closed surface, with its error band.

        Parameters
        ----------
        label : int
        structure : Structure
            The organ, on the grid of all.
        settings : LoftSettings

        Raises
        ------
        InputError
            Nothing of it is left.
        """
        mesh, frame = self.surface.mesh_of(label), structure.frame
        if len(mesh.faces) == 0:
            raise InputError(
                structure.organ,
                "nothing of it is left between its neighbours",
                "leave it out, or set shared_walls: false",
            )
        borders = find_borders(label_sections(structure))
        heights = np.asarray(borders.slices * frame.slice_spacing, float)
        slices = Slices(heights, borders.distance, frame.pixel_spacing)
        to_plane: FloatArray = np.asarray(np.linalg.inv(frame.plane_to_world(borders.origin)), float)
        in_plane = mesh.transformed(to_plane)
        band = band_of(in_plane, slices, settings)
        volumes = mesh.piece_volumes
        report = {
            "control_points": 0,
            "control_bytes": 0,
            "vertices": len(mesh.vertices),
            "triangles": len(mesh.faces),
            "bodies": int(np.count_nonzero(volumes > 0)),
            "cavities": int(np.count_nonzero(volumes < 0)),
            **self.facts[label],
        }
        report["warnings"] = [
            *report["warnings"],
            *check_walls(mesh, structure),
            *_of_other_volume(mesh, structure),
            *band.warnings(slices.ratio),
        ]
        return LoftedSurface([], mesh, frame, report, band)


def _of_other_volume(mesh: Mesh, structure: Structure) -> list[str]:
    """Report a volume that is not that of the organ's voxels."""
    if structure.annotation is not None or structure.probability is not None:
        return []
    voxels = np.count_nonzero(structure.required_stack("mask")) * float(structure.frame.spacing.prod())
    share = mesh.volume / voxels
    said = f"the surface has {share:.1%} of its voxels' volume: small parts were dropped, or are a voxel thin"
    return [said] if abs(share - 1) > VOLUME else []


def read_structures(files: Sequence[str | Path]) -> dict[int, Structure]:
    """Read the files ``structure.h5`` of every organ of a case, without their images.

    Labels are those of the map where each organ has one of its own, and count from 1 otherwise.
    """
    structures: list[Structure] = []
    for file in files:
        structures.append(read_structure(file))
        structures[-1].image = None  # as large as the mask four times over
    labels = [str(structure.provenance.get("label", "")) for structure in structures]
    if len(set(labels)) == len(labels) and all(label.isdecimal() for label in labels):
        return {int(label): structure for label, structure in zip(labels, structures, strict=True)}
    return dict(enumerate(structures, 1))


def take_organ(walls: str | Path, structure: str | Path, settings: LoftSettings) -> LoftedSurface | None:
    """Take one organ out of the file ``walls.h5`` of its case; None where it touches no other.

    Parameters
    ----------
    walls, structure : path
        The case's file, and the organ's ``structure.h5``.
    settings : LoftSettings

    Raises
    ------
    InputError
        Nothing of it is left.
    """
    surface, report = read_conforming(walls), read_report(walls)
    organ = read_structure(structure)
    label = next((label for label, name in surface.names.items() if name == organ.organ), None)
    if label is None:
        return None
    facts = {int(key): known for key, known in report["organs"].items()}
    shared = SharedWalls(surface, facts, report["pinched"], report["self_intersections"])
    return shared.organ(label, organ, settings)


def share_walls(structures: Mapping[int, Structure], settings: LoftSettings) -> SharedWalls:
    """Smooth organs of one scan together, those of them that touch others.

    Parameters
    ----------
    structures : mapping of int to Structure
        By label, from 1; all on one grid of voxels, and with masks.
    settings : LoftSettings
        Section ``surface`` of the configuration.

    Raises
    ------
    InputError
        Without a mask, or where the scans' grids differ.
    """
    structures = on_one_grid(structures)
    groups = [group for group in touching_groups(structures) if len(group) > 1]
    return SharedWalls.joined(
        [_interpolated({label: structures[label] for label in group}, settings) for group in groups]
    )


def _interpolated(structures: Mapping[int, Structure], settings: LoftSettings) -> SharedWalls:
    """Interpolate organs that touch, and let them meet."""
    fields = LabelFields.empty(list(structures.values()))
    fields.add(0, level_blocks(fields.together(), settings))
    for number, structure in fields.structures.items():
        fields.add(number, level_blocks(structure, settings))
    return meet(fields, list(structures), settings)


def meet(fields: LabelFields, labels: Sequence[int], settings: LoftSettings) -> SharedWalls:
    """Mesh and smooth the walls of organs that were interpolated.

    Parameters
    ----------
    fields : LabelFields
    labels : sequence of int
        Of its numbers, from 1.
    settings : LoftSettings

    Returns
    -------
    SharedWalls
        An organ that turns out to touch no other is left out: it has a spline by itself.
    """
    frame = fields.frame
    pixel = float(np.sqrt(frame.pixel_spacing.prod()))
    rough, means, quads, pinched = _rough(fields)
    at_end = _at_end(rough, fields)
    wave = default_wave(pixel, frame.slice_spacing) if settings.smoothing is None else settings.smoothing
    smooth = _held(rough, low_passed(rough, NET_WAVE * wave, ROUNDS), at_end, pixel)
    moved = smooth - means
    walls = split_again(replace(rough, vertices=smooth), quads)
    of_organs = ~np.isin(walls.regions, [0, fields.beyond]).all(axis=1)
    walls = replace(walls, triangles=walls.triangles[of_organs], regions=walls.regions[of_organs])
    del rough, at_end, means, quads
    walls = _with_ends(simplified(walls, TOLERANCE * pixel), fields.beyond, frame.ends)
    vertices = _with_volumes(walls, fields.volumes, frame.ends, MOST_OFFSET * pixel)
    vertices, pairs = _unfolded(
        replace(walls, vertices=vertices),
        lambda: walls.vertices - moved[cKDTree(smooth).query(walls.vertices)[1]],
    )
    regions = np.array([0, *labels])[walls.regions]
    alone = np.setdiff1d(regions, [0, *np.unique(regions[regions.min(axis=1) > 0])])
    kept = ~np.isin(regions, alone).any(axis=1)
    numbers = {label: number for number, label in enumerate(labels, 1) if label not in alone}
    names = {label: fields.structures[number].organ for label, number in numbers.items()}
    surface = ConformingSurface(vertices, walls.triangles[kept], regions[kept], names)
    warnings = _crossings(replace(walls, vertices=vertices, regions=regions), pairs, frame, fields.first)
    facts = {label: dict(fields.facts[number]) for label, number in numbers.items()}
    for label, known in facts.items():
        known["warnings"] = [*known["warnings"], *warnings.get(label, [])]
    return SharedWalls(_in_world(surface, frame, fields.first), facts, pinched, len(pairs))


def _rough(fields: LabelFields) -> tuple[ConformingSurface, FloatArray, IntArray, int]:
    """Mesh the walls with the grid's ripples, in the plane's mm and height.

    Returns them, places (V, 3) of their vertices where hardly anything passes through itself, the
    quadrilaterals (Q, 4) among them, and how many places of the grid are pinched.
    """
    regions, pinched = well_composed(fields.owners(), fields.price, fields.cut)
    net, nearer, quads = surface_nets(regions, fields.cut)
    levels, spacing = np.arange(len(fields.heights)), fields.frame.pixel_spacing
    nearer, means = (
        np.column_stack([nodes[:, 1:] * spacing, np.interp(nodes[:, 0], levels, fields.heights)])
        for nodes in (nearer, net.vertices)
    )
    return replace(net, vertices=nearer), means, quads, pinched


def _at_end(rough: ConformingSurface, fields: LabelFields) -> FloatArray:
    """Heights (V,) of the planes at which the scan ends, for vertices that lie on them; else not a number."""
    cap = (rough.regions.max(axis=1) == fields.beyond) & (rough.regions.min(axis=1) > 0)
    heights, on_cap = np.full(len(rough.vertices), np.nan), np.unique(rough.triangles[cap])
    heights[on_cap] = np.where(rough.vertices[on_cap, 2] < sum(fields.frame.ends) / 2, *fields.frame.ends)
    return heights


def _held(rough: ConformingSurface, smooth: FloatArray, at_end: FloatArray, pixel: float) -> FloatArray:
    """Smoothed vertices (V, 3) that moved neither far nor with their neighbours, and on the scan's ends."""
    step, most = smooth - rough.vertices, MOST_SMOOTHED * pixel
    edges, shift = rough.edges[0], step
    links = csr_array((np.ones(len(edges)), tuple(edges.T)), shape=(len(step), len(step)))
    links = links + links.T
    degree = np.asarray(links.sum(axis=1))[:, None]
    for _ in range(SHIFT_ROUNDS):
        shift = np.asarray(links @ shift) / degree
    step = step * (1 - np.clip(LESS * np.linalg.norm(shift, axis=1) / pixel, 0, 1))[:, None]
    held = rough.vertices + step * (most / np.maximum(np.linalg.norm(step, axis=1), most))[:, None]
    held[:, 2] = np.where(np.isnan(at_end), held[:, 2], at_end)
    return held


def _with_ends(surface: ConformingSurface, beyond: int, ends: tuple[float, float]) -> ConformingSurface:
    """Walls at which what lies past the ends of the scan is the outside, and that are planes there."""
    vertices, past = surface.vertices.copy(), (surface.regions == beyond).any(axis=1)
    on_cap = np.unique(surface.triangles[past])
    vertices[on_cap, 2] = np.where(vertices[on_cap, 2] < sum(ends) / 2, *ends)
    regions = np.where(surface.regions == beyond, 0, surface.regions)
    turned, triangles = regions[:, 0] < regions[:, 1], surface.triangles.copy()
    for part in (regions, triangles):  # normals leave the larger label
        part[turned] = part[turned, ::-1]
    return ConformingSurface(vertices, triangles, regions, surface.names)


def _in_world(surface: ConformingSurface, frame: Frame, first: IntArray) -> ConformingSurface:
    """Walls in mm RAS; normals still leave the larger label."""
    moved = Mesh(surface.vertices, surface.triangles).transformed(frame.plane_to_world(first)).compact()
    return replace(surface, vertices=moved.vertices, triangles=moved.faces)


def _crossings(
    surface: ConformingSurface, pairs: IntArray, frame: Frame, first: IntArray
) -> dict[int, list[str]]:
    """Tell by label where triangles of pairs (K, 2) that pass through each other are both of one organ."""
    beside = surface.regions[pairs]
    mesh, to_world = Mesh(surface.vertices, surface.triangles), frame.plane_to_world(first)
    found = {
        label: crossing(mesh, pairs[(beside == label).any(axis=2).all(axis=1)])
        for label in np.unique(beside).tolist()
    }
    return {label: [violation.line(to_world) for violation in organ] for label, organ in found.items()}


def touching_groups(structures: Mapping[int, Structure]) -> list[list[int]]:
    """Group labels, so that between voxels of two groups there are two others at least.

    Parameters
    ----------
    structures : mapping of int to Structure
        By label, from 1.

    Returns
    -------
    list of list of int
        Labels of each group, ascending.

    Raises
    ------
    InputError
        One has no mask, or their grids differ.
    """
    structures = on_one_grid({label: structures[label] for label in sorted(structures)})
    low, high = box_of(structures)
    labels, count = gathered(structures, low - GROUP_VOXELS, high + GROUP_VOXELS), len(structures)
    size = 2 * GROUP_VOXELS + 1
    largest = ndimage.maximum_filter(labels, size)
    # of two numbers in the window that are not 0 the smaller one: the largest of their reversed order
    np.subtract(count + 1, labels, out=labels, where=labels > 0)
    least = count + 1 - ndimage.maximum_filter(labels, size)
    beside = np.zeros((count + 2, count + 1), bool)
    beside[least, largest] = True
    one, other = np.nonzero(beside[1 : count + 1, 1:])  # without the windows that hold no organ
    group = connected_parts(one, other, count)
    numbers = np.array(list(structures))
    return [numbers[group == number].tolist() for number in range(group.max() + 1)]


def on_one_grid(structures: Mapping[int, Structure]) -> dict[int, Structure]:
    """Give the masks of one scan one grid: the coarsest of those that their voxels were copied from.

    Parameters
    ----------
    structures : mapping of int to Structure
        By label.

    Raises
    ------
    InputError
        One has no mask, or they are of several scans.
    """
    first = next(iter(structures.values()))
    for structure in structures.values():
        file = structure.frame.of_file
        if structure.mask is None:
            raise InputError(structure.organ, "it has no mask", "walls are shared by labels of one map")
        if not _same(file, first.frame.of_file):
            raise InputError(
                structure.organ, f"its grid is not that of {first.organ}", "give labels of one map"
            )
    frame = min((structure.frame for structure in structures.values()), key=lambda one: prod(one.shape))
    return {
        label: structure if _same(structure.frame, frame) else _moved(structure, frame)
        for label, structure in structures.items()
    }


def _same(one: Frame, other: Frame) -> bool:
    return one.shape == other.shape and np.allclose(one.affine, other.affine, atol=1e-4)


def _moved(structure: Structure, frame: Frame) -> Structure:
    """Read a mask at the nearest voxels to those of another grid of the same scan."""
    mask = np.asarray(structure.mask, bool)
    relation = np.linalg.solve(structure.frame.affine, frame.affine)
    ratios, shift = relation.diagonal()[:3], relation[:3, 3] - structure.origin
    origin = np.floor(-shift / ratios).astype(np.int64)
    index = [
        np.rint(ratio * np.arange(first, first + np.ceil(size / ratio) + 2) + start).astype(int)
        for ratio, start, first, size in zip(ratios, shift, origin, mask.shape, strict=True)
    ]
    # beyond its margin, which is background, a mask goes on
    inside = [np.clip(along, 0, size - 1) for along, size in zip(index, mask.shape, strict=True)]
    return replace(structure, frame=frame, origin=origin, mask=mask[np.ix_(*inside)])


def _with_volumes(
    surface: ConformingSurface, wanted: FloatArray, ends: tuple[float, float], most: float
) -> FloatArray:
    """Vertices (V, 3) moved along their walls' normals so that every organ holds the volume of its voxels.

    A wall moves by what one of its organs gains less what the other does, at most by ``most`` mm; what lies
    at the heights ``ends`` of the scan's ends stays there.
    """
    vertices = surface.vertices
    level: BoolArray = np.min(np.abs(vertices[:, 2:] - np.array(ends)), axis=1) < SAME_PLANE
    first, second = surface.regions.T
    count, fixed = len(wanted), np.all(level[surface.triangles], axis=1)
    gained = np.zeros(len(first))
    for _ in range(VOLUME_ROUNDS):
        mesh = Mesh(vertices, surface.triangles)
        volume = np.einsum("fx,fx->f", vertices[surface.triangles[:, 0]], mesh.face_normals) / 6
        held = np.bincount(first, volume, count) - np.bincount(second, volume, count)
        missing = np.where(np.isnan(wanted), 0, wanted - held)
        area = np.where(fixed, 0.0, mesh.face_areas)
        shared = np.zeros((count, count))
        np.add.at(shared, (first, second), area)
        shared += shared.T
        balance = np.diag(shared.sum(axis=1)) - shared
        gain = np.zeros(count)
        gain[1:] = np.linalg.lstsq(balance[1:, 1:], missing[1:], rcond=None)[0]  # the outside stays as it is
        total = np.clip(gained + gain[first] - gain[second], -most, most)
        step = (total - gained)[:, None] * mesh.face_normals
        gained = total
        corners = surface.triangles.ravel()
        sums = [np.bincount(corners, np.repeat(x, 3)) for x in (*step.T, 2 * mesh.face_areas)]
        moved = np.column_stack(sums[:3]) / np.maximum(sums[3], 1e-12)[:, None]
        moved[level, 2] = 0
        vertices = vertices + moved
    return vertices


def _unfolded(surface: ConformingSurface, where: Callable[[], FloatArray]) -> tuple[FloatArray, IntArray]:
    """Vertices (V, 3) that go back to ``where`` they were wherever triangles pass through each other.

    Returns them and the pairs (K, 2) of triangles that still do.
    """
    vertices, triangles = surface.vertices.copy(), MovingTriangles(surface.triangles)
    pairs = triangles.passing_pairs(vertices)
    before, most = where() if len(pairs) else vertices, np.inf
    for number in range(UNFOLDING_ROUNDS):
        if len(pairs) == 0 or (number > 1 and len(pairs) > (1 - PARTED) * most):
            break
        most = len(pairs)
        passing = np.zeros(len(surface.triangles), np.bool_)
        passing[pairs] = True
        beside = Mesh(vertices, surface.triangles).with_neighbours(passing)
        folded = np.unique(surface.triangles[beside])
        vertices[folded] = (vertices[folded] + before[folded]) / 2
        pairs = triangles.passing_pairs(vertices)
    return vertices, pairs
