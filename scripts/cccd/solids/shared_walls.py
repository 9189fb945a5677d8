"""Organs of one scan with shared walls: every wall between two of them is one surface.

Each organ has a smooth closed surface of its own already. Their signed distances meet on one grid: a node
belongs to the organ that it lies deepest in, and a wall runs where the distances to two organs are equal,
midway between the surfaces that either has alone. Where organs touch, the outside begins at the border of
all labels together, smoothed: no gap stays along a wall, and none that the labels have is closed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import ndimage
from scipy.sparse.csgraph import connected_components

from cccd.containers import Frame, Structure
from cccd.errors import InputError
from cccd.geometry.arrays import BoolArray, FloatArray, IntArray, LabelArray, SingleArray, offsets_of
from cccd.geometry.averaging import averaging_rounds
from cccd.geometry.collisions import MovingTriangles
from cccd.geometry.conforming import ConformingSurface, faired
from cccd.geometry.distance import grid_to_mesh
from cccd.geometry.mesh import Mesh, given_back
from cccd.geometry.ply import read_ply
from cccd.geometry.surface_nets import split_again, surface_nets, well_composed
from cccd.inputs.annotation import with_undrawn_filled
from cccd.solids.seams import seam_weights
from cccd.store import read_structure

__all__ = [
    "Organ",
    "SharedWalls",
    "on_one_grid",
    "read_organs",
    "read_structures",
    "share_walls",
    "surface_of",
    "touching_groups",
    "with_neighbours",
]

#: Distances to an organ's surface are kept up to so many cells to either side of it.
BAND_CELLS = 2.0
#: Surfaces keep this share of a grid's edge away from its nodes.
EDGE_MARGIN = 0.02
#: How far vertices are trusted that lie where the scan ends; all others count 1.
FULL_TRUST = 1e3
#: Cells that a vertex moves at most along an axis to lie on its wall.
MOST_STEP = 0.3
#: Vertices within this share of a cell of where the scan ends lie on that plane.
SAME_PLANE = 1e-3
#: Organs with a voxel of both within so many voxels of some voxel are smoothed together.
GROUP_VOXELS = 1
#: Cells of the grid on which organs meet, in pixels of at most so many mm: a shell of one pixel has a node in
#: it. At 0.75 ribs and vessels lose a tenth of their accuracy.
CELL_PIXELS = 0.6
#: Cells are then about half as long as the edges of the meshes that organs have alone.
COARSEST_MM = 1.9
#: Width in voxels of the kernel that smooths the border of all labels where organs touch: the first for
#: voxels up to the first edge in mm, the second from the second edge on. At 0.6 half of the organs of a fine
#: CT lie farther from their voxels than alone, at 0.5 voxels of 3 mm show their steps; at 0.7 gaps of one
#: voxel close.
BORDER_VOXELS = (0.5, 0.6)
BORDER_MM = (1.0, 2.0)
#: That border takes over so far from walls, in the longest edge of the voxel: the rounded edges that organs
#: have alone.
REACH_VOXELS = 3.0
#: Weight of a thin plate's energy against distance in the smoothing of the walls: the grid leaves ripples of
#: a few edges; stiffer, and the organs' own details go.
STIFFNESS = 5.0
#: The same along the lines where three walls meet: to which organ a node beside one goes is nearly a draw; as
#: stiff as walls, lines have teeth.
LINE_STIFFNESS = 150.0
#: What that smoothing takes along the normals is given back, but along these lines, as its average over so
#: far (standard deviation), so often, each time what the last left, as in surfaces alone: ribs and vessels
#: are not drawn in.
REGAIN_PIXELS = 1.6
REGAIN_ROUNDS = 2
#: Walls move by at most this to give every organ the volume of its voxels, as surfaces that are smoothed
#: alone.
MOST_OFFSET_PIXELS = 0.25
#: Times that vertices of triangles that pass through each other go halfway back.
UNFOLDING_ROUNDS = 10


class Organ(NamedTuple):
    """What is known of one organ before it has neighbours."""

    name: str
    structure: Structure
    mesh: Mesh  # smoothed alone, closed, mm RAS


@dataclass(frozen=True, eq=False)
class SharedWalls:
    """What came of it.

    Attributes
    ----------
    surface : ConformingSurface
        In mm RAS; labels are the organs' keys.
    warnings : dict of int to list of str
        Of the organs that there is something to say about.
    pinched : int
        Places of the grid at which a region touches itself.
    passing : int
        Pairs of triangles that pass through each other.
    """

    surface: ConformingSurface
    warnings: dict[int, list[str]]
    pinched: int
    passing: int

    def report(self) -> dict[str, Any]:
        """Tell what is to be said about it, as plain JSON."""
        return {
            "pinched": self.pinched,
            "self_intersections": self.passing,
            "walls": len(self.surface.pairs),
            "warnings": {str(label): lines for label, lines in self.warnings.items()},
        }


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


def read_organs(structures: Sequence[str | Path], meshes: Sequence[str | Path]) -> dict[int, Organ]:
    """Read what `share_walls` takes from the files ``structure.h5`` and PLY of every organ of a case."""
    organs: dict[int, Organ] = {}
    for (label, structure), file in zip(read_structures(structures).items(), meshes, strict=True):
        mesh = read_ply(file)
        organs[label] = Organ(structure.organ, with_undrawn_filled(structure, mesh), mesh)
    return organs


def surface_of(surface: ConformingSurface, name: str) -> Mesh:
    """Find the closed mesh of an organ by its name.

    Raises
    ------
    InputError
        Nothing of it is left.
    """
    label = next((label for label, other in surface.names.items() if other == name), 0)
    mesh = surface.mesh_of(label)
    if label == 0 or len(mesh.faces) == 0:
        raise InputError(
            name, "nothing of it is left between its neighbours", "leave it out, or set shared_walls: false"
        )
    return mesh


def share_walls(organs: Mapping[int, Organ]) -> SharedWalls:
    """Smooth organs of one scan together.

    Parameters
    ----------
    organs : mapping of int to Organ
        By label, from 1; all on one grid of voxels, and with masks.

    Raises
    ------
    InputError
        Without a mask, or where the scans' grids differ.
    """
    structures = on_one_grid({label: organ.structure for label, organ in organs.items()})
    organs = {label: organ._replace(structure=structures[label]) for label, organ in organs.items()}
    groups = touching_groups(structures)
    frame = next(iter(structures.values())).frame
    parts = [_share_walls({label: organs[label] for label in group}, frame) for group in groups]
    offsets = offsets_of([len(part.surface.vertices) for part in parts])
    surface = ConformingSurface(
        np.concatenate([part.surface.vertices for part in parts]),
        np.concatenate([part.surface.triangles + start for part, start in zip(parts, offsets, strict=False)]),
        np.concatenate([part.surface.regions for part in parts]),
        {label: organs[label].name for label in sorted(organs)},
    )
    return SharedWalls(
        surface,
        _warnings(surface, organs),
        sum(part.pinched for part in parts),
        sum(part.passing for part in parts),
    )


def _share_walls(organs: Mapping[int, Organ], frame: Frame) -> SharedWalls:
    """Share the walls of organs that touch; one that touches none keeps the surface that it has alone."""
    labels = sorted(organs)
    if len(labels) == 1:
        alone = organs[labels[0]].mesh
        regions = np.tile([labels[0], 0], (len(alone.faces), 1))
        return SharedWalls(ConformingSurface(alone.vertices, alone.faces, regions), {}, 0, 0)
    to_mm = _world_to_mm(frame)
    voxels = _Voxels.of([organs[label].structure for label in labels], frame)
    cell = CELL_PIXELS * _edge(frame)
    rough, before, pinched = _rough([organs[label].mesh.transformed(to_mm) for label in labels], voxels, cell)
    pixel = float(np.sqrt(frame.pixel_spacing.prod()))
    # each surface takes the place of the last, whose edges and averages are as large as everything else
    walls = split_again(replace(rough, vertices=_smoothed(rough, voxels.ends, cell, pixel)))
    del rough
    walls = replace(walls, vertices=_with_volumes(walls, voxels, cell, MOST_OFFSET_PIXELS * _edge(frame)))
    smooth, passing = _unfolded(walls, before)
    axis, begin, end = voxels.ends
    smooth[:, axis] = np.clip(smooth[:, axis], begin, end)
    vertices = Mesh(smooth, walls.triangles).transformed(_mm_to_world(frame)).vertices
    numbers = np.array([0, *labels])
    triangles = walls.triangles if np.linalg.det(to_mm[:3, :3]) > 0 else walls.triangles[:, ::-1]
    surface = ConformingSurface(vertices, np.ascontiguousarray(triangles), numbers[walls.regions])
    return SharedWalls(surface, {}, pinched, passing)


def _rough(meshes: Sequence[Mesh], voxels: _Voxels, cell: float) -> tuple[ConformingSurface, FloatArray, int]:
    """Let organs meet on a grid; all in mm along the scan's axes.

    Returns the walls with the grid's ripples, the means of their cells' cuts (V, 3), between which nothing
    crosses, and the number of pinched places.
    """
    fields = _Fields.of(meshes, voxels, cell).with_outside(voxels)
    regions, pinched = well_composed(fields.owners(voxels), fields.distance)
    net = surface_nets(regions, fields.cut)
    rough = replace(net, vertices=fields.low + cell * fields.on_walls(net))
    return rough, fields.low + cell * net.vertices, pinched


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
    labels = sorted(structures)
    structures = on_one_grid(structures)
    voxels = _Voxels.of([structures[label] for label in labels], structures[labels[0]].frame)
    size = 2 * GROUP_VOXELS + 1
    largest = ndimage.maximum_filter(voxels.labels, size)
    # of two numbers in the window that are not 0 the smaller one: the largest of their reversed order
    reverse = np.where(voxels.labels > 0, len(labels) + 1 - voxels.labels, 0)
    least = len(labels) + 1 - ndimage.maximum_filter(reverse, size)
    beside = np.zeros((len(labels) + 2, len(labels) + 1), bool)
    beside[least, largest] = True
    links = beside[1 : len(labels) + 1, 1:]  # without the windows that hold no organ
    group = connected_components(links, directed=False)[1]
    return [[labels[n] for n in np.flatnonzero(group == number)] for number in range(group.max() + 1)]


def with_neighbours(structures: Mapping[int, Structure]) -> set[int]:
    """Find the labels of organs that will share walls, and so need no spline; parameters as above.

    Where slices are not annotated, nobody knows before the organs are lofted: there are none then.
    """
    if any(structure.annotation is not None for structure in structures.values()):
        return set()
    return {label for group in touching_groups(structures) if len(group) > 1 for label in group}


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


def _world_to_mm(frame: Frame) -> FloatArray:
    """Affine (4, 4) from world mm to mm along the axes of the scan."""
    return np.diag([*frame.spacing, 1.0]) @ np.linalg.inv(frame.affine)


def _mm_to_world(frame: Frame) -> FloatArray:
    """Affine (4, 4) from mm along the axes of the scan to world mm."""
    return frame.affine @ np.diag([*(1 / frame.spacing), 1.0])


def _edge(frame: Frame) -> float:
    """Pixel's edge in mm that sizes are measured by."""
    return min(float(np.sqrt(frame.pixel_spacing.prod())), COARSEST_MM)


