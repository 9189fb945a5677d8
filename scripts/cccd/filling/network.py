"""The network that fills between slices, in plain NumPy: convolutions on the nodes near the surface."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from cccd.geometry.arrays import BoolArray, LabelArray, SingleArray

__all__ = ["FARTHEST", "PARTS", "FillingNetwork", "shipped_network"]

#: The trained weights.
WEIGHTS = Path(__file__).with_name("weights.npz")
#: Their SHA-256: the workflow lofts again when this file changes, so with other weights it must change.
WEIGHTS_SHA256 = "264cb86c82be0a7bd000bfc4f713b341a9c60340b3efe47b88bd04dba84ac170"
#: Distances beyond this many nodes say no more than their sign.
FARTHEST = 3.0
#: Parts of a node, along either axis of the plane, and of a slice distance that have a correction each.
PARTS = (2, 2, 4)
#: Nodes that are convolved at once: what they see stays in the processor's cache.
BLOCK = 1024


@dataclass(frozen=True, eq=False)
class FillingNetwork:
    """Residual convolutions 3 x 3 x 3 on the nodes near the surface.

    Attributes
    ----------
    kernels : list of (27, channels in, channels out) float32
    biases : list of (channels out,) float32
    head, head_bias : (channels, 16) and (16,) float32
        Corrections at the parts of a node, in nodes.
    """

    kernels: list[SingleArray]
    biases: list[SingleArray]
    head: SingleArray
    head_bias: SingleArray

    @classmethod
    def load(cls, path: Path) -> FillingNetwork:
        """Read weights that `cccd_training.filling` wrote."""
        with np.load(path) as file:
            layers = sum(name.startswith("kernel") for name in file)
            return cls(
                [file[f"kernel{n}"] for n in range(layers)],
                [file[f"bias{n}"] for n in range(layers)],
                file["head"],
                file["head_bias"],
            )

    def corrections(self, distance: SingleArray, ratio: float, pixel: float) -> SingleArray:
        """Corrections (4 S, 2 A, 2 B) of distances (A, B, S), all in nodes.

        Parameters
        ----------
        distance : (A, B, S) float32
            In-plane signed distances at the grid's nodes, in nodes, cut off at `FARTHEST`.
        ratio : float
            Slice distance in nodes.
        pixel : float
            The scan's pixel in nodes: how finely the slices are known.
        """
        near = _near_surface(distance)
        neighbours = _neighbours(near)
        value = distance[near]
        features = np.column_stack(
            [
                np.clip(value, -2, 2),
                np.tanh(3 * value),
                np.full(len(value), ratio - 2),
                np.full(len(value), 2 * pixel - 1),
            ]
        ).astype(np.float32)
        hidden = np.maximum(_convolved(features, neighbours, self.kernels[0]) + self.biases[0], 0)
        for kernel, bias in zip(self.kernels[1:], self.biases[1:], strict=True):
            hidden = hidden + np.maximum(_convolved(hidden, neighbours, kernel) + bias, 0)
        parts = (hidden @ self.head + self.head_bias).reshape(-1, *PARTS)
        (a, b, s), (parts_i, parts_j, parts_k) = distance.shape, PARTS
        out = np.zeros((s, parts_k, a, parts_i, b, parts_j), np.float32)
        i, j, k = np.nonzero(near)
        out[k, :, i, :, j] = parts.transpose(0, 3, 1, 2)
        return out.reshape(parts_k * s, parts_i * a, parts_j * b)


def _near_surface(distance: SingleArray) -> BoolArray:
    """Nodes within two of a change of sign."""
    inside = distance < 0
    crossed = maximum_filter(inside, 3, mode="nearest") != minimum_filter(inside, 3, mode="nearest")
    return maximum_filter(crossed, 3, mode="nearest")


def _neighbours(near: BoolArray) -> LabelArray:
    """Numbers (N, 27) of the nodes around each of N, itself among them, in their order; N for none."""
    count = np.count_nonzero(near)
    within = np.pad(near, 1)
    number = np.full(within.shape, count, np.int32)
    number[within] = np.arange(count, dtype=np.int32)
    around = np.asarray(np.ravel_multi_index(np.indices((3, 3, 3)).reshape(3, -1), number.shape))
    middle = around[len(around) // 2]
    return number.ravel()[np.flatnonzero(within)[:, None] + (around - middle)]


def _convolved(values: SingleArray, neighbours: LabelArray, kernel: SingleArray) -> SingleArray:
    """Convolve values (N, C) of nodes whose 27 neighbours (N, 27) are numbered; N stands for none."""
    padded = np.concatenate([values, np.zeros((1, values.shape[1]), np.float32)])
    weights = kernel.reshape(-1, kernel.shape[2])
    out = np.empty((len(values), weights.shape[1]), np.float32)
    for start in range(0, len(values), BLOCK):
        block = slice(start, start + BLOCK)
        patches = np.take(padded, neighbours[block], axis=0)
        np.matmul(patches.reshape(-1, len(weights)), weights, out=out[block])
    return out


@cache
def shipped_network() -> FillingNetwork:
    """Return the network that comes with the package."""
    return FillingNetwork.load(WEIGHTS)
