"""The network that fills between slices, in plain NumPy: convolutions on the nodes near the surface."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from cccd.geometry.arrays import BoolArray, IntArray, SingleArray

__all__ = ["FARTHEST", "PARTS", "FillingNetwork", "shipped_network"]

#: The trained weights.
WEIGHTS = Path(__file__).with_name("weights.npz")
#: Their SHA-256: the workflow lofts again when this file changes, so with other weights it must change.
WEIGHTS_SHA256 = "264cb86c82be0a7bd000bfc4f713b341a9c60340b3efe47b88bd04dba84ac170"
#: Distances beyond this many nodes say no more than their sign.
FARTHEST = 3.0
#: Parts of a node, along either axis of the plane, and of a slice distance that have a correction each.
PARTS = (2, 2, 4)


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
        """Read weights that `cccd.filling_training` wrote."""
        with np.load(path) as file:
            layers = sum(name.startswith("kernel") for name in file)
            return cls(
                [file[f"kernel{n}"] for n in range(layers)],
                [file[f"bias{n}"] for n in range(layers)],
                file["head"],
                file["head_bias"],
            )

    def corrections(self, distance: SingleArray, ratio: float, pixel: float) -> SingleArray:
        """Corrections (2 A, 2 B, 4 S) of distances (A, B, S), all in nodes.

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
        at = np.argwhere(near)
        number = np.full(np.array(distance.shape) + 2, len(at), np.int64)
        number[tuple((at + 1).T)] = np.arange(len(at))
        offsets = np.stack(np.meshgrid(*[range(3)] * 3, indexing="ij"), -1).reshape(-1, 3)
        neighbours = np.stack([number[tuple((at + offset).T)] for offset in offsets])
        value = distance[near]
        features = np.column_stack(
            [
                np.clip(value, -2, 2),
                np.tanh(3 * value),
                np.full(len(at), ratio - 2),
                np.full(len(at), 2 * pixel - 1),
            ]
        ).astype(np.float32)
        hidden = np.maximum(_convolved(features, neighbours, self.kernels[0]) + self.biases[0], 0)
        for kernel, bias in zip(self.kernels[1:], self.biases[1:], strict=True):
            hidden = hidden + np.maximum(_convolved(hidden, neighbours, kernel) + bias, 0)
        out = np.zeros((*distance.shape, *PARTS), np.float32)
        out[near] = (hidden @ self.head + self.head_bias).reshape(-1, *PARTS)
        a, b, s = distance.shape
        return out.transpose(0, 3, 1, 4, 2, 5).reshape(2 * a, 2 * b, 4 * s)


def _near_surface(distance: SingleArray) -> BoolArray:
    """Nodes within two of a change of sign."""
    inside = distance < 0
    crossed = maximum_filter(inside, 3, mode="nearest") != minimum_filter(inside, 3, mode="nearest")
    return maximum_filter(crossed, 3, mode="nearest")


def _convolved(values: SingleArray, neighbours: IntArray, kernel: SingleArray) -> SingleArray:
    """Convolve values (N, C) of nodes whose 27 neighbours (27, N) are numbered; N stands for none."""
    padded = np.concatenate([values, np.zeros((1, values.shape[1]), np.float32)])
    out = np.zeros((len(values), kernel.shape[2]), np.float32)
    for around, weight in zip(neighbours, kernel, strict=True):
        out += padded[around] @ weight
    return out


@cache
def shipped_network() -> FillingNetwork:
    """Return the network that comes with the package."""
    return FillingNetwork.load(WEIGHTS)
