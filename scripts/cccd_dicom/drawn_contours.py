"""From drawn contours (RTSTRUCT) to ordered curves, without rasterising them."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
import shapely
from scipy.spatial.transform import Rotation
from shapely.geometry.base import BaseGeometry, BaseMultipartGeometry

from cccd.containers import Curves, Frame
from cccd.errors import InputError
from cccd.geometry.arrays import AnyArray, FloatArray
from cccd.geometry.polygons import RaggedPolygons
from cccd.inputs.grid import Volume
from cccd_dicom.slices import CONTOUR_PLANE, SAME_PLANE_MM, SLICE_DIRECTION, even_grid

#: Contours run along pixels when this share of their steps are along an axis and whole numbers of pixels, or
#: cut corners at 45 degrees, each to this share of a pixel, and at least so many are along an axis.
TRACED, LEAST_STEPS, ALONG_AXIS = 0.95, 40, 0.02
#: Areas of drawn contours that agree to this share are equal.
_CONTOUR_AREA = 1e-3
#: Neighbouring points of a drawn contour nearer than this, in pixels, are one point.
_SAME_POINT_VOXELS = 1e-6


class _Planes(NamedTuple):
    """Parallel planes at multiples of a spacing, in world mm (RAS)."""

    normal: FloatArray  # (3,), of unit length
    heights: FloatArray  # (P,) along the normal, ascending; some multiples may be missing
    spacing: float
    margin: int  # multiples that planes are usually apart


def contour_frame(
    contours: list[FloatArray],
    image: Volume | None,
    location: str,
    pixel_mm: float,
    others: FloatArray | None = None,
) -> tuple[Frame, slice | None, list[str]]:
    """Choose the grid whose slices are the planes of the contours.

    Parameters
    ----------
    contours : list of (n, 3) float64
        World mm (RAS).
    image : Volume, optional
        The scan the contours were drawn on.
    location : str
        What messages name.
    pixel_mm : float
        Pixel size of the in-plane coordinates where there is no image.
    others : (N, 3) float64, optional
        A point of each contour in the file: its planes say how thick a slice is where there is no image.

    Returns
    -------
    frame : Frame
        The image's grid; when contours were drawn on every n-th slice only, every n-th slice of it; without
        an image, or when the planes are not slices of it, a grid through the contours' own planes.
    keep : slice or None
        The image's slices that the frame has; None when the image does not lie on the frame.
    warnings : list of str
        What was assumed or left out.

    Raises
    ------
    InputError
        Planes that are not parallel, or not the image's; contours along a line.
    """
    normal = _plane_normal(contours, location)
    axis = None if image is None else _slice_axis(image, normal, location)
    heights = _apart(np.array([float(np.mean(contour @ normal)) for contour in contours]))
    spacing = pixel_mm if image is None else abs(float(image.affine[:3, axis] @ normal))
    if others is not None and len(gaps := np.diff(_apart(others @ normal))):
        spacing = float(np.median(gaps))
    planes = _planes(heights, normal, spacing)
    if image is None or axis is None:
        frame, traced = _frame_without_image(contours, planes, pixel_mm)
        side = frame.spacing[frame.in_plane_axes[0]]
        why = "along whose edges its contours run" if traced else "assumed"
        notes = [f"{location}: no image given, pixels of {side:.3g} mm {why}"]
        if len(heights) == 1:
            notes.append(f"{location}: its contours lie in one plane, taken as {spacing:.3g} mm thick")
        return frame, None, notes
    index = (heights - image.affine[:3, 3] @ normal) / (image.affine[:3, axis] @ normal)
    whole = np.rint(index).astype(int)
    inside = whole.min() >= 0 and whole.max() < image.shape[axis]
    if not inside or np.abs(index - whole).max() > CONTOUR_PLANE:
        grid = image.location
        note = f"{location}: its contours do not lie on the slices of {grid}, whose grey values are not used"
        return _move_to_planes(image.affine, axis, image.shape, planes), None, [note]
    stride = int(np.abs(np.diff(whole)).min()) if len(whole) > 1 else 1
    keep = slice(int(whole.min() % stride), None, stride)
    notes = [f"{location}: only one in {stride} slices of the image has contours"] if stride > 1 else []
    return _frame_of_slices(image, axis, keep), keep, notes


def _plane_normal(contours: list[FloatArray], location: str) -> FloatArray:
    """Find the unit normal (3,) of the parallel planes that the contours lie in."""
    centred = np.concatenate([contour - contour.mean(axis=0) for contour in contours])
    axes = np.linalg.eigh(centred.T @ centred).eigenvectors
    normal = axes[:, 0] * np.sign(axes[np.abs(axes[:, 0]).argmax(), 0])
    flat, narrow, wide = np.abs(centred @ axes).max(axis=0)
    if narrow <= SLICE_DIRECTION * wide:  # along one line: any plane through it would do
        raise _without_area(location)
    if flat > SLICE_DIRECTION * wide:
        hint = "export planar contours; of planes in several directions run cccd surface on the RTSTRUCT file"
        raise InputError(location, "its contours do not lie in parallel planes", hint)
    return normal


def _apart(heights: FloatArray) -> FloatArray:
    """Heights (P,) in ascending order, of each plane one."""
    heights = np.sort(heights)
    return heights[np.r_[True, np.diff(heights) > SAME_PLANE_MM]]


def _planes(heights: FloatArray, normal: FloatArray, thickness: float) -> _Planes:
    """Planes at heights (P,) across a normal; of uneven distances, on a finer grid; of one, its thickness."""
    spacing, index = even_grid(heights) if len(heights) > 1 else (thickness, np.arange(2))
    return _Planes(normal, heights, spacing, int(np.median(np.diff(index))))


def _slice_axis(image: Volume, normal: FloatArray, location: str) -> int:
    """Axis of the image that runs along the planes' normal."""
    across = np.linalg.inv(image.affine[:3, :3])  # its rows are normals of the slices across each axis
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    axis = int(np.abs(across @ normal).argmax())
    if abs(across[axis] @ normal) < 1 - SLICE_DIRECTION:
        raise InputError(
            location, "its contours are not parallel to the image's slices", "give the right image"
        )
    return axis


