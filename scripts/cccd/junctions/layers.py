"""Message passing on pixels, links and triangles; everything else in the network acts on rows alone."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch_geometric.data import HeteroData
from torch_geometric.nn import MessagePassing
from torch_geometric.utils import scatter

from cccd.junctions.graph_data import LINK_POOLS, TRIANGLE_LINKS, TRIANGLE_POOLS
from cccd.junctions.intensity import BLURS

__all__ = ["EquationEleven", "MessageLayer", "both_ways", "pooled_mean"]

# Mean intensities of a slice that each layer compares with, over what it attends to.
_VIEWS = 4

# Keeps means of nothing finite.
_LEAST_ATTENTION = 1e-3


class EquationEleven(MessagePassing):
    """Equation (11): ``x'_i = Agg({Act(Dropout(BN(x_j W + b))), j in N(i)})`` with the sum as Agg.

    A link's gate, when given, weighs what passes along it; without gates it is the equation as printed.
    What a node sends does not depend on the receiver, so it is computed once per node.

    Parameters
    ----------
    width_in, width_out : int
    dropout : float
    heads : int
        A link's gate has that many values, each for an equal share of the channels.
    """

    def __init__(self, width_in: int, width_out: int, dropout: float, heads: int = 1):
        super().__init__(aggr="sum")
        self.dense = nn.Linear(width_in, width_out)
        self.norm = nn.BatchNorm1d(width_out)
        self.dropout = nn.Dropout(dropout)
        self.heads = heads

    def forward(
        self, x: Tensor, edge_index: Tensor, gate: Tensor | None = None, receivers: int | None = None
    ) -> Tensor:
        """Sum what neighbours send.

        Parameters
        ----------
        x : (N, width_in)
        edge_index : (2, E) int64
            Senders and receivers.
        gate : (E, heads), optional
        receivers : int, optional
            How many there are, where they are not the senders.

        Returns
        -------
        (receivers, width_out)
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
        """Weigh what passes along each edge (E, width_out) by its gates."""
        if gate is None:
            return x_j
        by_head = x_j.view(len(x_j), self.heads, -1)
        return (by_head * gate.unsqueeze(-1)).view(x_j.shape)


def both_ways(edge_index: Tensor) -> Tensor:
    """Edges (2, 2 E) that run from first to second, then those that run back."""
    return torch.cat([edge_index, edge_index.flip(0)], dim=1)


def pooled_mean(values: Tensor, pool: Tensor) -> Tensor:
    """Mean of rows (N, C) over pools, by their number (N,), given back to every row."""
    # adding rows of a view is several times slower than copying it first
    return scatter(values.contiguous(), pool, dim=0, reduce="mean").index_select(0, pool)


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
        self.convolution = EquationEleven(width, width, dropout, heads)
        self.gate = nn.Linear(link_width, heads)
        self.norm = nn.BatchNorm1d(width)
        # messages to the triangle itself, to its regions, and to its links by sum and by difference
        self.parts = [width] * (1 + TRIANGLE_POOLS) + [link_width] * 2
        self.triangle_messages = nn.Linear(width, sum(self.parts))
        self.link_norm = nn.BatchNorm1d(link_width)
        # messages to the links of the same region pair, per scale, branch pair and group pair
        self.link_messages = nn.Linear(link_width, link_width * LINK_POOLS)
        self.attention = nn.Linear(width, _VIEWS)
        self.contrast = nn.Linear(2 * _VIEWS * len(BLURS), width, bias=False)

    def _contrast(self, t: Tensor, data: HeteroData) -> Tensor:
        """Differences (T, 2 V B) of each triangle's intensity and its slice's attended means."""
        triangles = data["triangle"]
        weight = torch.sigmoid(self.attention(t)) * triangles.extent[:, None]
        seen = torch.cat([weight, (weight[:, :, None] * triangles.intensity[:, None]).flatten(1)], dim=1)
        total = scatter(seen, triangles.batch, dim=0, dim_size=data.num_graphs, reduce="sum")
        mean = total[:, _VIEWS:].view(-1, _VIEWS, len(BLURS)) / (total[:, :_VIEWS, None] + _LEAST_ATTENTION)
        apart = (triangles.intensity[:, None] - mean.index_select(0, triangles.batch)).flatten(1)
        return torch.cat([apart, apart.abs()], dim=1)

    def forward(self, t: Tensor, e: Tensor, data: HeteroData) -> tuple[Tensor, Tensor]:
        """States of triangles (T, width) and links (L, link_width) after one exchange of messages."""
        sides = data[TRIANGLE_LINKS].edge_index
        gate = self.gate(e)
        t = t + self.convolution(t, both_ways(sides), torch.cat([gate, gate]))
        t = t + self.contrast(self._contrast(t, data))
        messages = self.triangle_messages(torch.relu(self.norm(t)))
        own, *regional, summed, compared = messages.split(self.parts, dim=1)
        t = t + own
        for message, pool in zip(regional, data["triangle"].pool_index, strict=True):
            t = t + pooled_mean(message, pool)
        sums = [summed.index_select(0, side) for side in sides]
        differences = [compared.index_select(0, side) for side in sides]
        e = e + torch.relu(sums[0] + sums[1] + (differences[0] - differences[1]).abs())
        shared = self.link_messages(torch.relu(self.link_norm(e))).chunk(LINK_POOLS, dim=1)
        for message, pool in zip(shared, data["link"].pool_index, strict=True):
            e = e + pooled_mean(message, pool)
        return t, e
