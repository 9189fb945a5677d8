"""Message passing on pixels, links and triangles; everything else in the network acts on rows alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import torch
from torch import Tensor, nn
from torch_geometric.data import HeteroData
from torch_geometric.nn import MessagePassing

from cccd_junctions.graph_data import LINK_POOLS, TRIANGLE_LINKS, TRIANGLE_MESSAGES, TRIANGLE_POOLS
from cccd_junctions.intensity import BLURS

# Mean intensities of a slice that each layer compares with, over what it attends to.
_VIEWS = 4

# Keeps means of nothing finite.
_LEAST_ATTENTION = 1e-3


class _Sums(torch.autograd.Function):
    """Weighted sums of rows; so is the gradient, for which PyTorch's own has to sort."""

    @staticmethod
    def forward(ctx: Any, values: Tensor, incidence: Incidence) -> Tensor:
        ctx.incidence = incidence
        return incidence.weighted(values)

    @staticmethod
    def backward(ctx: Any, *grad_outputs: Any) -> tuple[Tensor, None]:
        return ctx.incidence.transposed.weighted(grad_outputs[0]), None


@dataclass(frozen=True, eq=False)
class Incidence:
    """Which of N rows belong to which of S others: sums over them, many times faster than by `scatter`.

    Attributes
    ----------
    rows : (M,) int64
        Rows below N, those of each of the S after those of the one before.
    starts : (S,) int64
        Where each one's begin.
    back_rows, back_starts : (M,) and (N,) int64
        The other way round: which of the S each of the N rows belongs to.
    weights, back_weights : (M,) or None
        What a row counts in a sum; None: 1.
    """

    rows: Tensor
    starts: Tensor
    back_rows: Tensor
    back_starts: Tensor
    weights: Tensor | None = None
    back_weights: Tensor | None = None

    @classmethod
    def of_owners(cls, owners: Tensor, count: int) -> Incidence:
        """Rows that stand owner (N,) by owner, of ``count`` owners."""
        sizes = torch.bincount(owners, minlength=count)
        each = torch.arange(len(owners), device=owners.device)
        return cls(each, torch.cumsum(sizes, 0) - sizes, owners, each)

    def sums(self, values: Tensor) -> Tensor:
        """Sum the rows (N, C) that belong to each (S, C)."""
        return cast(Any, _Sums).apply(values, self)

    def weighted(self, values: Tensor) -> Tensor:
        """Sum them without a gradient."""
        rows, weights = values.contiguous(), self.weights
        return nn.functional.embedding_bag(
            self.rows, rows, self.starts, mode="sum", per_sample_weights=weights
        )

    @property
    def transposed(self) -> Incidence:
        """To each of the N rows the sum of those (S, C) that it belongs to."""
        return Incidence(
            self.back_rows, self.back_starts, self.rows, self.starts, self.back_weights, self.weights
        )


class HeadGate(nn.Linear):
    """Gates of edges: a value per head, given to each of the head's equal share of the channels.

    Parameters
    ----------
    width_in : int
    heads : int
    width : int
        Channels that are gated.
    bias : bool
    """

    def __init__(self, width_in: int, heads: int, width: int, bias: bool = True):
        cast(Any, super()).__init__(width_in, heads, bias)
        self.share = width // heads

    def forward(self, input: Tensor) -> Tensor:
        """Gates (E, width) of edges (E, width_in)."""
        # a few more products are faster than a product with rows of a head each
        bias = cast(Tensor | None, self.bias)
        bias = None if bias is None else bias.repeat_interleave(self.share)
        return nn.functional.linear(input, self.weight.repeat_interleave(self.share, 0), bias)