def _frame_without_image(contours: list[FloatArray], planes: _Planes, pixel_mm: float) -> tuple[Frame, bool]:
    """Grid of square pixels through the contours' planes, as near to the world's axes as they allow.

    Their size is that of the pixels that the contours were traced along, and whether they were.
    """
    axis = int(np.abs(planes.normal).argmax())
    rotation = Rotation.align_vectors([planes.normal], [np.eye(3)[axis]])[0].as_matrix()
    traced = _traced_pixels([np.delete(contour @ rotation, axis, axis=1) for contour in contours])
    begin = np.zeros(3)
    if traced is not None:
        pixel_mm, edges = traced
        begin = np.insert(edges % 1 + 0.5, axis, 0)  # centres of pixels lie between their edges
    affine = np.eye(4)
    affine[:3, :3] = rotation * pixel_mm
    local = np.concatenate(contours) @ rotation / pixel_mm
    low = np.floor(local.min(axis=0) - begin) + begin
    high = np.ceil(local.max(axis=0) - begin) + begin
    affine[:3, 3] = affine[:3, :3] @ low
    return _move_to_planes(affine, axis, np.rint(high - low).astype(int) + 1, planes), traced is not None


def _traced_pixels(contours: list[FloatArray]) -> tuple[float, FloatArray] | None:
    """Size in mm of the pixels along whose edges contours (n, 2) run, and where edges lie (2,) in pixels.

    None where contours run otherwise. Along edges each step is as long as a whole number of pixels. Marching
    squares cut the corners between them at 45 degrees.
    """
    points = np.concatenate(contours)
    steps = np.concatenate([np.diff(contour, axis=0, append=contour[:1]) for contour in contours])
    moved = np.abs(steps).max(axis=1) > _SAME_POINT_VOXELS
    points, steps = points[moved], np.abs(steps[moved])
    aside, long = np.sort(steps, axis=1).T
    straight = aside < ALONG_AXIS * long
    if straight.sum() < LEAST_STEPS:
        return None
    pixel = round(float(np.percentile(long[straight], 5)), 4)
    whole = np.abs(long / pixel - np.rint(long / pixel)) < ALONG_AXIS * np.rint(long / pixel)
    along = straight & whole & (aside < ALONG_AXIS * pixel)
    if np.mean(along | (long - aside < ALONG_AXIS * pixel)) < TRACED:
        return None
    edges = [points[along & (steps[:, side] < steps[:, 1 - side])][0, side] / pixel for side in (0, 1)]
    return pixel, np.array(edges)


