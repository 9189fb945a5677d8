"""The energy of a labelling, whose least is the answer: one definition for training and for inference.

A labelling says of every triangle of a `DelaunayGraph` whether it is inside. It costs the unary energy of
every triangle inside, and the pairwise energy of every link between two triangles that differ, along which
the border runs::

    E(y) = sum_t unary[t] y[t]  +  sum_l pairwise[l] [y differs across l]

    unary[t]    = -area[t]^area_power       * logit(t is inside)
    pairwise[l] =  border_cost * length[l]  * softplus(-logit(l is true))

Pairwise energies are not negative, so that the least energy is found exactly by a minimum cut
(`cccd_junctions.cut`). The loss of the training (`cccd_training.junctions.loss`) compares energies of the
same terms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

import numpy as np

from cccd.geometry.arrays import BoolArray, FloatArray
from cccd_junctions.cut import minimum_cuts
from cccd_junctions.delaunay import DelaunayGraph

if TYPE_CHECKING:
    from torch import Tensor

_Numbers = TypeVar("_Numbers", FloatArray, "Tensor")

#: Unary energy of triangles that are held outside, those at the ghost points among them: above all that the
#: others can gain.
_HELD = 1e9

# A triangle's logit counts by this power of its area, and a pixel of border costs so much per nat of doubt
# about its link: the best compromise of ten settings on the frozen validation graphs.
_AREA_POWER = 0.75
_BORDER_COST = 1.0

#: Logits that triangles (T,) are inside and that links (L,) are true.
Logits = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False)
class EnergyWeights(Generic[_Numbers]):
    """What multiplies the logits' terms.

    Attributes
    ----------
    unary : (T,)
        A triangle's area to a power; 0 at the ghost points, where nothing is left to decide.
    pairwise : (L,)
        A link's length times the cost of a pixel of border.
    """

    unary: _Numbers
    pairwise: _Numbers


@dataclass(frozen=True, eq=False)
class Energy(Generic[_Numbers]):
    """Unary (T,) and pairwise (L,) terms, as arrays or as tensors."""

    unary: _Numbers
    pairwise: _Numbers

    def difference(self, labels: _Numbers, others: _Numbers, link_triangles: Any) -> Any:
        """Energy of one labelling less that of another.

        Parameters
        ----------
        labels, others : (T,)
            0 and 1.
        link_triangles : (2, L)
            The two triangles of each link.
        """
        first, second = link_triangles
        border = abs(labels[first] - labels[second]) - abs(others[first] - others[second])
        return (self.unary * (labels - others)).sum() + (self.pairwise * border).sum()


def energy_of_logits(
    weights: EnergyWeights[_Numbers],
    inside_logit: _Numbers,
    link_logit: _Numbers,
    softplus: Callable[[_Numbers], _Numbers],
) -> Energy[_Numbers]:
    """Weigh what a network says of triangles (T,) and links (L,); the one definition of the terms."""
    return Energy(-(weights.unary * inside_logit), weights.pairwise * softplus(-link_logit))


def energy_weights(graph: DelaunayGraph) -> EnergyWeights[FloatArray]:
    """Weights of a graph's terms."""
    extent = np.where(graph.outer, 0, graph.areas**_AREA_POWER)
    return EnergyWeights(extent, _BORDER_COST * graph.link_lengths)


def _softplus(values: FloatArray) -> FloatArray:
    return cast(FloatArray, np.logaddexp(0, values))


def inference_energy(graph: DelaunayGraph, logits: Logits) -> Energy[FloatArray]:
    """Energy that a network's logits, or the prior's, give a graph."""
    return energy_of_logits(energy_weights(graph), *logits, _softplus)


def least_energy(graph: DelaunayGraph, energy: Energy[FloatArray]) -> BoolArray:
    """Inside triangles (T,) of the least energy; those at the ghost points are outside."""
    return least_energies(graph, [energy.unary], energy.pairwise)[0]


def least_energies(graph: DelaunayGraph, unaries: Sequence[FloatArray], pairwise: FloatArray) -> BoolArray:
    """Inside triangles (K, T) of the least of several energies that differ in their unary terms alone."""
    held = np.where(graph.outer, _HELD, np.stack(unaries))
    return minimum_cuts(held, pairwise, graph.link_triangles)
