"""The junction network: convolutions of eq. (11) on pixels and triangles, and what joins them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
import torch
from torch import Tensor, nn

from cccd.junctions.complexes import Complex
from cccd.junctions.features import LINK_FEATURES, NODE_FEATURES, TONES, TRIANGLE_FEATURES, Features

__all__ = ["Batch", "Convolution", "JunctionNetwork", "make_batch"]

# Scales of `REGION_GAPS_PX` at which triangles and links are pooled.
_POOLED = (0, 2)

# Hidden channels that read a pixel's surroundings, for each channel of its state.
_READING = 6

# Mean grey values of a slice that each exchange compares with, over what it attends to.
_VIEWS = 4


@dataclass
class Batch:
    """A `Complex` and its `Features` as tensors; -1 indices are replaced by what adds nothing."""

    nodes: Tensor  # (V, NODE_FEATURES) uint8
    links: Tensor  # (L, LINK_FEATURES)
    triangles: Tensor  # (T, TRIANGLE_FEATURES)
    link_nodes: Tensor  # (2, L)
    direction: Tensor  # (L, 2) unit vector from the first node to the second
    corners: Tensor  # (T, 3) nodes
    corner_direction: Tensor  # (T, 3, 5)
    neighbours: Tensor  # (T, 3); own index beyond the ring
    side_links: Tensor  # (T, 3); L beyond the ring
    sides: Tensor  # (2, L)
    regions: list[Tensor]  # (T,) per pooled scale
    # (L,) links between the same two regions, per pooled scale; the same two branches; the same two strokes
    walls: list[Tensor]
    tones: Tensor  # (T, TONES) grey values
    extents: Tensor  # (T,) weight of a triangle in its slice's mean grey
    slices: Tensor  # (T,)

    def to(self, device: torch.device | str) -> Batch:
        """Move all tensors."""
        moved = {
            name: [part.to(device) for part in value] if isinstance(value, list) else value.to(device)
            for name, value in vars(self).items()
        }
        return Batch(**moved)


def make_batch(graph: Complex, features: Features) -> Batch:
    """Tensors of a complex (one slice or many) and its features."""
    a, b = (graph.points[graph.links[:, end]] for end in (0, 1))
    step = b - a
    direction = step / np.linalg.norm(step, axis=1, keepdims=True)
    corners = graph.points[graph.triangles]
    spoke = corners - corners.mean(axis=1, keepdims=True)
    reach = np.maximum(np.linalg.norm(spoke, axis=2), 1e-6)
    cosine, sine = spoke[..., 1] / reach, spoke[..., 0] / reach
    corner = np.stack([cosine, sine, cosine**2 - sine**2, 2 * cosine * sine, np.log(reach)], axis=2)
    own = np.arange(len(graph.triangles))[:, None]
    pairs = [graph.regions[graph.sides, g] for g in _POOLED]
    pairs += [labels[graph.links] for labels in features.branches]
    walls = [_same_pair(pair.astype(np.int64)) for pair in pairs]

    def index(array):
        return torch.from_numpy(np.ascontiguousarray(array, np.int64))

    def real(array):
        return torch.from_numpy(np.ascontiguousarray(array, np.float32))

    return Batch(
        torch.from_numpy(features.nodes),
        real(features.links),
        real(features.triangles),
        index(graph.links.T),
        real(direction),
        index(graph.triangles),
        real(corner),
        index(np.where(graph.neighbours >= 0, graph.neighbours, own)),
        index(np.where(graph.side_links >= 0, graph.side_links, len(graph.links))),
        index(graph.sides.T),
        [index(graph.regions[:, g]) for g in _POOLED],
        [index(wall) for wall in walls],
        real(features.tones),
        real(np.where(graph.outer, 0, graph.areas)),
        index(np.repeat(np.arange(len(graph.triangle_offsets) - 1), np.diff(graph.triangle_offsets))),
    )


def _same_pair(pair: np.ndarray) -> np.ndarray:
    """Give equal unordered pairs (L, 2) equal numbers (L,)."""
    low, high = np.minimum(*pair.T), np.maximum(*pair.T)
    return pd.factorize(low * (high.max() + 1) + high)[0]


class Convolution(nn.Module):
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


@dataclass
class _Groups:
    """Rows that are pooled: the number of each row's group, and each group's size."""

    number: Tensor  # (N,)
    size: Tensor  # (G, 1)

    @classmethod
    def of(cls, number: Tensor) -> _Groups:
        return cls(number, torch.bincount(number).clamp_min(1).float()[:, None])

    def mean(self, values: Tensor) -> Tensor:
        """Mean of rows (N, C) over groups, given back to every row."""
        # adding rows of a view is several times slower than copying it first
        total = values.new_zeros(len(self.size), values.shape[1])
        total = total.index_add_(0, self.number, values.contiguous())
        return (total / self.size).index_select(0, self.number)


class _Round(nn.Module):
    """One exchange between triangles, the links between them, regions and walls."""

    def __init__(self, width: int, link_width: int, heads: int, dropout: float):
        super().__init__()
        self.convolution = Convolution(width, width, dropout, heads)
        self.gate = nn.Linear(link_width, heads)
        self.norm = nn.BatchNorm1d(width)
        # what a triangle gives to itself and its regions, and to its links by sum and by difference
        self.parts = [width] * (1 + len(_POOLED)) + [link_width] * 2
        self.give = nn.Linear(width, sum(self.parts))
        self.link_norm = nn.BatchNorm1d(link_width)
        self.wall = nn.Linear(link_width, link_width * (len(_POOLED) + 2))
        self.attend = nn.Linear(width, _VIEWS)
        self.compare = nn.Linear(2 * _VIEWS * TONES, width, bias=False)

    def _contrast(self, t: Tensor, batch: Batch) -> Tensor:
        """How each triangle's grey differs from its slice's means over what is attended to (T, 2 V TONES)."""
        weight = torch.sigmoid(self.attend(t)) * batch.extents[:, None]
        total = weight.new_zeros(int(batch.slices[-1]) + 1, _VIEWS * (TONES + 1))
        seen = torch.cat([weight, (weight[:, :, None] * batch.tones[:, None]).flatten(1)], dim=1)
        total = total.index_add_(0, batch.slices, seen)
        mean = total[:, _VIEWS:].view(-1, _VIEWS, TONES) / (total[:, :_VIEWS, None] + 1e-3)
        apart = (batch.tones[:, None] - mean.index_select(0, batch.slices)).flatten(1)
        return torch.cat([apart, apart.abs()], dim=1)

    def forward(
        self, t: Tensor, e: Tensor, batch: Batch, regions: list[_Groups], walls: list[_Groups]
    ) -> tuple[Tensor, Tensor]:
        gate = torch.cat([self.gate(e), e.new_zeros(1, self.convolution.heads)])
        t = t + self.convolution.over_sides(t, batch.neighbours, _rows(gate, batch.side_links))
        t = t + self.compare(self._contrast(t, batch))
        own, *regional, summed, compared = self.give(torch.relu(self.norm(t))).split(self.parts, dim=1)
        t = t + own
        for given, groups in zip(regional, regions, strict=True):
            t = t + groups.mean(given)
        first, second = batch.sides
        given = [part.index_select(0, side) for part in (summed, compared) for side in (first, second)]
        e = e + torch.relu(given[0] + given[1] + (given[2] - given[3]).abs())
        shared = self.wall(torch.relu(self.link_norm(e))).chunk(len(walls), dim=1)
        for given, groups in zip(shared, walls, strict=True):
            e = e + groups.mean(given)
        return t, e


class JunctionNetwork(nn.Module):
    """Which links are true, and which triangles are inside.

    Pixels read their surroundings once and exchange them along the Delaunay links by gated convolutions
    of eq. (11); triangles gather their corners, then exchange with their neighbours by the same
    convolution, gated by the state of the link between them. Means over regions, over the walls between
    them, and over branches and strokes carry a message across any distance in one step.

    Parameters
    ----------
    width : int
        Channels of pixels and triangles; a multiple of ``heads``.
    link_width : int
        Channels of links.
    pixel_layers, rounds : int
        Convolutions on pixels, exchanges among triangles.
    heads : int
        Gate values per link.
    dropout : float
    """

    def __init__(
        self,
        width: int = 32,
        link_width: int = 24,
        pixel_layers: int = 2,
        rounds: int = 4,
        heads: int = 8,
        dropout: float = 0.0,
    ):
        super().__init__()
        self.sizes = {
            "width": width,
            "link_width": link_width,
            "pixel_layers": pixel_layers,
            "rounds": rounds,
            "heads": heads,
            "dropout": dropout,
        }
        self.read = nn.Sequential(
            nn.Linear(NODE_FEATURES, _READING * width),
            nn.BatchNorm1d(_READING * width),
            nn.ReLU(),
            nn.Linear(_READING * width, width),
        )
        self.pixels = nn.ModuleList(Convolution(width, width, dropout, heads) for _ in range(pixel_layers))
        self.even = nn.ModuleList(nn.Linear(LINK_FEATURES, heads) for _ in range(pixel_layers))
        self.odd = nn.ModuleList(nn.Linear(2, heads, bias=False) for _ in range(pixel_layers))
        self.corner = Convolution(width, width, dropout, heads)
        self.corner_gate = nn.Linear(5, heads)
        self.triangle = nn.Sequential(nn.BatchNorm1d(TRIANGLE_FEATURES), nn.Linear(TRIANGLE_FEATURES, width))
        self.link = nn.Sequential(nn.BatchNorm1d(LINK_FEATURES), nn.Linear(LINK_FEATURES, link_width))
        self.link_ends = nn.Linear(width, link_width)
        self.rounds = nn.ModuleList(_Round(width, link_width, heads, dropout) for _ in range(rounds))
        self.inside_head = nn.Sequential(
            nn.BatchNorm1d(width), nn.ReLU(), nn.Linear(width, width), nn.ReLU(), nn.Linear(width, 1)
        )
        self.link_head = nn.Sequential(nn.BatchNorm1d(link_width), nn.ReLU(), nn.Linear(link_width, 1))

    def forward(self, batch: Batch) -> tuple[Tensor, Tensor]:
        """Logits that a triangle (T,) is inside and that a link (L,) is true."""
        x = self.read(batch.nodes.float() / 255)
        first, second = batch.link_nodes
        source, target = torch.cat([first, second]), torch.cat([second, first])
        features = self.link[0](batch.links)
        for layer, even, odd in zip(self.pixels, self.even, self.odd, strict=True):
            both, turned = even(features), odd(batch.direction)
            x = x + layer.along_links(x, source, target, torch.cat([both + turned, both - turned]))
        t = self.triangle(batch.triangles)
        t = t + self.corner.over_sides(x, batch.corners, self.corner_gate(batch.corner_direction))
        ends = self.link_ends(x)
        e = self.link[1](features) + ends.index_select(0, first) + ends.index_select(0, second)
        regions, walls = ([_Groups.of(number) for number in part] for part in (batch.regions, batch.walls))
        for exchange in self.rounds:
            t, e = exchange(t, e, batch, regions, walls)
        return self.inside_head(t).squeeze(1), self.link_head(e).squeeze(1)

    @torch.inference_mode()
    def predict(self, batch: Batch) -> tuple[np.ndarray, np.ndarray]:
        """`forward` in evaluation mode, as float64 arrays (T,) and (L,)."""
        device = next(self.parameters()).device
        inside, link = self.eval()(batch.to(device))
        return inside.double().cpu().numpy(), link.double().cpu().numpy()
