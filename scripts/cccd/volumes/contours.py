"""From drawn contours (RTSTRUCT) to ordered curves, without rasterising them."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from itertools import combinations

import numpy as np
import shapely
from scipy.spatial.transform import Rotation

from cccd.containers import Curves, Frame
from cccd.errors import InputError
from cccd.geometry.arrays import concatenate_ragged
from cccd.tolerances import CONTOUR_AREA, CONTOUR_PLANE, SAME_PLANE_MM, SAME_POINT_VOXELS, SLICE_DIRECTION
from cccd.volumes.grid import Volume

__all__ = ["assemble_contours", "contour_frame", "plane_normal"]


def plane_normal(contours: list[np.ndarray], location: str) -> np.ndarray:
    """Find the unit normal (3,) of the parallel planes that contours (n, 3) lie in.

    Raises
    ------
    InputError
        The contours do not lie in parallel planes.
    """
    centred = np.concatenate([contour - contour.mean(axis=0) for contour in contours])
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    normal = axes[-1]
    normal = normal * np.sign(normal[np.abs(normal).argmax()])
    flat, wide = np.abs(centred @ normal).max(), np.abs(centred @ axes[0]).max()
    if flat > SLICE_DIRECTION * wide:
        raise InputError(location, "its contours do not lie in parallel planes", "export planar contours")
    return normal


def _plane_heights(contours: list[np.ndarray], normal: np.ndarray, location: str) -> tuple[np.ndarray, float]:
    """Heights (P,) of the planes along the normal, ascending, and their even spacing, mm."""
    heights = np.sort([float(np.mean(contour @ normal)) for contour in contours])
    heights = heights[np.r_[True, np.diff(heights) > SAME_PLANE_MM]]
    if len(heights) < 2:
        raise InputError(location, "its contours lie in one plane", "give an organ of three slices or more")
    gaps = np.diff(heights)
    steps = np.rint(gaps / gaps.min())
    spacing = float(gaps.sum() / steps.sum())
    if np.abs(gaps / spacing - steps).max() > CONTOUR_PLANE:
        raise InputError(
            location,
            f"its contours lie in unevenly spaced planes ({gaps.min():g} to {gaps.max():g} mm apart)",
            "draw or interpolate them on every slice",
        )
    return heights, spacing


def contour_frame(
    contours: list[np.ndarray], image: Volume | None, location: str, pixel_mm: float
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

    Returns
    -------
    frame : Frame
        The image's grid; when contours were drawn on every n-th slice only, every n-th slice of it; without
        an image, or when the planes are not slices of it, a grid through the contours' own planes.
    keep : slice or None
        The image's slices that the frame has; None when the image does not lie on the frame.
    warnings : list of str
        What was found on the way.

    Raises
    ------
    InputError
        Planes that are not parallel, not the image's, unevenly spaced, or fewer than two.
    """
    normal = plane_normal(contours, location)
    heights, spacing = _plane_heights(contours, normal, location)
    if image is None:
        axis = int(np.abs(normal).argmax())
        turn = Rotation.align_vectors([normal], [np.eye(3)[axis]])[0].as_matrix()
        affine = np.eye(4)
        affine[:3, :3] = turn * pixel_mm
        local = np.concatenate(contours) @ turn / pixel_mm
        low, high = np.floor(local.min(axis=0)), np.ceil(local.max(axis=0))
        affine[:3, 3] = affine[:3, :3] @ low
        shape = (high - low).astype(int) + 1
        note = f"{location}: no image given, pixels of {pixel_mm:g} mm assumed"
        return _through_planes(affine, axis, shape, normal, heights, spacing), None, [note]
    columns = image.affine[:3, :3] / np.linalg.norm(image.affine[:3, :3], axis=0)
    axis = int(np.abs(normal @ columns).argmax())
    if abs(normal @ columns[:, axis]) < 1 - SLICE_DIRECTION:
        raise InputError(
            location, "its contours are not parallel to the image's slices", "give the right image"
        )
    index = (heights - image.affine[:3, 3] @ normal) / (image.affine[:3, axis] @ normal)
    whole = np.rint(index).astype(int)
    inside = whole.min() >= 0 and whole.max() < image.data.shape[axis]
    if not inside or np.abs(index - whole).max() > CONTOUR_PLANE:
        grid = image.location
        note = f"{location}: its contours do not lie on the slices of {grid}, whose grey values are left out"
        shape = image.data.shape
        return _through_planes(image.affine, axis, shape, normal, heights, spacing), None, [note]
    stride = int(np.abs(np.diff(whole)).min())
    keep = slice(int(whole.min() % stride), None, stride)
    affine, shape = image.affine.copy(), list(image.data.shape)
    affine[:3, 3] += affine[:3, axis] * keep.start
    affine[:3, axis] *= stride
    shape[axis] = len(range(shape[axis])[keep])
    notes = [f"{location}: contours on every {stride}. slice of the image only"] if stride > 1 else []
    return Frame(affine, axis, tuple(shape)), keep, notes


def _through_planes(
    affine: np.ndarray,
    axis: int,
    shape: Sequence[int],
    normal: np.ndarray,
    heights: np.ndarray,
    spacing: float,
) -> Frame:
    """Move a grid's slices into the contours' planes, keeping its pixels.

    A slice more on either side says that the organ ends there, rather than being cut by the end of a scan.
    """
    affine, shape = affine.copy(), [int(n) for n in shape]
    upwards = affine[:3, axis] @ normal > 0
    affine[:3, axis] *= spacing / np.linalg.norm(affine[:3, axis])
    affine[:3, 3] += normal * (heights[0 if upwards else -1] - affine[:3, 3] @ normal) - affine[:3, axis]
    shape[axis] = int(np.rint((heights[-1] - heights[0]) / spacing)) + 3
    return Frame(affine, axis, (shape[0], shape[1], shape[2]))


