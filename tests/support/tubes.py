"""Tubes around curves, whose lengths, radii and angles are known, as masks on grids of any spacing."""

import numpy as np
from scipy.spatial import cKDTree

#: Points of a curve lie so near to each other, mm.
FINE = 0.05


class Tube:
    """A curve (n, 3) in mm with a radius at each of its points; its ends are flat, or round."""

    def __init__(self, curve, radius, flat=True):
        gone = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
        at = np.linspace(0, gone[-1], int(gone[-1] / FINE) + 2)
        self.length = gone[-1]
        self.curve = np.column_stack([np.interp(at, gone, axis) for axis in np.transpose(curve)])
        self.radius = np.interp(at, gone, np.broadcast_to(radius, len(curve)))
        self.flat = flat

    def holds(self, points):
        away, nearest = cKDTree(self.curve).query(points, distance_upper_bound=self.radius.max() + 1)
        inside = np.isfinite(away)
        inside[inside] = away[inside] <= self.radius[nearest[inside]]
        if self.flat:
            ways = (self.curve[0] - self.curve[1], self.curve[-1] - self.curve[-2])
            for end, way in zip((self.curve[0], self.curve[-1]), ways, strict=True):
                near = np.linalg.norm(points - end, axis=1) < 2 * self.radius.max()
                inside &= ~(near & ((points - end) @ way > 0))
        return inside


def straight(start, end, radius, flat=True):
    return Tube(np.linspace(start, end, 50), radius, flat)


def voxels(tubes, spacing, margin=4):
    """Mask and affine of the union of tubes, on a grid that is off by part of a voxel."""
    spacing = np.array(spacing, float)
    low = np.min([(t.curve - t.radius.max()).min(axis=0) for t in tubes], axis=0) - margin * spacing
    high = np.max([(t.curve + t.radius.max()).max(axis=0) for t in tubes], axis=0) + margin * spacing
    low = low - spacing * (0.31, 0.17, 0.43)
    shape = np.ceil((high - low) / spacing).astype(int) + 1
    affine = np.diag([*spacing, 1.0])
    affine[:3, 3] = low
    points = np.moveaxis(np.indices(shape), 0, -1).reshape(-1, 3) * spacing + low
    inside = np.zeros(len(points), bool)
    for tube in tubes:
        inside |= tube.holds(points)
    return inside.reshape(shape), affine


def helix(radius=18.0, pitch=30.0, turns=1.5, tube=4.0):
    angle = np.linspace(0, 2 * np.pi * turns, 2000)
    return Tube(
        np.column_stack([radius * np.cos(angle), radius * np.sin(angle), pitch * angle / 2 / np.pi]), tube
    )


def turned(degrees):
    """Unit vector in the x-z plane, so many degrees from z."""
    return np.array([np.sin(np.radians(degrees)), 0, np.cos(np.radians(degrees))])
