"""Message passing on pixels, links and triangles; everything else in the network acts on rows alone."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch_geometric.data import HeteroData
from torch_geometric.nn import MessagePassing
from torch_geometric.utils import scatter

from cccd_junctions.graph_data import LINK_POOLS, TRIANGLE_LINKS, TRIANGLE_POOLS
from cccd_junctions.intensity import BLURS

# Mean intensities of a slice that each layer compares with, over what it attends to.
_VIEWS = 4

# Keeps means of nothing finite.
_LEAST_ATTENTION = 1e-3


def both_ways(pairs: Tensor) -> Tensor:
    """Senders and receivers (2, 2 L) of pairs (2, L): each pair, and at once its way back."""
    return torch.stack([pairs, pairs.flip(0)], dim=2).flatten(1)


def sum_of_ends(x: Tensor, pairs: Tensor) -> Tensor:
    """Sum (L, C) of the rows (N, C) of both ends of pairs (2, L)."""
    first, second = (x.index_select(0, ends) for ends in pairs)
    return first + second


def shared_means(x: Tensor, pools: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
    """Sum (N, C) of what each row's pools share: the pool's mean of ``x W + b``.

    Parameters
    ----------
    x : (N, width)
    pools : (K, N) int64
        Number of each row's pool, by kind.
    weight, bias : (K C, width), (K C,)
    """
    shared: list[Tensor] = []
    for pool, *part in zip(pools, weight.chunk(len(pools)), bias.chunk(len(pools)), strict=True):
        mean = scatter(x, pool, reduce="mean")  # there are fewer pools than rows to be multiplied
        shared.append(nn.functional.linear(mean, *part).index_select(0, pool))
    return torch.stack(shared).sum(dim=0)


class EquationEleven(MessagePassing):
    """Equation (11): ``x'_i = Agg({Act(Dropout(BN(x_j W + b))), j in N(i)})`` with the sum as Agg.

    A link's gates, when given, weigh what passes along it, each of them an equal share of the channels (a
    head); without gates it is the equation as printed.
    What a node sends does not depend on the receiver, so it is computed once per node.

    Parameters
    ----------
    width_in, width_out : int
    dropout : float
    """

    def __init__(self, width_in: int, width_out: int, dropout: float):
        super().__init__(aggr="sum")
        self.dense = nn.Linear(width_in, width_out)
        self.norm = nn.BatchNorm1d(width_out)
        self.dropout = nn.Dropout(dropout)

    def forward(
        self, x: Tensor, edge_index: Tensor, gate: Tensor | None = None, receivers: int | None = None
    ) -> Tensor:
        """Sum (receivers, width_out) of what neighbours send.

        Parameters
        ----------
        x : (N, width_in)
        edge_index : (2, E) int64
            Senders and receivers.
        gate : (E, heads), optional
        receivers : int, optional
            How many there are; without, they are the senders.
        """
        size = (len(x), len(x) if receivers is None else receivers)
        return self.propagate(edge_index, x=self.sent(x), gate=gate, size=size)

    def propagate(self, edge_index: Tensor, size: tuple[int, int] | None = None, **kwargs: Any) -> Tensor:
        """Exchange messages as the base class does.

        For a class without its own ``propagate`` PyTorch Geometric compiles one, from a file that every
        process leaves in the folder for temporary files.
        """
        return super().propagate(edge_index, size, **kwargs)

    def sent(self, x: Tensor) -> Tensor:
        """``Act(Dropout(BN(x W + b)))`` of every node."""
        return torch.relu(self.dropout(self.norm(self.dense(x))))

    def message(self, x_j: Tensor, gate: Tensor | None) -> Tensor:
        """Weigh what passes along each edge (E, width_out) by its gates (E, heads)."""
        if gate is None:
            return x_j
        heads = x_j.view(len(x_j), gate.shape[1], -1)
        return (heads * gate[:, :, None]).view(x_j.shape)


class MessageLayer(nn.Module):
    """Messages between triangles, the links between them, regions and groups of links.

    Parameters
    ----------
    width, link_width : int
        Channels of triangles and of links.
    heads : int
    dropout : float
    """

    def __init__(self, width: int, link_width: int, heads: int, dropout: float):
        super().__init__()
        self.convolution = EquationEleven(width, width, dropout)
        self.gate = nn.Linear(link_width, heads)
        self.norm = nn.BatchNorm1d(width)
        # messages to the triangle itself, to its regions, and to its links by sum and by difference
        self.parts = [width, width * TRIANGLE_POOLS, link_width, link_width]
        self.triangle_messages = nn.Linear(width, sum(self.parts))
        self.link_norm = nn.BatchNorm1d(link_width)
        # messages to the links of the same region pair, per scale, branch pair and group pair
        self.link_messages = nn.Linear(link_width, link_width * LINK_POOLS)
        self.attention = nn.Linear(width, _VIEWS)
        self.contrast = nn.Linear(2 * _VIEWS * len(BLURS), width, bias=False)

    def _contrast(self, t: Tensor, data: HeteroData) -> Tensor:
        """Differences (T, 2 V B) of each triangle's intensity and its slice's attended means."""
        triangles = data["triangle"]
        intensity, extent = triangles.intensity.repeat(1, _VIEWS), triangles.extent[:, None]
        attention = torch.sigmoid(self.attention(t)).repeat_interleave(len(BLURS), dim=1)
        parts = torch.cat([attention * (extent * intensity), attention * extent], dim=1)
        attended, total = scatter(parts, triangles.batch, dim_size=data.num_graphs).chunk(2, dim=1)
        mean = attended / (total + _LEAST_ATTENTION)
        apart = intensity - mean.index_select(0, triangles.batch)
        return torch.cat([apart, apart.abs()], dim=1)

    def forward(self, t: Tensor, e: Tensor, data: HeteroData) -> tuple[Tensor, Tensor]:
        """States of triangles (T, width) and links (L, link_width) after one exchange of messages."""
        triangles, sides = data["triangle"], data[TRIANGLE_LINKS].edge_index
        gates = self.gate(e).repeat_interleave(2, dim=0)
        t = t + self.convolution(t, both_ways(sides), gates)
        if self.training or bool(triangles.intensity.any()):
            t = t + self.contrast(self._contrast(t, data))
        x = torch.relu(self.norm(t))
        to = self.triangle_messages
        weights, biases = torch.split(to.weight, self.parts), torch.split(to.bias, self.parts)
        own, regional, summed, compared = zip(weights, biases, strict=True)
        t = t + nn.functional.linear(x, *own) + shared_means(x, triangles.pool_index, *regional)
        first, second = (nn.functional.linear(x, *compared).index_select(0, side) for side in sides)
        e = e + torch.relu(sum_of_ends(nn.functional.linear(x, *summed), sides) + (first - second).abs())
        shared = self.link_messages
        pools = data["link"].pool_index
        return t, e + shared_means(torch.relu(self.link_norm(e)), pools, shared.weight, shared.bias)