def _frame_of_slices(image: Volume, axis: int, keep: slice) -> Frame:
    """Reduce the image's grid to the slices ``keep`` (a start and a step) along ``axis`` only."""
    affine, shape = image.affine.copy(), list(image.shape)
    affine[:3, 3] += affine[:3, axis] * keep.start
    affine[:3, axis] *= keep.step
    shape[axis] = len(range(shape[axis])[keep])
    return Frame(affine, axis, (shape[0], shape[1], shape[2]))


def _move_to_planes(affine: FloatArray, axis: int, shape: Sequence[int] | AnyArray, planes: _Planes) -> Frame:
    """Move a grid's slices into the contours' planes, keeping its pixels."""
    # Empty slices on either side show that the organ ends there, rather than being cut by the scan's end.
    affine, sizes = affine.copy(), [int(n) for n in shape]
    normal, heights, spacing, margin = planes
    upwards = affine[:3, axis] @ normal > 0
    affine[:3, axis] *= spacing / abs(affine[:3, axis] @ normal)
    affine[:3, 3] += normal * (heights[0 if upwards else -1] - affine[:3, 3] @ normal)
    affine[:3, 3] -= margin * affine[:3, axis]
    sizes[axis] = int(np.rint((heights[-1] - heights[0]) / spacing)) + 1 + 2 * margin
    return Frame(affine, axis, (sizes[0], sizes[1], sizes[2]))


def assemble_contours(rois: list[list[FloatArray]], frame: Frame, location: str) -> tuple[Curves, list[str]]:
    """Make ordered curves of drawn contours.

    Parameters
    ----------
    rois : list of list of (n, 3) float64
        Contours of every region of interest, world mm (RAS); several regions are united.
    frame : Frame
        The grid of `contour_frame`.
    location : str
        What messages name.

    Returns
    -------
    curves : Curves
        Simple closed curves, holes by nesting (even-odd), oriented as `Curves` asks.
    warnings : list of str
        Contours without area and doubled ones that were left out; slices without contours in between.

    Raises
    ------
    InputError
        Contours that cross themselves or each other, or none that encloses an area.
    """
    slices, flat = _rings_by_slice(rois, frame, location)
    if not slices:
        raise _without_area(location)
    rings: list[FloatArray] = []
    ks: list[int] = []
    holes: list[bool] = []
    doubled = 0
    for k in sorted(slices):
        nested = [_nest(part, location, f"slice {k}") for part in slices[k]]
        united = nested[0] if len(nested) == 1 else _unite(nested)
        rings += united.rings
        holes += united.holes
        ks += [k] * len(united.rings)
        doubled += sum(part.doubles for part in nested)
    empty = ks[-1] - ks[0] + 1 - len(set(ks))
    warnings = [f"{location}: {flat} contours without area left out"] if flat else []
    warnings += [f"{location}: {doubled} contours are there twice; one of each is used"] if doubled else []
    warnings += [f"{location}: no contour on {empty} slices between the first and the last"] if empty else []
    hole = np.array(holes, bool)
    turned = (RaggedPolygons.of(rings).signed_areas > 0) == hole  # outlines run counter-clockwise
    polygons = RaggedPolygons.of([r[::-1] if turn else r for r, turn in zip(rings, turned, strict=True)])
    return Curves(polygons.points, polygons.offsets, np.array(ks, np.int32), hole, frame), warnings


def _without_area(location: str) -> InputError:
    """Error for a region of interest whose contours are all points and lines."""
    return InputError(location, "none of its contours encloses an area", "choose another ROI")


