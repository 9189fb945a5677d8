"""The scale of the error at a vertex, by a small network on its signs."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from cccd.geometry.arrays import FloatArray, SingleArray

__all__ = ["Scale", "shipped_scale"]

#: Weights that `cccd_training.bands` wrote, and their SHA-256: the workflow lofts again when they change.
WEIGHTS = Path(__file__).with_name("scale.npz")
WEIGHTS_SHA256 = "6d36137ee54622e88996ed34cf37b1bf1324d3855f7a693cbdeacba656e68fbe"
#: Signs further than this many standard deviations from their mean count as that far.
FARTHEST = 4.0


@dataclass(frozen=True, eq=False)
class Scale:
    """Layers with hyperbolic tangents between them.

    Attributes
    ----------
    mean, spread : (F,) float32
        Of the signs that it was trained on.
    layers : tuple of ((A, B) float32, (B,) float32)
        Matrix and offsets of each layer; the last has one output, the scale's logarithm in pixels.
    name : str
        SHA-256 of the weights: factors hold for one scale only.
    """

    mean: SingleArray
    spread: SingleArray
    layers: tuple[tuple[SingleArray, SingleArray], ...]
    name: str

    def __call__(self, signs: FloatArray | SingleArray) -> FloatArray:
        """Return the scale (V,) in pixels at signs (V, F)."""
        values = np.clip((signs.astype(np.float32) - self.mean) / self.spread, -FARTHEST, FARTHEST)
        for number, (matrix, offsets) in enumerate(self.layers):
            values = (np.tanh(values) if number else values) @ matrix + offsets
        return np.exp(values[:, 0]).astype(float)


@cache
def shipped_scale(path: Path = WEIGHTS) -> Scale:
    """Read the trained weights."""
    content = path.read_bytes()
    with np.load(path) as file:
        count = sum(name.startswith("matrix") for name in file)
        layers = tuple((file[f"matrix{n}"], file[f"offsets{n}"]) for n in range(count))
        return Scale(file["mean"], file["spread"], layers, hashlib.sha256(content).hexdigest())
