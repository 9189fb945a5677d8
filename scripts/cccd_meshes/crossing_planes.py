"""One surface through contours in planes of any direction, which may cross each other.

In its own plane each set of contours is a signed distance. Off the planes the distances of all are averaged,
at the foot in each plane, with weights that fall with the distance from it (Shepard 1968): on a plane its own
contours alone count.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray, SingleArray
from cccd.geometry.distance import to_polygons
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.geometry.polygons import RaggedPolygons
from cccd.geometry.raster import rasterise
from cccd_dicom.slices import SAME_PLANE_MM, SLICE_DIRECTION

#: Nodes of the grid along the longest side of what was drawn; its surface is smoothed afterwards.
NODES = 128
#: Nodes around it, as an organ bulges between planes.
MARGIN = 12
#: Weights fall with this power of the distance from a plane: of 2, 3 and 4 the last was nearest to OReX's
#: elephant.
POWER = 4
#: Distances from a plane count as at least this share of a node's, so that weights are finite.
NEAREST = 0.25
#: Pixels of a plane's own distances, by the nodes' distance, and pixels around its contours.
PIXEL, BORDER = 0.5, 8


class DrawnPlane(NamedTuple):
    """Contours of one plane.

    Attributes
    ----------
    normal : (3,) float64
        Of unit length.
    rings : list of (n, 3) float64
        mm; by the even-odd rule, so holes are holes.
    """

    normal: FloatArray
    rings: list[FloatArray]

    @property
    def height(self) -> float:
        """Place of the plane along its normal."""
        return float(np.mean(np.concatenate(self.rings) @ self.normal))


def planes_of(contours: Sequence[FloatArray], location: str) -> list[DrawnPlane]:
    """Sort planar contours (n, 3) by the planes that they lie in.

    Raises
    ------
    InputError
        A contour that is not planar.
    """
    planes: list[DrawnPlane] = []
    for contour in contours:
        centred = contour - contour.mean(axis=0)
        axes = np.linalg.eigh(centred.T @ centred).eigenvectors
        flat, narrow, wide = np.abs(centred @ axes).max(axis=0)
        if narrow <= SLICE_DIRECTION * wide:
            continue  # a line has no plane of its own
        if flat > SLICE_DIRECTION * wide:
            raise InputError(location, "one of its contours is not planar", "export planar contours")
        normal = axes[:, 0]
        for plane in planes:
            same = abs(plane.normal @ normal) > 1 - SLICE_DIRECTION
            if same and abs(contour.mean(axis=0) @ plane.normal - plane.height) < SAME_PLANE_MM:
                plane.rings.append(contour)
                break
        else:
            planes.append(DrawnPlane(normal, [contour]))
    return planes


def surface_through(planes: Sequence[DrawnPlane], location: str) -> Mesh:
    """Make one closed mesh through the contours of planes.

    Parameters
    ----------
    planes : sequence of DrawnPlane
        Of two directions at least; parallel ones are lofted better.
    location : str
        What messages name.

    Raises
    ------
    InputError
        Fewer than three planes, or contours that enclose nothing.
    """
    if len(planes) < 3:
        count = f"{len(planes)} plane{'s'[: len(planes) != 1]}"
        raise InputError(location, f"it was drawn in {count}", "draw it in three planes or more")
    points = np.concatenate([ring for plane in planes for ring in plane.rings])
    low, high = points.min(axis=0), points.max(axis=0)
    step = float((high - low).max()) / NODES
    a, b, c = (int(n) + 2 * MARGIN for n in np.ceil((high - low) / step))
    low = low - MARGIN * step
    nodes: FloatArray = np.indices((a, b, c)).reshape(3, -1).T * step + low
    total, weights = np.zeros(len(nodes)), np.zeros(len(nodes))
    for plane in planes:
        weight = 1 / np.maximum(np.abs(nodes @ plane.normal - plane.height), NEAREST * step) ** POWER
        total += weight * _distances(plane, nodes, PIXEL * step)
        weights += weight
    field = np.asarray((total / weights).reshape(a, b, c), np.float32)
    if not (field < 0).any():
        raise InputError(location, "its contours enclose nothing", "check that they belong to one organ")
    for axis in range(3):  # nothing is open at the grid's border
        ends = np.moveaxis(field, axis, 0)
        ends[[0, -1]] = np.maximum(ends[[0, -1]], step)
    return ScalarGrid.uniform(field, low, step).isosurface(0.0).outwards()


def _distances(plane: DrawnPlane, nodes: FloatArray, pixel: float) -> SingleArray:
    """Signed distances (N,) in a plane, at the feet of nodes (N, 3) on it."""
    across = np.cross(plane.normal, np.eye(3)[np.abs(plane.normal).argmin()])
    across /= np.linalg.norm(across)
    axes = np.column_stack([across, np.cross(plane.normal, across)])
    rings = [ring @ axes / pixel for ring in plane.rings]
    corner = np.min([ring.min(axis=0) for ring in rings], axis=0) - BORDER
    last = np.ceil(np.max([ring.max(axis=0) for ring in rings], axis=0) - corner).astype(int) + BORDER
    polygons = RaggedPolygons.of([ring - corner for ring in rings])
    inside = rasterise(polygons, (0, 0), (int(last[0]), int(last[1])))
    in_mm = RaggedPolygons(polygons.points * pixel, polygons.offsets)
    distance = to_polygons(inside, in_mm, np.full(2, pixel))
    place = nodes @ axes / pixel - corner
    nearest = np.clip(place, 0, np.array(inside.shape) - 1)
    beyond = pixel * np.linalg.norm(place - nearest, axis=1)
    return ndimage.map_coordinates(distance, nearest.T, order=1, mode="nearest") + np.float32(1) * beyond