def _rings_by_slice(
    rois: list[list[FloatArray]], frame: Frame, location: str
) -> tuple[dict[int, list[list[FloatArray]]], int]:
    """Collect simple rings (n, 2) of every region by slice, and count contours without area."""
    inverse = np.linalg.inv(frame.stack_affine)
    slices: dict[int, dict[int, list[FloatArray]]] = {}
    flat = 0
    for number, contours in enumerate(rois):
        for contour in contours:
            index = contour @ inverse[:3, :3].T + inverse[:3, 3]
            steps = np.diff(index[:, :2], axis=0, append=index[:1, :2])
            points = index[:, :2][np.abs(steps).max(axis=1) > _SAME_POINT_VOXELS]
            k = int(np.rint(index[:, 2].mean())) if len(index) else 0
            rings = _simple_rings(points, location, f"slice {k}")
            if rings:
                slices.setdefault(k, {}).setdefault(number, []).extend(rings)
            else:
                flat += 1
    return {k: list(regions.values()) for k, regions in slices.items()}, flat


def _simple_rings(points: FloatArray, location: str, where: str) -> list[FloatArray]:
    """Split a contour (n, 2) that touches itself (a keyhole around a hole) into simple rings."""
    # No ring where it encloses no area.
    if len(points) < 3 or shapely.MultiPoint(points).convex_hull.area < _SAME_POINT_VOXELS:
        return []
    polygon = shapely.Polygon(points)
    if polygon.is_valid:
        return [points]
    repaired = shapely.make_valid(polygon)
    # a ring that crosses itself winds its loops in opposite senses: its signed area falls short
    area = abs(RaggedPolygons.of([points]).signed_areas[0])
    differs = abs(repaired.area - area) > _CONTOUR_AREA * max(repaired.area, 1.0)
    if differs and _crosses_itself(points):
        raise InputError(location, f"a contour on {where} crosses itself", "correct it and export again")
    return [ring for ring, _ in _rings_of(repaired)]


def _crosses_itself(points: FloatArray) -> bool:
    """Whether a closed contour (n, 2) passes through itself elsewhere than in points of its own."""
    # A keyhole does not, whichever way its hole was drawn.
    noded = shapely.get_coordinates(shapely.node(shapely.LinearRing(points)))
    return bool(set(map(tuple, noded)) - set(map(tuple, points)))


def _rings_of(geometry: BaseGeometry) -> list[tuple[FloatArray, bool]]:
    """Rings (n, 2) of all polygons in a geometry, and whether each is a hole."""
    if isinstance(geometry, BaseMultipartGeometry):
        return [ring for part in geometry.geoms for ring in _rings_of(part)]
    if not isinstance(geometry, shapely.Polygon) or geometry.is_empty:
        return []
    rings = [(shapely.get_coordinates(geometry.exterior)[:-1], False)]
    return rings + [(shapely.get_coordinates(ring)[:-1], True) for ring in geometry.interiors]


class _Nested(NamedTuple):
    """Rings of one slice."""

    rings: list[FloatArray]  # (n, 2) each
    holes: list[bool]
    doubles: int  # rings left out because they equal another


def _nest(rings: list[FloatArray], location: str, where: str) -> _Nested:
    """Separate outer rings from holes by the even-odd rule, and leave out rings drawn twice."""
    polygons = [shapely.Polygon(ring) for ring in rings]
    doubles = set()
    for first, second in combinations(range(len(rings)), 2):
        a, b = polygons[first], polygons[second]
        if not a.intersects(b):
            continue
        shared, small, large = a.intersection(b).area, *sorted((a.area, b.area))
        if shared > (1 - _CONTOUR_AREA) * large:
            doubles.add(second)
        elif _CONTOUR_AREA * small < shared < (1 - _CONTOUR_AREA) * small:
            raise InputError(
                location, f"contours on {where} cross each other", "correct them and export again"
            )
    kept = [n for n in range(len(rings)) if n not in doubles]
    inner = [polygons[n].representative_point() for n in kept]
    around = [
        sum(polygons[m].contains(point) for m in kept if polygons[m].area > polygons[n].area)
        for n, point in zip(kept, inner, strict=True)
    ]
    return _Nested([rings[n] for n in kept], [count % 2 == 1 for count in around], len(doubles))


def _unite(regions: list[_Nested]) -> _Nested:
    """Union of several regions of interest on one slice."""
    areas = [
        functools.reduce(shapely.symmetric_difference, map(shapely.Polygon, region.rings))
        for region in regions
    ]
    rings, holes = zip(*_rings_of(shapely.union_all(areas)), strict=True)
    return _Nested(list(rings), list(holes), 0)