class Pools:
    """Sets of rows whose means are shared: every row is in one pool of each kind.

    Parameters
    ----------
    index : (K, N) int64
        Number of each row's pool, by kind.
    order : (K, N) int64
        Rows, pool by pool.
    """

    def __init__(self, index: Tensor, order: Tensor):
        sizes = [torch.bincount(kind) for kind in index]
        self.counts = [len(kind) for kind in sizes]
        every = torch.cat(sizes)
        before = torch.tensor([sum(self.counts[:n]) for n in range(len(index))], device=index.device)
        numbers = (index + before[:, None]).t().flatten()
        pools = order.flatten(), torch.cumsum(every, 0) - every
        rows = numbers, torch.arange(0, len(numbers), len(index), device=index.device)
        share = 1.0 / every
        self.means = Incidence(*pools, *rows, share.repeat_interleave(every), share.index_select(0, numbers))
        self.given = Incidence(*rows, *pools)

    def shared(self, x: Tensor, weight: Tensor, bias: Tensor) -> Tensor:
        """Sum (N, C) of what each row's pools share: the pool's mean of ``x W + b``.

        Parameters
        ----------
        x : (N, width)
        weight, bias : (K C, width), (K C,)
        """
        # means of x first: there are fewer pools than rows to be multiplied
        means = self.means.sums(x)
        kinds = len(self.counts)
        parts = zip(torch.split(means, self.counts), weight.chunk(kinds), bias.chunk(kinds), strict=True)
        table = torch.cat([nn.functional.linear(*part) for part in parts])
        return self.given.sums(table)


