"""Learned filling: what lies between slices and below their pixels.

Interpolating the slices' distances gives a surface that runs straight from slice to slice, and on coarse
pixels follows their steps. A small network, which has seen many random smooth, rough, plate-like and
branching bodies cut into slices, predicts by how much the true signed distance differs from that
(`cccd_training.filling` made the bodies and trained it). It works on a grid of about half the slice distance,
whatever the scan's voxels are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import map_coordinates

from cccd.filling.network import FARTHEST, PARTS, shipped_network
from cccd.geometry.arrays import SingleArray

__all__ = ["Filling", "fill_between_slices"]

#: The network's grid has so many nodes per slice distance in the plane, where pixels allow it.
NODES_PER_STEP = 2
#: The surface moves by at most so many nodes on a slice, and by so many more per slice distance away from it.
MOST_MOVED, MOST_MOVED_BETWEEN = 1.0, 3.0
#: The finest pixel, in nodes, that the network was trained with.
FINEST = 0.25
#: Empty slices below the first and above the last.
BEYOND = 2


@dataclass(frozen=True, eq=False)
class Filling:
    """The field of distances through a stack of slices: linear between them, and corrected.

    Attributes
    ----------
    slices : (S, I, J) float32
        In-plane signed distances in mm, as far as the network looks at them.
    corrections : (4 C, 2 A, 2 B) float32
        mm, on quarters of a slice distance and halves of a node in the plane.
    every : int
        Pixels per node.
    node : float
        mm between nodes.
    """

    slices: SingleArray
    corrections: SingleArray
    every: int
    node: float

    def field(self, at: float) -> SingleArray:
        """Signed distances (I, J) in mm, ``at`` slice distances above the first slice."""
        low = min(int(at), len(self.slices) - 1)
        high, share = min(low + 1, len(self.slices) - 1), np.float32(at - low)
        most = self.node * (MOST_MOVED + MOST_MOVED_BETWEEN * float(min(share, 1 - share)))
        moved = np.clip(self._correction(at), -most, most)
        return (1 - share) * self.slices[low] + share * self.slices[high] + moved

    def _correction(self, at: float) -> SingleArray:
        """Corrections (I, J) at the pixels, ``at`` slice distances above the first slice."""
        height = PARTS[2] * (at + BEYOND)
        below = int(height)
        share = np.float32(height - below)
        plane = (1 - share) * self.corrections[below] + share * self.corrections[below + 1]
        i, j = (PARTS[0] * (1 + np.arange(size) / self.every) for size in self.slices.shape[1:])
        at_pixels = np.meshgrid(i, j, indexing="ij")
        return map_coordinates(plane, at_pixels, np.float32, order=1, mode="nearest")


def fill_between_slices(
    distance: SingleArray, pixel: float, step: float, cut: tuple[bool, bool], of_pixels: bool
) -> Filling:
    """Predict what lies between slices.

    Parameters
    ----------
    distance : (S, I, J) float32
        In-plane signed distances of evenly spaced slices in mm.
    pixel, step : float
        mm.
    cut : (bool, bool)
        Whether the scan ends at the first and at the last slice: the organ goes on there.
    of_pixels : bool
        Whether the slices are known to a pixel only; drawn contours are known more finely than that.
    """
    every = max(1, round(step / (NODES_PER_STEP * pixel)))
    node = every * pixel
    known = 1 / every if of_pixels else min(1 / every, FINEST)
    nodes = np.clip(distance[:, ::every, ::every] / node, -FARTHEST, FARTHEST)
    nodes = np.pad(nodes, ((0, 0), (1, 1), (1, 1)), constant_values=FARTHEST)
    empty = np.full((BEYOND, *nodes.shape[1:]), FARTHEST, np.float32)
    low, high = (
        np.repeat(nodes[[end]], BEYOND, axis=0) if goes_on else empty
        for end, goes_on in zip((0, -1), cut, strict=True)
    )
    stack = np.ascontiguousarray(np.concatenate([low, nodes, high]).transpose(1, 2, 0), np.float32)
    corrections = np.float32(node) * shipped_network().corrections(stack, step / node, known)
    reach = FARTHEST * node
    return Filling(np.clip(distance, -reach, reach).astype(np.float32), corrections, every, node)