# the labels' voxels -----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Voxels:
    """The organs' voxels as one block: 0 outside and on the block's faces, n for organ n from 1."""

    labels: LabelArray  # (a, b, c)
    origin: IntArray  # (3,), index of the first
    spacing: FloatArray  # (3,) mm
    ends: tuple[int, float, float]  # the axis of the slices, and where in mm the scan begins and ends

    @classmethod
    def of(cls, structures: Sequence[Structure], frame: Frame) -> _Voxels:
        """Gather the masks; a voxel of several is the last one's."""
        masks = [(structure.origin, np.asarray(structure.mask, bool)) for structure in structures]
        low = np.min([origin for origin, _ in masks], axis=0) - 1
        high = np.max([origin + mask.shape for origin, mask in masks], axis=0) + 1
        labels = np.zeros(high - low, np.int32)
        for number, (origin, mask) in enumerate(masks, 1):
            first = origin - low
            block = tuple(slice(a, a + n) for a, n in zip(first, mask.shape, strict=True))
            labels[block][mask] = number
        axis = frame.slice_axis
        return cls(labels, low, frame.spacing, (axis, *frame.ends))

    def at(self, low: FloatArray, cell: float, shape: Sequence[int]) -> LabelArray:
        """Labels of the voxels in which the nodes of a block (A, B, C) of a grid lie."""
        index = []
        for axis, size in enumerate(self.labels.shape):
            mm = low[axis] + cell * np.arange(shape[axis])
            voxel = np.rint(mm / self.spacing[axis]).astype(np.int64) - self.origin[axis]
            index.append(np.clip(voxel, 0, size - 1))
        return self.labels[np.ix_(*index)]

    def around(self, points: FloatArray) -> tuple[LabelArray, FloatArray]:
        """Labels (P, 8) of the voxels around points (P, 3) in mm, and their shares in the interpolation."""
        place = points / self.spacing - self.origin
        first = np.floor(place).astype(np.int64)
        corners = np.indices((2, 2, 2)).reshape(3, 8).T
        weights = np.abs(1 - corners - (place - first)[:, None]).prod(axis=2)
        limit = np.array(self.labels.shape) - 1
        index = np.clip(first[:, None] + corners, 0, limit)
        return self.labels[tuple(np.moveaxis(index, 2, 0))], weights

    def smooth_border(self) -> tuple[SingleArray, IntArray]:
        """Signed distance in mm to the border of all labels, its steps smoothed, and the first voxel (3,).

        The kernel's second moment vanishes: curved borders do not shrink. What the scan cuts goes on beyond
        its last slices.
        """
        edge = np.cbrt(self.spacing.prod())
        width = float(np.interp(edge, BORDER_MM, BORDER_VOXELS))
        margin = int(np.ceil(4 * width)) + 1
        inside = np.pad(self.labels > 0, margin)
        axis, low, high = self.ends
        stack = np.moveaxis(inside, axis, 0)
        first = round(low / self.spacing[axis] + 0.5) - int(self.origin[axis]) + margin
        last = round(high / self.spacing[axis] - 0.5) - int(self.origin[axis]) + margin
        if 0 <= first < len(stack):
            stack[:first] = stack[first]
        if 0 <= last < len(stack):
            stack[last + 1 :] = stack[last]
        distance = _signed_distance(inside, self.spacing)
        once = ndimage.gaussian_filter(distance, width)
        return 2 * once - ndimage.gaussian_filter(once, width), self.origin - margin


