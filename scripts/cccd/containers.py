"""The small dataclasses that pass between the stages.

Points are voxel-index coordinates ``(i, j)`` of the source volume: the two axes that are not the
slice axis, in ascending order. ``k`` is the index along the slice axis. Voxel centres have integer
coordinates, so the voxel ``(i, j)`` covers ``[i - 0.5, i + 0.5] x [j - 0.5, j + 0.5]``.
World coordinates are millimetres in RAS.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from cccd.errors import InputError
from cccd.geometry.arrays import offsets_of, split_ragged
from cccd.geometry.mesh import Mesh
from cccd.geometry.polygons import RaggedPolygons, evaluate_spline
from cccd.geometry.raster import rasterise_layers
from cccd.tolerances import ORTHOGONALITY


class Grid(NamedTuple):
    """Voxels of a file: ``world_mm (RAS) = affine @ (a, b, c, 1)``."""

    affine: np.ndarray  # (4, 4)
    shape: tuple[int, int, int]


@dataclass(frozen=True)
class Frame:
    """The source volume's grid and how it lies in the world.

    Attributes
    ----------
    affine : (4, 4) float64
        ``world_mm (RAS) = affine @ (a, b, c, 1)`` for an index in the source volume's own axis order.
    slice_axis : int
        The axis along which slices run: 0, 1 or 2.
    shape : (3,) tuple of int
        Shape of the source volume.
    copied_to : Grid or None
        The file's own grid, where its voxels are copies of this one's, which is coarser.
    """

    affine: np.ndarray
    slice_axis: int
    shape: tuple[int, int, int]
    copied_to: Grid | None = None

    @property
    def of_file(self) -> Frame:
        """The file's own grid: what is written for other programs lies on it."""
        own = self.copied_to
        return self if own is None else Frame(own.affine, self.slice_axis, own.shape)

    @property
    def ends(self) -> tuple[float, float]:
        """Where the scan begins and ends along the slice axis, in mm from the first slice."""
        file, axis = self.of_file, self.slice_axis
        first = float((file.affine[:3, 3] - self.affine[:3, 3]) @ self.normal) if file is not self else 0.0
        step = file.slice_spacing
        return first - step / 2, first + (file.shape[axis] - 0.5) * step

    @property
    def in_plane_axes(self) -> tuple[int, int]:
        """The two axes of ``(i, j)``."""
        first, second = (axis for axis in range(3) if axis != self.slice_axis)
        return first, second

    @property
    def spacing(self) -> np.ndarray:
        """Voxel edge lengths (3,) in mm, in the source volume's axis order.

        Of tilted slices the third is the distance of their planes: the product is a voxel's volume.
        """
        lengths = np.linalg.norm(self.affine[:3, :3], axis=0)
        if self.is_tilted:
            lengths[self.slice_axis] = self.affine[:3, self.slice_axis] @ self.normal
        return lengths

    @property
    def normal(self) -> np.ndarray:
        """Unit normal (3,) of the slices' planes in RAS, on the side of the next slice."""
        step = self.affine[:3, self.slice_axis]
        if not self.is_tilted:
            return step / np.linalg.norm(step)
        across = np.cross(*self.affine[:3, list(self.in_plane_axes)].T)
        return across / np.copysign(np.linalg.norm(across), across @ step)

    @property
    def is_tilted(self) -> bool:
        """Whether each slice lies aside of the one before, as with a tilted gantry."""
        columns = self.affine[:3, :3] / np.linalg.norm(self.affine[:3, :3], axis=0)
        step, plane = columns[:, self.slice_axis], columns[:, list(self.in_plane_axes)]
        return bool(np.abs(step @ plane).max() > ORTHOGONALITY)

    @property
    def tilt(self) -> float:
        """Angle in degrees between the slices' normal and the line through their first pixels."""
        step = self.affine[:3, self.slice_axis]
        return float(np.degrees(np.arccos(min(1.0, self.normal @ step / np.linalg.norm(step)))))

    @property
    def pixel_spacing(self) -> np.ndarray:
        """Edge lengths (2,) of a pixel along i and j, in mm."""
        return self.spacing[list(self.in_plane_axes)]

    @property
    def slice_spacing(self) -> float:
        """Distance of neighbouring slices in mm."""
        return float(self.spacing[self.slice_axis])

    @property
    def stack_affine(self) -> np.ndarray:
        """The affine (4, 4) with columns reordered so that ``world = stack_affine @ (i, j, k, 1)``."""
        return self.affine[:, [*self.in_plane_axes, self.slice_axis, 3]]

    def plane_to_world(self, origin: np.ndarray) -> np.ndarray:
        """Affine (4, 4) to mm RAS from mm in the slices' plane, from a pixel ``(i, j)`` on, and of height."""
        scale = np.diag([*(1 / self.pixel_spacing), 1 / self.slice_spacing, 1.0])
        scale[:2, 3] = origin
        return self.stack_affine @ scale

    def to_world(self, points: np.ndarray, k: np.ndarray | float) -> np.ndarray:
        """World coordinates (P, 3) in mm of in-plane points (P, 2) on slice(s) ``k``."""
        points = np.asarray(points, float)
        index = np.column_stack([points, np.broadcast_to(np.asarray(k, float), len(points))])
        return index @ self.stack_affine[:3, :3].T + self.stack_affine[:3, 3]