class EquationEleven(MessagePassing):
    """Equation (11): ``x'_i = Agg({Act(Dropout(BN(x_j W + b))), j in N(i)})`` with the sum as Agg.

    A link's gate, when given, weighs what passes along it; without gates it is the equation as printed.
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
        self, x: Tensor, edge_index: Tensor, gate: Tensor | None = None, received: Incidence | None = None
    ) -> Tensor:
        """Sum what neighbours send.

        Parameters
        ----------
        x : (N, width_in)
        edge_index : (2, E) int64
            Senders and receivers.
        gate : (E, width_out), optional
        received : Incidence, optional
            Edges by their receivers, where they stand receiver by receiver; without, they stand in any order
            and the receivers are the senders.

        Returns
        -------
        (receivers, width_out)
        """
        size = (len(x), len(x) if received is None else len(received.starts))
        return self.propagate(edge_index, x=self.sent(x), gate=gate, received=received, size=size)

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
        return x_j if gate is None else x_j * gate

    def aggregate(self, inputs: Tensor, index: Tensor, received: Incidence | None, dim_size: int) -> Tensor:
        """Sum messages (E, width_out) by receiver."""
        if received is None:
            return cast(Any, super()).aggregate(inputs, index, dim_size=dim_size)
        return received.sums(inputs)


@dataclass(frozen=True, eq=False)
class DirectedLinks:
    """Both ways of every link between two nodes, receiver by receiver, and what stands at nodes and at links.

    Attributes
    ----------
    edges : (2, 2 L) int64
        Nodes that send and that receive.
    received : Incidence
        Edges by the node that receives.
    rows : Incidence
        A row, twice a link's number and one more for its way back, by its edge.
    links : Incidence
        A link by each of its edges.
    ends, apart : Incidence
        Both nodes by their link; and the first less the second.
    """

    edges: Tensor
    received: Incidence
    rows: Incidence
    links: Incidence
    ends: Incidence
    apart: Incidence

    @classmethod
    def of(
        cls, data: HeteroData, links: tuple[str, str, str], messages: tuple[str, str, str]
    ) -> DirectedLinks:
        """Read them from a `Batch`."""
        edges, row = data[messages].edge_index, data[messages].edge_row
        received = Incidence.of_owners(edges[1], data[messages[0]].num_nodes)
        link, each = row >> 1, received.rows
        edge = torch.empty_like(each).index_copy_(0, row, each)
        ends = data[links].edge_index.t().flatten(), each[::2], link, received.starts
        turn, turned = torch.ones(len(each)), 2.0 * (row & 1) - 1
        turn[1::2] = -1
        return cls(
            edges,
            received,
            Incidence(row, each, edge, each),
            Incidence(link, each, edge, each[::2]),
            Incidence(*ends),
            Incidence(*ends, turn.to(row.device), turned),
        )


@dataclass(frozen=True, eq=False)
class Exchange:
    """What the message layers read of a batch of slices besides its states.

    Attributes
    ----------
    ways : DirectedLinks
        Between triangles.
    regions, pools : Pools
        Of triangles, and of links.
    slices : Incidence
        Triangles by their slice.
    intensity : (T, V B) or None
        Blurred intensities, repeated for every view; None where no slice has an image.
    extent : (T, 2 V B) or None
        Weight of a triangle in its slice's means, times its intensities, and alone.
    """

    ways: DirectedLinks
    regions: Pools
    pools: Pools
    slices: Incidence
    intensity: Tensor | None
    extent: Tensor | None

    @classmethod
    def of(cls, data: HeteroData, needed: bool) -> Exchange:
        """Read it from a `Batch`; intensities that are all zero are left out unless they are needed."""
        triangles, links = data["triangle"], data["link"]
        intensity, extent = None, None
        if needed or bool(triangles.intensity.any()):
            intensity = triangles.intensity.repeat(1, _VIEWS)
            extent = triangles.extent[:, None].repeat(1, intensity.shape[1])
            extent = torch.cat([extent * intensity, extent], dim=1)
        return cls(
            DirectedLinks.of(data, TRIANGLE_LINKS, TRIANGLE_MESSAGES),
            Pools(triangles.pool_index, triangles.pool_order),
            Pools(links.pool_index, links.pool_order),
            Incidence.of_owners(triangles.batch, data.num_graphs),
            intensity,
            extent,
        )


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
        self.gate = HeadGate(link_width, heads, width)
        self.norm = nn.BatchNorm1d(width)
        # messages to the triangle itself, to its regions, and to its links by sum and by difference
        self.parts = [width, width * TRIANGLE_POOLS, link_width, link_width]
        self.triangle_messages = nn.Linear(width, sum(self.parts))
        self.link_norm = nn.BatchNorm1d(link_width)
        # messages to the links of the same region pair, per scale, branch pair and group pair
        self.link_messages = nn.Linear(link_width, link_width * LINK_POOLS)
        self.attention = HeadGate(width, _VIEWS, _VIEWS * len(BLURS))
        self.contrast = nn.Linear(2 * _VIEWS * len(BLURS), width, bias=False)

    def _contrast(self, t: Tensor, intensity: Tensor, extent: Tensor, slices: Incidence) -> Tensor:
        """Differences (T, 2 V B) of each triangle's intensity and its slice's attended means."""
        weight = torch.sigmoid(self.attention(t)).repeat(1, 2) * extent
        attended, attention = slices.sums(weight).chunk(2, dim=1)
        mean = attended / (attention + _LEAST_ATTENTION)
        apart = intensity - slices.transposed.sums(mean)
        return torch.cat([apart, apart.abs()], dim=1)

    def forward(self, t: Tensor, e: Tensor, exchange: Exchange) -> tuple[Tensor, Tensor]:
        """States of triangles (T, width) and links (L, link_width) after one exchange of messages."""
        ways = exchange.ways
        t = t + self.convolution(t, ways.edges, ways.links.sums(self.gate(e)), ways.received)
        if exchange.intensity is not None and exchange.extent is not None:
            t = t + self.contrast(self._contrast(t, exchange.intensity, exchange.extent, exchange.slices))
        x = torch.relu(self.norm(t))
        to = self.triangle_messages
        weights, biases = torch.split(to.weight, self.parts), torch.split(to.bias, self.parts)
        own, regional, summed, compared = zip(weights, biases, strict=True)
        t = t + nn.functional.linear(x, *own) + exchange.regions.shared(x, *regional)
        apart = ways.apart.sums(nn.functional.linear(x, *compared))
        e = e + torch.relu(ways.ends.sums(nn.functional.linear(x, *summed)) + apart.abs())
        shared = self.link_messages
        return t, e + exchange.pools.shared(torch.relu(self.link_norm(e)), shared.weight, shared.bias)