def _signed_distance(inside: BoolArray, spacing: FloatArray) -> SingleArray:
    """Signed distance of voxels in mm to the border between centres inside and outside."""
    half = float(spacing.min()) / 2
    into = np.asarray(ndimage.distance_transform_edt(inside, sampling=spacing), np.float32)
    out = np.asarray(ndimage.distance_transform_edt(~inside, sampling=spacing), np.float32)
    return np.where(inside, half - into, out - half)


# distances on one grid --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Fields:
    """Signed distances in mm to organs, each on its own block of one grid, and to the outside.

    Attributes
    ----------
    low : (3,) float64
        The first node, in mm along the scan's axes.
    cell : float
        mm between nodes.
    first, size : (N, 3) int64
        First node and number of nodes of each organ's block.
    offsets : (N + 1,) int64
        Where in ``values`` the blocks begin.
    values : (P,) float32
        Distances, cut off at a band; beyond its block an organ is as far away as the band is wide.
    least : (A, B, C) float32
        Distance to the organ that a node lies deepest in.
    meeting : (A, B, C) bool
        Nodes near which the surfaces of two organs run.
    outer : (A, B, C) float32
        Distance to all organs together, joined without gaps along their walls.
    """

    low: FloatArray
    cell: float
    first: IntArray
    size: IntArray
    offsets: IntArray
    values: SingleArray
    least: SingleArray
    meeting: BoolArray
    outer: SingleArray

    @classmethod
    def of(cls, meshes: Sequence[Mesh], voxels: _Voxels, cell: float) -> _Fields:
        """Sample the distances to closed meshes in mm along the scan's axes."""
        reach = np.array([[mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)] for mesh in meshes])
        low = reach[:, 0].min(axis=0) - (3 + 1 / np.pi) * cell
        shape = np.ceil((reach[:, 1].max(axis=0) - low) / cell).astype(np.int64) + 4
        first = np.maximum(np.floor((reach[:, 0] - low) / cell - BAND_CELLS).astype(np.int64), 0)
        stop = np.minimum(np.ceil((reach[:, 1] - low) / cell + BAND_CELLS).astype(np.int64) + 1, shape)
        size = stop - first
        offsets = offsets_of(size.prod(axis=1))
        values = np.empty(int(offsets[-1]), np.float32)
        band, near = np.float32(BAND_CELLS * cell), 0.75 * max(cell, float(voxels.spacing.max()))
        least = np.full(shape, band)
        walls = np.zeros(shape, np.uint8)
        for number, mesh in enumerate(meshes):
            a, b, c = (int(n) for n in size[number])
            start = low + cell * first[number]
            distance = np.asarray(grid_to_mesh(mesh, start, cell, (a, b, c), BAND_CELLS).values, np.float32)
            distance = _held(distance, voxels.at(start, cell, (a, b, c)), number + 1, cell)
            values[offsets[number] : offsets[number + 1]] = distance.ravel()
            block = tuple(slice(f, f + n) for f, n in zip(first[number], (a, b, c), strict=True))
            least[block] = np.minimum(least[block], distance)
            walls[block] += np.abs(distance) < near
        return cls(low, cell, first, size, offsets, values, least, walls > 1, least)

    def with_outside(self, voxels: _Voxels) -> _Fields:
        """Let the border of all labels together take over near walls, up to where the scan ends."""
        outer = self.least.copy()
        seams = np.argwhere(self.meeting)
        axis, start, stop = voxels.ends
        reach = REACH_VOXELS * float(voxels.spacing.max()) / self.cell
        weight = seam_weights(seams.astype(float), self.shape, reach)
        nodes = np.argwhere(weight)
        at = tuple(nodes.T)
        border, origin = voxels.smooth_border()
        where = ((self.low + self.cell * nodes) / voxels.spacing - origin).T
        band = BAND_CELLS * self.cell
        target = ndimage.map_coordinates(border, where, order=1, mode="nearest")
        share = weight[at] / np.float32(255)
        outer[at] = (1 - share) * outer[at] + share * np.clip(target, -band, band)
        height = self.low[axis] + self.cell * np.arange(self.shape[axis])
        beyond = np.maximum(start - height, height - stop).astype(np.float32)
        beyond = np.expand_dims(beyond, tuple({0, 1, 2} - {axis}))
        outer = np.maximum(outer, np.clip(beyond, -band, band))
        return replace(self, outer=outer)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Nodes of the grid."""
        a, b, c = self.least.shape
        return a, b, c

    def owners(self, voxels: _Voxels) -> LabelArray:
        """Give each node (A, B, C) the number, from 1, of the organ that it lies deepest in; 0 outside.

        Alone, organs have rounded edges, so along junction lines there are nodes in none of them: those go to
        the organ that is near and has most of the voxels around.
        """
        owner = np.zeros(self.shape, np.int32)
        for number, (first, size) in enumerate(zip(self.first, self.size, strict=True), 1):
            block = tuple(slice(f, f + n) for f, n in zip(first, size, strict=True))
            mine = self.values[self.offsets[number - 1] : self.offsets[number]].reshape(size)
            owner[block][(mine <= self.least[block]) & (owner[block] == 0)] = number
        owner[self.outer > 0] = 0
        left = np.argwhere((self.outer <= 0) & (self.least > 0))
        labels, shares = voxels.around(self.low + self.cell * left)
        best = np.full(len(left), np.inf)
        voxel = float(np.cbrt(voxels.spacing.prod()))
        for candidate in labels.T:
            share = (shares * (labels == candidate[:, None])).sum(axis=1)
            price = np.where(candidate > 0, self.distance(left, candidate) - voxel * share, np.inf)
            better = price < best
            best[better] = price[better]
            owner[tuple(left[better].T)] = candidate[better]
        return owner

    def distance(self, nodes: IntArray, organ: LabelArray) -> FloatArray:
        """Distance (P,) of nodes (P, 3) to organs (P,); to the outside for 0."""
        distance = np.full(len(nodes), BAND_CELLS * self.cell)
        outside = organ == 0
        distance[outside] = -self.outer[tuple(nodes[outside].T)]
        number = np.maximum(organ - 1, 0)
        inside, flat = ~outside, self.offsets[number]
        for axis, step in enumerate((self.size[:, 1] * self.size[:, 2], self.size[:, 2], 1)):
            local = nodes[:, axis] - self.first[number, axis]
            inside &= (local >= 0) & (local < self.size[number, axis])
            flat = flat + local * np.broadcast_to(step, len(self.size))[number]
        distance[inside] = self.values[flat[inside]]
        return distance

    def cut(self, nodes: IntArray, ends: IntArray, low: LabelArray, high: LabelArray) -> FloatArray:
        """Share (E,) of edges at which they leave one organ for another.

        Midway between where they leave the one and enter the other, as either has its surface alone; where
        only one of them has its surface there, as along the rounded edges of the other, that one's; and at
        the border of all organs together, that.
        """
        total, count = np.zeros(len(nodes)), np.zeros(len(nodes))
        at_border = (low == 0) | (high == 0)
        for organ, way in ((low, 1), (high, -1)):
            here, there = way * self.distance(nodes, organ), way * self.distance(ends, organ)
            crosses = (here < 0) & (there >= 0) & (~at_border | (organ == 0))
            total += np.divide(here, here - there, out=np.zeros(len(nodes)), where=crosses)
            count += crosses
        middle = np.divide(total, count, out=np.full(len(nodes), 0.5), where=count > 0)
        return np.clip(middle, EDGE_MARGIN, 1 - EDGE_MARGIN)

    def on_walls(self, net: ConformingSurface) -> FloatArray:
        """Vertices (V, 3) in nodes, moved onto the wall that runs through their cell, where it is one only.

        The mean of a cell's cuts lies on the hollow side of a bent wall; a step along the gradient of the
        interpolated distances makes up for that.
        """
        vertices = net.vertices.copy()
        sides = np.full((len(vertices), 2), -1, np.int32)
        single = np.ones(len(vertices), bool)
        for corner in net.triangles.T:
            unseen = sides[corner, 0] < 0
            sides[corner[unseen]] = net.regions[unseen]
        for corner in net.triangles.T:
            single[corner[(sides[corner] != net.regions).any(axis=1)]] = False
        chosen = np.flatnonzero(single)
        inner, outer = sides[chosen].T
        first = np.floor(vertices[chosen]).astype(np.int64)
        share = vertices[chosen] - first
        value, slope = np.zeros(len(chosen)), np.zeros((len(chosen), 3))
        for bits in np.indices((2, 2, 2)).reshape(3, 8).T:
            node = first + bits
            apart = np.where(outer == 0, 1.0, 0.5) * -self.distance(node, outer)
            apart += np.where(outer == 0, 0.0, 0.5) * self.distance(node, inner)
            x, y, z = np.where(bits, share, 1 - share).T
            value += apart * (x * y * z)
            for axis, others in enumerate((y * z, x * z, x * y)):
                slope[:, axis] += apart * others * (1 if bits[axis] else -1)
        square = np.maximum((slope**2).sum(axis=1), (self.cell / 2) ** 2)
        step = -slope * (value / square)[:, None]
        vertices[chosen] += np.clip(step, -MOST_STEP, MOST_STEP)
        return vertices


def _held(distance: SingleArray, labels: LabelArray, number: int, cell: float) -> SingleArray:
    """Hold an organ's surface within a cell of its own voxels, where its smoothing lost a part of it."""
    mine = labels == number
    held = np.where(mine, np.minimum(distance, np.float32(cell)), distance)
    return np.where(mine, held, np.maximum(held, np.float32(-cell)))