@dataclass(frozen=True, eq=False)
class ProbabilityStack:
    """Probabilities that pixels are the organ, one half on its border.

    Attributes
    ----------
    values : (S, I, J) float32
        Slices first; all of them slices of the scan.
    origin : (3,) int
        Source index ``(k, i, j)`` of the first pixel.
    """

    values: np.ndarray
    origin: np.ndarray


@dataclass(frozen=True, eq=False)
class Guide:
    """A plane across the slices on which the organ was drawn as well.

    Attributes
    ----------
    axis : int
        0 for a plane at one i, 1 for one at one j.
    index : int
        The source i or j at which it lies.
    inside : (S, L) bool
        What was drawn on it: source slices, and the other one of i and j.
    origin : (2,) int64
        Source slice, and source j or i, of its first pixel.
    """

    axis: int
    index: int
    inside: np.ndarray
    origin: np.ndarray

    @property
    def ends(self) -> np.ndarray:
        """First and last source ``(i, j)`` (2, 2) of what was drawn."""
        ends = np.full((2, 2), self.index, np.int64)
        ends[:, 1 - self.axis] = np.flatnonzero(self.inside.any(axis=0))[[0, -1]] + int(self.origin[1])
        return ends


@dataclass(frozen=True, eq=False)
class Annotation:
    """Which slices were drawn where not all of them were: the others are unknown, not empty.

    Attributes
    ----------
    slices : (D,) int64
        Source slices, ascending.
    guides : tuple of Guide
        Planes across the slices that were drawn besides.
    """

    slices: np.ndarray
    guides: tuple[Guide, ...] = ()

    @property
    def reach(self) -> np.ndarray | None:
        """First and last source ``(i, j)`` (2, 2) of what was drawn on planes across; None without any."""
        ends = np.array([guide.ends for guide in self.guides])
        return np.stack([ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)]) if self.guides else None

    @property
    def gaps(self) -> list[tuple[int, int]]:
        """The slice in the middle of each gap, and how many the gap has, the widest gap first."""
        count = np.diff(self.slices) - 1
        widest = [n for n in np.argsort(-count, kind="stable") if count[n] > 0]
        return [(int(self.slices[n] + (count[n] + 1) // 2), int(count[n])) for n in widest]


@dataclass
class Structure:
    """One organ of one case: what a row of the cohort sheet stands for.

    Arrays are cropped to the organ (with a margin) and keep the source volume's axis order.

    Attributes
    ----------
    case, organ : str
        The wildcards.
    frame : Frame
        The grid of the *source* volume, not of the crop.
    origin : (3,) int
        Source index of the crop's first voxel.
    image : (a, b, c) float32 or None
        Grey values (HU for CT).
    mask : (a, b, c) bool or None
        Ground truth of a structure with a region or boundary maps, the organ itself otherwise.
    probability : (a, b, c) float32 or None
        How probably a voxel is the organ, 0 beyond the scan; the mask is where it is one half or more.
    region : (a, b, c) bool or None
        Where a threshold found the organ in the image; its boundary is sought in the image's edges near by.
        Replaces the mask as the input.
    boundary : (a, b, c) bool or None
        Boundary maps that still need ordering; replaces the mask as the input.
    contours : Curves or None
        Curves that came ordered (RTSTRUCT); replaces the mask as the input.
    annotation : Annotation or None
        Where only some slices were drawn: which, and the planes drawn across them; mask or contours then know
        nothing of the other slices.
    truth : Mesh or None
        Analytic surface of a phantom as a fine closed triangle mesh in mm RAS.
    provenance : dict
        Source files with SHA-256, versions, settings: plain JSON values.
    warnings : list of str
        What the reader noticed and the report should show.
    """

    case: str
    organ: str
    frame: Frame
    origin: np.ndarray
    image: np.ndarray | None = None
    mask: np.ndarray | None = None
    probability: np.ndarray | None = None
    region: np.ndarray | None = None
    boundary: np.ndarray | None = None
    contours: Curves | None = None
    annotation: Annotation | None = None
    truth: Mesh | None = None
    provenance: dict[str, Any] = field(default_factory=dict[str, Any])
    warnings: list[str] = field(default_factory=list[str])

    def stack(self, name: str) -> np.ndarray | None:
        """One of the arrays, by its name, as a contiguous stack (S, I, J), slices first."""
        array = getattr(self, name)
        if array is None:
            return None
        return np.ascontiguousarray(np.moveaxis(array, self.frame.slice_axis, 0))

    def required_stack(self, name: str) -> np.ndarray:
        """`stack`, where it is required.

        Raises
        ------
        InputError
            The structure has no array of that name.
        """
        stack = self.stack(name)
        if stack is None:
            raise InputError(
                f"{self.case}/{self.organ}", f"there is no {name}", f"name the {name} in the sheet"
            )
        return stack

    @property
    def probability_stack(self) -> ProbabilityStack | None:
        """The probabilities on the scan's slices; None where there are none."""
        stack = self.stack("probability")
        if stack is None:
            return None
        first, count = int(self.stack_origin[0]), self.frame.shape[self.frame.slice_axis]
        inside = slice(max(0, -first), min(len(stack), count - first))
        return ProbabilityStack(stack[inside], self.stack_origin + np.array([inside.start, 0, 0]))

    @property
    def input(self) -> str:
        """The attribute that the surface is made from; it says how contours are found.

        Raises
        ------
        InputError
            There is nothing but an image.
        """
        for name in ("contours", "boundary", "region"):
            if getattr(self, name) is not None:
                return name
        self.required_stack("mask")
        return "mask"

    @property
    def affine(self) -> np.ndarray:
        """Affine (4, 4) from the indices of the structure's arrays to mm RAS."""
        affine = np.array(self.frame.affine, float)
        affine[:3, 3] += affine[:3, :3] @ self.origin
        return affine

    @property
    def voxels(self) -> np.ndarray:
        """What stands for the organ, on the grid of the structure's arrays (a, b, c): contours are filled.

        Raises
        ------
        InputError
            There is nothing but an image.
        """
        source = self.contours
        if source is None:
            return getattr(self, self.input)
        image = self.stack("image")
        if image is not None:
            a, b, c = image.shape
        else:  # what the image would be cropped to: as much beyond the contours as before them
            margin = int(source.slice.min() - self.stack_origin[0])
            last = np.array([source.slice.max(), *np.ceil(source.points.max(axis=0))]).astype(int)
            a, b, c = (int(n) + 1 + margin for n in last - self.stack_origin)
        return np.moveaxis(source.rasterise(self.stack_origin, (a, b, c)), 0, self.frame.slice_axis)

    def sections(self, curves: Curves) -> Sections:
        """Combine curves of the structure with what else it knows of its slices."""
        is_mask = self.input == "mask" and self.probability is None
        mask = self.stack("mask") if is_mask else None
        return Sections(curves, mask, self.stack_origin, self.annotation, self.probability_stack)

    @property
    def stack_origin(self) -> np.ndarray:
        """Source index ``(k, i, j)`` of ``stack(...)[0, 0, 0]``."""
        return np.asarray(self.origin)[[self.frame.slice_axis, *self.frame.in_plane_axes]]


@dataclass(eq=False)
class Boundaries:
    """Boundary pixels per slice, unordered and ragged.

    ``points[offsets[s]:offsets[s + 1]]`` are the integer pixels ``(i, j)`` of source slice
    ``slice[s]``, in raster order. Slices without pixels are left out.
    """

    points: np.ndarray  # (P, 2) int32
    offsets: np.ndarray  # (S + 1,) int64
    slice: np.ndarray  # (S,) int32, ascending
    frame: Frame

    def __len__(self) -> int:
        return len(self.slice)

    def __iter__(self) -> Iterator[np.ndarray]:
        return iter(split_ragged(self.points, self.offsets))


@dataclass
class Curves:
    """Ordered closed simple curves, ragged; the first point is not repeated.

    Outer curves and holes of a slice are separate curves. Orientation: outer curves counter-clockwise
    in (i, j) (positive shoelace area), holes clockwise. ``uncertainty``, of curves that the junction network
    ordered, is the probability that the curves of their slice are wrong.
    """

    points: np.ndarray  # (P, 2) float64, source (i, j)
    offsets: np.ndarray  # (C + 1,) int64
    slice: np.ndarray  # (C,) int32, ascending
    hole: np.ndarray  # (C,) bool
    frame: Frame
    uncertainty: np.ndarray | None = None  # (C,) float

    def __len__(self) -> int:
        return len(self.slice)

    def __iter__(self) -> Iterator[np.ndarray]:
        return iter(split_ragged(self.points, self.offsets))

    @property
    def polygons(self) -> RaggedPolygons:
        """The curves without their slices; the same arrays."""
        return RaggedPolygons(self.points, self.offsets)

    def rasterise(self, origin: Sequence[int] | np.ndarray, shape: tuple[int, int, int]) -> np.ndarray:
        """Pixels whose centres lie in or on the curves of their slice (even-odd rule, so holes are holes).

        Parameters
        ----------
        origin : (3,) int
            Source index ``(k, i, j)`` of the stack's first pixel (`Structure.stack_origin`).
        shape : (S, I, J)
            Shape of the stack; parts of the curves outside it are cut off.

        Returns
        -------
        (S, I, J) bool array
        """
        k, i, j = (int(index) for index in origin)
        moved = RaggedPolygons(self.points - (i, j), self.offsets)
        return rasterise_layers(moved, np.asarray(self.slice, np.int64) - k, shape)


@dataclass
class Splines:
    """Closed B-splines, one per curve of a `Curves`, ragged.

    A closed spline keeps its n control points unwrapped and ``n + 2 * degree + 1`` knots, so that
    ``BSpline(knots, np.vstack([c, c[:degree]]), degree)`` evaluates it on
    ``[knots[degree], knots[-degree - 1]]``.
    """

    control_points: np.ndarray  # (N, 2) float64, source (i, j)
    offsets: np.ndarray  # (C + 1,) int64
    knots: np.ndarray  # (M,) float64
    knot_offsets: np.ndarray  # (C + 1,) int64
    slice: np.ndarray  # (C,) int32
    hole: np.ndarray  # (C,) bool
    degree: int
    frame: Frame

    def __len__(self) -> int:
        return len(self.slice)

    def __iter__(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield (control points (n, 2), knots (n + 2 * degree + 1,)) of every curve."""
        return zip(
            split_ragged(self.control_points, self.offsets),
            split_ragged(self.knots, self.knot_offsets),
            strict=True,
        )

    def sample(self, per_pixel: float = 2.0) -> Curves:
        """Draw them as closed polygons: so many points per pixel of control polygon, 4 per control point."""
        length = RaggedPolygons(self.control_points, self.offsets).lengths
        counts = np.maximum(np.ceil(per_pixel * length), 4 * np.diff(self.offsets)).astype(np.int64)
        parts = [np.zeros((0, 2))]
        for (control, knots), count in zip(self, map(int, counts), strict=True):
            begin, end = float(knots[self.degree]), float(knots[-self.degree - 1])
            parts.append(evaluate_spline(knots, control, begin + (end - begin) * np.arange(count) / count))
        return Curves(np.concatenate(parts), offsets_of(counts), self.slice, self.hole, self.frame)


@dataclass
class FittedCurves:
    """Ordered curves and the few points that describe them: what ``curves.h5`` holds.

    Attributes
    ----------
    curves : Curves
    codes : (P,) uint8
        Freeman codes 0..7 of the link from each point to its successor, on the curves' offsets; empty when
        the curves do not run from pixel to pixel (drawn contours), for then there are none.
    corners : (K, 2) float64
        Corner points (Definition 3), source (i, j).
    corner_offsets : (C + 1,) int64
        Where each curve's corners begin.
    splines : Splines
        One closed spline per curve.
    report : dict
        Plain JSON about the fit.
    """

    curves: Curves
    codes: npt.NDArray[np.uint8]
    corners: npt.NDArray[np.float64]
    corner_offsets: npt.NDArray[np.int64]
    splines: Splines
    report: dict[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True, eq=False)
class Sections:
    """Everything about an organ's slices that its surface is lofted from.

    Attributes
    ----------
    curves : Curves
        Closed simple curves, outlines and holes. Those through pixel centres stand for the pixels, whose
        border lies half a pixel further out; any others are the border itself.
    mask : (S, I, J) bool or None
        The mask of which the curves are the borders: its pixels are known better by themselves, also where
        they are one pixel wide.
    mask_origin : (3,) int64 or None
        Source index (k, i, j) of its first voxel.
    annotation : Annotation or None
        Where only some slices were drawn: the surface is continued between them however far apart they lie,
        and follows planes that were drawn across them.
    probability : ProbabilityStack or None
        Probabilities of which the curves are the level: where they are flat, the error band is wider.
    """

    curves: Curves
    mask: np.ndarray | None = None
    mask_origin: np.ndarray | None = None
    annotation: Annotation | None = None
    probability: ProbabilityStack | None = None
