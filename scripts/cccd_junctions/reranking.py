"""Which of a slice's alternative labellings is right: a small network that looks at each as a whole.

As in re-ranking the best parses of a sentence (Collins and Koo 2005) or diverse segmentations of an image
(Yadollahpour, Batra and Shakhnarovich 2013): the energy proposes, and what no sum over triangles and links
can say decides. `cccd_training.junctions.reranker` trained it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, cast

import numpy as np

from cccd.geometry.arrays import RealArray, SingleArray
from cccd_junctions.alternatives import FEATURES
from cccd_junctions.uncertainty import FACTS

#: The trained weights.
WEIGHTS = Path(__file__).with_name("reranker.npz")
#: Their SHA-256: the workflow orders slices again when this file changes, so it must change with them.
WEIGHTS_SHA256 = "26bfacfb4e1ed2d6148a46738da8f13af8075a9ce64791178cb83fe6cc24e052"
#: Features count up to so many standard deviations.
FARTHEST = 5.0


@dataclass(frozen=True, eq=False)
class Reranker:
    """A perceptron with rectified layers.

    Attributes
    ----------
    mean, spread : (F,) float32
        Of the features (`cccd_junctions.alternatives.FEATURES`) among those trained on.
    weights : list of (channels in, channels out) float32
    biases : list of (channels out,) float32
    doubt : (4,) float32
        Weights of `cccd_junctions.uncertainty.FACTS`, and the log odds of error without them.
    """

    mean: SingleArray
    spread: SingleArray
    weights: list[SingleArray]
    biases: list[SingleArray]
    doubt: SingleArray = field(default_factory=lambda: np.zeros(len(FACTS) + 1, np.float32))

    @classmethod
    def load(cls, path: Path) -> Reranker:
        """Read weights that `save` wrote."""
        with np.load(path) as file:
            layers = range(sum(name.startswith("weight") for name in file))
            weights, biases = ([file[f"{name}{n}"] for n in layers] for name in ("weight", "bias"))
            return cls(file["mean"], file["spread"], weights, biases, file["doubt"])

    def save(self, path: Path) -> None:
        """Write the weights."""
        arrays = {"mean": self.mean, "spread": self.spread, "doubt": self.doubt}
        arrays |= {f"weight{n}": values for n, values in enumerate(self.weights)}
        arrays |= {f"bias{n}": values for n, values in enumerate(self.biases)}
        cast(Any, np).savez_compressed(path, **arrays)

    def scores(self, features: RealArray) -> SingleArray:
        """Score (K,) each labelling of a slice by its features (K, F); the highest is the likeliest.

        The softmax of the scores is how probable each is, if one of them is right.
        """
        hidden = self.standardised(features)
        for n, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            hidden = (np.maximum(hidden, 0) if n else hidden) @ weight + bias
        return hidden[:, 0]

    def standardised(self, features: RealArray) -> SingleArray:
        """Features (K, F) as the first layer reads them."""
        return np.clip((features.astype(np.float32) - self.mean) / self.spread, -FARTHEST, FARTHEST)


@cache
def shipped_reranker() -> Reranker:
    """Return the network that comes with the package."""
    found = Reranker.load(WEIGHTS)
    assert len(found.mean) == len(FEATURES)
    return found