# the mesh ---------------------------------------------------------------------------------------------


def _level(surface: ConformingSurface, ends: tuple[int, float, float], cell: float) -> BoolArray:
    """Vertices (V,) that lie where the scan ends."""
    axis, *planes = ends
    return np.abs(surface.vertices[:, axis, None] - np.array(planes)).min(axis=1) < SAME_PLANE * cell


def _smoothed(
    surface: ConformingSurface,
    ends: tuple[int, float, float],
    cell: float,
    pixel: float,
) -> FloatArray:
    """Vertices (V, 3) without the grid's ripples; those where the scan ends stay on its planes.

    What that takes along the normals, thin organs above all, is averaged within walls over some pixels and
    given back.
    """
    level, on_lines = _level(surface, ends, cell), surface.on_junctions
    stiffness = np.where(on_lines, LINE_STIFFNESS, STIFFNESS)
    smooth = faired(surface, np.where(level, FULL_TRUST, 1.0), stiffness)
    held = level | on_lines
    averagings = averaging_rounds(REGAIN_PIXELS * pixel, cell)

    def average(lost: FloatArray) -> FloatArray:
        return np.where(held, 0.0, surface.averages(np.where(held, 0.0, lost), [averagings])[0])

    rough = Mesh(surface.vertices, surface.triangles)
    smooth = given_back(rough, Mesh(smooth, surface.triangles), average, REGAIN_ROUNDS).vertices
    smooth[level, ends[0]] = surface.vertices[level, ends[0]]
    return smooth


