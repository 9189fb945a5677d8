"""Message passing on pixels, links and triangles; everything else in the network acts on rows alone."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from cccd.junctions.batch import POOLED_SCALES, GraphBatch
from cccd.junctions.intensity import BLURS

__all__ = ["GatedConvolution", "MessageLayer", "RowGroups"]

# Mean intensities of a slice that each layer compares with, over what it attends to.
_VIEWS = 4

# Keeps means of nothing finite.
_LEAST_ATTENTION = 1e-3


class GatedConvolution(nn.Module):
    """Equation (11): ``x'_i = Agg({Act(Dropout(BN(x_j W + b))), j in N(i)})`` with the sum as Agg.

    A link's gate, when given, weighs what passes along it; gates of 1 are the equation as printed.
    What a node sends does not depend on the receiver, so it is computed once per node.

    Parameters
    ----------
    width_in, width_out : int
    dropout : float
    heads : int
        A link's gate has that many values, each for an equal share of the channels.
    """

    def __init__(self, width_in: int, width_out: int, dropout: float, heads: int = 1):
        super().__init__()
        self.dense = nn.Linear(width_in, width_out)
        self.norm = nn.BatchNorm1d(width_out)
        self.dropout = nn.Dropout(dropout)
        self.heads = heads

    def messages(self, x: Tensor) -> Tensor:
        """``Act(Dropout(BN(x W + b)))`` of every node."""
        return torch.relu(self.dropout(self.norm(self.dense(x))))

    def _gated(self, sent: Tensor, gate: Tensor | None) -> Tensor:
        if gate is None:
            return sent
        shape = (*sent.shape[:-1], self.heads, sent.shape[-1] // self.heads)
        return (sent.view(shape) * gate.unsqueeze(-1)).view(sent.shape)

    def along_links(self, x: Tensor, source: Tensor, target: Tensor, gate: Tensor | None = None) -> Tensor:
        """Sum over directed links (E,) from ``source`` to ``target`` nodes; gates (E, heads)."""
        sent = self.messages(x)
        received = torch.zeros_like(sent)
        return received.index_add_(0, target, self._gated(sent.index_select(0, source), gate))

    def over_sides(self, x: Tensor, neighbours: Tensor, gate: Tensor | None = None) -> Tensor:
        """Sum over each receiver's three neighbours (T, 3); gates (T, 3, heads)."""
        return self._gated(_rows(self.messages(x), neighbours), gate).sum(dim=1)


def _rows(values: Tensor, index: Tensor) -> Tensor:
    """``values[index]``, several times faster on a CPU."""
    return values.index_select(0, index.reshape(-1)).view(*index.shape, values.shape[1])


@dataclass(frozen=True)
class RowGroups:
    """Rows that are pooled: the number of each row's group, and each group's size."""

    number: Tensor  # (N,)
    size: Tensor  # (G, 1)

    @classmethod
    def of(cls, number: Tensor) -> RowGroups:
        """Count the groups' rows."""
        return cls(number, torch.bincount(number).clamp_min(1).float()[:, None])

    def mean(self, values: Tensor) -> Tensor:
        """Mean of rows (N, C) over groups, given back to every row."""
        # adding rows of a view is several times slower than copying it first
        total = values.new_zeros(len(self.size), values.shape[1])
        total = total.index_add_(0, self.number, values.contiguous())
        return (total / self.size).index_select(0, self.number)


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
        self.convolution = GatedConvolution(width, width, dropout, heads)
        self.gate = nn.Linear(link_width, heads)
        self.norm = nn.BatchNorm1d(width)
        # messages to the triangle itself, to its regions, and to its links by sum and by difference
        self.parts = [width] * (1 + len(POOLED_SCALES)) + [link_width] * 2
        self.triangle_messages = nn.Linear(width, sum(self.parts))
        self.link_norm = nn.BatchNorm1d(link_width)
        # messages to the links of the same region pair, per scale, branch pair and group pair
        self.link_messages = nn.Linear(link_width, link_width * (len(POOLED_SCALES) + 2))
        self.attention = nn.Linear(width, _VIEWS)
        self.contrast = nn.Linear(2 * _VIEWS * len(BLURS), width, bias=False)

    def _contrast(self, t: Tensor, batch: GraphBatch) -> Tensor:
        """Differences (T, 2 V B) of each triangle's intensity and its slice's attended means."""
        weight = torch.sigmoid(self.attention(t)) * batch.extents[:, None]
        total = weight.new_zeros(int(batch.slices[-1]) + 1, _VIEWS * (len(BLURS) + 1))
        seen = torch.cat([weight, (weight[:, :, None] * batch.intensities[:, None]).flatten(1)], dim=1)
        total = total.index_add_(0, batch.slices, seen)
        mean = total[:, _VIEWS:].view(-1, _VIEWS, len(BLURS)) / (total[:, :_VIEWS, None] + _LEAST_ATTENTION)
        apart = (batch.intensities[:, None] - mean.index_select(0, batch.slices)).flatten(1)
        return torch.cat([apart, apart.abs()], dim=1)

    def forward(
        self, t: Tensor, e: Tensor, batch: GraphBatch, regions: list[RowGroups], link_groups: list[RowGroups]
    ) -> tuple[Tensor, Tensor]:
        """States of triangles (T, width) and links (L, link_width) after one exchange of messages."""
        gate = torch.cat([self.gate(e), e.new_zeros(1, self.convolution.heads)])
        t = t + self.convolution.over_sides(t, batch.neighbours, _rows(gate, batch.triangle_links))
        t = t + self.contrast(self._contrast(t, batch))
        messages = self.triangle_messages(torch.relu(self.norm(t)))
        own, *regional, summed, compared = messages.split(self.parts, dim=1)
        t = t + own
        for message, groups in zip(regional, regions, strict=True):
            t = t + groups.mean(message)
        first, second = batch.link_triangles
        sums = [summed.index_select(0, side) for side in (first, second)]
        differences = [compared.index_select(0, side) for side in (first, second)]
        e = e + torch.relu(sums[0] + sums[1] + (differences[0] - differences[1]).abs())
        shared = self.link_messages(torch.relu(self.link_norm(e))).chunk(len(link_groups), dim=1)
        for message, groups in zip(shared, link_groups, strict=True):
            e = e + groups.mean(message)
        return t, e