def _rings(points: np.ndarray, location: str, where: str) -> list[np.ndarray]:
    """Part a contour that touches itself (a keyhole around a hole) into simple rings."""
    polygon = shapely.Polygon(points)
    if polygon.is_valid:
        return [points]
    repaired = shapely.make_valid(polygon)
    # a ring that crosses itself winds its loops in opposite senses: its signed area falls short
    x, y = points.T
    signed = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    if abs(repaired.area - signed) > CONTOUR_AREA * max(repaired.area, 1.0):
        raise InputError(location, f"a contour on {where} crosses itself", "mend it and export again")
    return [ring for ring, _ in _rings_of(repaired)]


def _rings_of(geometry: shapely.Geometry) -> list[tuple[np.ndarray, bool]]:
    """Rings (n, 2) of all polygons in a geometry, and whether each is a hole."""
    if hasattr(geometry, "geoms"):
        return [ring for part in geometry.geoms for ring in _rings_of(part)]
    if geometry.geom_type != "Polygon" or geometry.is_empty:
        return []
    rings = [(shapely.get_coordinates(geometry.exterior)[:-1], False)]
    return rings + [(shapely.get_coordinates(ring)[:-1], True) for ring in geometry.interiors]


def _nest(rings: list[np.ndarray], location: str, where: str) -> tuple[list[np.ndarray], list[bool], int]:
    """Tell outer rings from holes by the even-odd rule; gives the rings, the holes, and doubles dropped."""
    polygons = [shapely.Polygon(ring) for ring in rings]
    doubles = set()
    for first, second in combinations(range(len(rings)), 2):
        a, b = polygons[first], polygons[second]
        if not a.intersects(b):
            continue
        shared, small, large = a.intersection(b).area, *sorted((a.area, b.area))
        if shared > (1 - CONTOUR_AREA) * large:
            doubles.add(second)
        elif CONTOUR_AREA * small < shared < (1 - CONTOUR_AREA) * small:
            raise InputError(location, f"contours on {where} cross each other", "mend them and export again")
    kept = [n for n in range(len(rings)) if n not in doubles]
    inner = [polygons[n].representative_point() for n in kept]
    around = [
        sum(polygons[m].contains(point) for m in kept if polygons[m].area > polygons[n].area)
        for n, point in zip(kept, inner, strict=True)
    ]
    holes = [count % 2 == 1 for count in around]
    return [rings[n] for n in kept], holes, len(doubles)


def assemble_contours(rois: list[list[np.ndarray]], frame: Frame, location: str) -> tuple[Curves, list[str]]:
    """Make ordered curves of drawn contours.

    Parameters
    ----------
    rois : list of list of (n, 3) float64
        World mm (RAS); several ROIs are united.
    frame : Frame
        See `contour_frame`.
    location : str
        What messages name.

    Returns
    -------
    Curves
        Simple closed curves, holes by nesting (even-odd), oriented as `Curves` asks.
    warnings : list of str
        Contours without area and doubled ones that were dropped; slices without contours in between.

    Raises
    ------
    InputError
        Contours that cross themselves or each other.
    """
    inverse = np.linalg.inv(frame.stack_affine)
    slices: dict[int, list[list[np.ndarray]]] = {}
    flat = doubled = 0
    for number, contours in enumerate(rois):
        for contour in contours:
            index = contour @ inverse[:3, :3].T + inverse[:3, 3]
            steps = np.diff(index[:, :2], axis=0, append=index[:1, :2])
            points = index[:, :2][np.abs(steps).max(axis=1) > SAME_POINT_VOXELS]
            k = int(np.rint(index[:, 2].mean())) if len(index) else 0
            if len(points) < 3 or shapely.MultiPoint(points).convex_hull.area < SAME_POINT_VOXELS:
                flat += 1
                continue
            rings = slices.setdefault(k, [[] for _ in rois])
            rings[number] += _rings(points, location, f"slice {k}")
    curves, ks, holes = [], [], []
    for k in sorted(slices):
        nested = [_nest(rings, location, f"slice {k}") for rings in slices[k] if rings]
        doubled += sum(count for _, _, count in nested)
        rings, is_hole = nested[0][:2] if len(nested) == 1 else _unite([rings for rings, _, _ in nested])
        for ring, hole in zip(rings, is_hole, strict=True):
            x, y = ring.T
            positive = x @ np.roll(y, -1) - y @ np.roll(x, -1) > 0
            curves.append(ring if positive != hole else ring[::-1])
            ks.append(k)
            holes.append(hole)
    if not curves:
        raise InputError(location, "none of its contours encloses an area", "choose another ROI")
    points, offsets = concatenate_ragged(curves)
    empty = ks[-1] - ks[0] + 1 - len(set(ks))
    warnings = [f"{location}: {flat} contours without area left out"] if flat else []
    warnings += [f"{location}: {doubled} contours drawn twice taken once"] if doubled else []
    warnings += [f"{location}: no contour on {empty} slices between the first and the last"] if empty else []
    return Curves(points, offsets, np.array(ks, np.int32), np.array(holes, bool), frame), warnings


def _unite(nested: list[list[np.ndarray]]) -> tuple[list[np.ndarray], list[bool]]:
    """Union of several ROIs' rings on one slice: its rings and whether they are holes."""
    regions = [
        functools.reduce(shapely.symmetric_difference, map(shapely.Polygon, rings)) for rings in nested
    ]
    rings, holes = zip(*_rings_of(shapely.union_all(regions)), strict=True)
    return list(rings), list(holes)