def _with_volumes(surface: ConformingSurface, voxels: _Voxels, cell: float, most: float) -> FloatArray:
    """Vertices (V, 3) moved along their walls' normals so that every organ holds the volume of its voxels.

    A wall moves by what one of its organs gains less what the other does, at most by ``most`` mm.
    """
    mesh = Mesh(surface.vertices, surface.triangles)
    count = int(voxels.labels.max()) + 1
    wanted = np.bincount(voxels.labels.ravel(), minlength=count) * float(voxels.spacing.prod())
    missing = wanted - [surface.mesh_of(label).volume for label in range(count)]
    level = _level(surface, voxels.ends, cell)
    area = np.where(level[surface.triangles].all(axis=1), 0.0, mesh.face_areas)
    first, second = surface.regions.T
    shared = np.zeros((count, count))
    np.add.at(shared, (first, second), area)
    shared += shared.T
    balance = np.diag(shared.sum(axis=1)) - shared
    gain = np.zeros(count)
    gain[1:] = np.linalg.lstsq(balance[1:, 1:], missing[1:], rcond=None)[0]  # the outside stays as it is
    step = np.clip(gain[first] - gain[second], -most, most)[:, None] * mesh.face_normals
    moved, weight = np.zeros_like(surface.vertices), np.zeros(len(surface.vertices))
    for corner in surface.triangles.T:
        for axis in range(3):
            moved[:, axis] += np.bincount(corner, step[:, axis], len(weight))
        weight += np.bincount(corner, 2 * mesh.face_areas, len(weight))
    moved /= np.maximum(weight, 1e-12)[:, None]
    moved[level, voxels.ends[0]] = 0
    return surface.vertices + moved


def _unfolded(surface: ConformingSurface, before: FloatArray) -> tuple[FloatArray, int]:
    """Vertices (V, 3) that go back towards where they were wherever triangles pass through each other.

    Returns them and how many pairs of triangles still do.
    """
    vertices = surface.vertices.copy()
    moving = MovingTriangles(surface.triangles)
    for _ in range(UNFOLDING_ROUNDS):
        pairs = moving.passing_pairs(vertices)
        if len(pairs) == 0:
            return vertices, 0
        folded = np.zeros(len(vertices), bool)
        folded[surface.triangles[pairs.ravel()]] = True
        around = surface.triangles[folded[surface.triangles].any(axis=1)]
        folded[around] = True
        vertices[folded] = (vertices[folded] + before[folded]) / 2
    return vertices, len(moving.passing_pairs(vertices))


def _warnings(surface: ConformingSurface, organs: Mapping[int, Organ]) -> dict[int, list[str]]:
    """Organs that have nothing left, or whose surface is not manifold."""
    said: dict[int, list[str]] = {}
    there = set(surface.labels)
    for label, organ in organs.items():
        if label not in there:
            said[label] = [f"{organ.name} is too thin for the grid of the shared walls, and is left out"]
    return said
