"""The junction network: which links are true, and which triangles are inside."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from functools import cached_property

import torch
from torch import Tensor, nn
from torch_geometric.data import Batch, HeteroData

from cccd_junctions.energy import Logits
from cccd_junctions.features import LINKS, NODES, TRIANGLES
from cccd_junctions.graph_data import CORNER_WIDTH, CORNERS, PIXEL_LINKS, make_data
from cccd_junctions.layers import EquationEleven, MessageLayer, both_ways, sum_of_ends
from cccd_junctions.observation import ObservedSlice

# Hidden channels that encode a pixel's surroundings, for each channel of its state.
_HIDDEN = 6


class JunctionNetwork(nn.Module):
    """Logits of links and of triangles.

    Pixels encode their surroundings once and exchange messages along the Delaunay links by gated
    convolutions of eq. (11); triangles gather their corners, then exchange messages with their neighbours by
    the same convolution, gated by the state of the link between them. Means over regions, over the walls
    between them, and over branches and good-continuation groups carry a message across any distance in one
    step.

    Parameters
    ----------
    width : int
        Channels of pixels and triangles; a multiple of ``heads``.
    link_width : int
        Channels of links.
    pixel_layers, message_layers : int
        Message-passing layers on pixels, and on triangles and links.
    heads : int
        Gate values per link.
    dropout : float
    """

    def __init__(
        self,
        width: int = 32,
        link_width: int = 24,
        pixel_layers: int = 2,
        message_layers: int = 4,
        heads: int = 8,
        dropout: float = 0.0,
    ):
        super().__init__()
        self.sizes: dict[str, int | float] = {
            "width": width,
            "link_width": link_width,
            "pixel_layers": pixel_layers,
            "message_layers": message_layers,
            "heads": heads,
            "dropout": dropout,
        }
        self.pixel_encoder = nn.Sequential(
            nn.Linear(NODES.width, _HIDDEN * width),
            nn.BatchNorm1d(_HIDDEN * width),
            nn.ReLU(),
            nn.Linear(_HIDDEN * width, width),
        )
        self.pixel_layers = nn.ModuleList(EquationEleven(width, width, dropout) for _ in range(pixel_layers))
        # parts of a link's gates that are the same, and that change sign, for its two directions
        self.even_gates = nn.ModuleList(nn.Linear(LINKS.width, heads) for _ in range(pixel_layers))
        self.odd_gates = nn.ModuleList(nn.Linear(2, heads, bias=False) for _ in range(pixel_layers))
        self.corner_layer = EquationEleven(width, width, dropout)
        self.corner_gate = nn.Linear(CORNER_WIDTH, heads)
        self.triangle_encoder = nn.Sequential(
            nn.BatchNorm1d(TRIANGLES.width), nn.Linear(TRIANGLES.width, width)
        )
        self.link_encoder = nn.Sequential(nn.BatchNorm1d(LINKS.width), nn.Linear(LINKS.width, link_width))
        self.end_encoder = nn.Linear(width, link_width)
        self.message_layers = nn.ModuleList(
            MessageLayer(width, link_width, heads, dropout) for _ in range(message_layers)
        )
        self.inside_head = nn.Sequential(
            nn.BatchNorm1d(width), nn.ReLU(), nn.Linear(width, width), nn.ReLU(), nn.Linear(width, 1)
        )
        self.link_head = nn.Sequential(nn.BatchNorm1d(link_width), nn.ReLU(), nn.Linear(link_width, 1))

    def forward(self, data: HeteroData) -> tuple[Tensor, Tensor]:
        """Logits that a triangle (T,) is inside and that a link (L,) is true, of a `Batch` of slices."""
        features = self.link_encoder[0](data["link"].x)  # normalised: gates read the same
        x = self._pixel_states(data, features)
        t = self.triangle_encoder(data["triangle"].x)
        corners = data[CORNERS]
        t = t + self.corner_layer(x, corners.edge_index, self.corner_gate(corners.edge_attr), len(t))
        ends = data[PIXEL_LINKS].edge_index
        e = self.link_encoder[1](features) + sum_of_ends(self.end_encoder(x), ends)
        for layer in self.message_layers:
            t, e = layer(t, e, data)
        return self.inside_head(t).squeeze(1), self.link_head(e).squeeze(1)

    def _pixel_states(self, data: HeteroData, link_features: Tensor) -> Tensor:
        """States of the pixels (V, width) after their own layers."""
        x: Tensor = self.pixel_encoder(data["pixel"].x.float().div_(255))
        edges = both_ways(data[PIXEL_LINKS].edge_index)
        for layer, even, odd in zip(self.pixel_layers, self.even_gates, self.odd_gates, strict=True):
            both, turned = even(link_features), odd(data["link"].direction)
            gates = torch.stack([both + turned, both - turned], dim=1).flatten(0, 1)
            x = x + layer(x, edges, gates)
        return x

    @cached_property
    def weights_sha256(self) -> str:
        """SHA-256 of the weights: what `cccd_junctions.uncertainty` guarantees holds for some only."""
        values = [value.cpu().numpy().tobytes() for value in self.state_dict().values()]
        return hashlib.sha256(b"".join(values)).hexdigest()

    @torch.inference_mode()
    def predict(self, slices: Sequence[HeteroData]) -> list[Logits]:
        """`forward` in evaluation mode, as float64 arrays (T,) and (L,) of every slice."""
        batch = Batch.from_data_list(slices).to(next(self.parameters()).device)
        inside, link = (part.double().cpu() for part in self.eval()(batch))
        triangles, links = ([data[name].num_nodes for data in slices] for name in ("triangle", "link"))
        return [
            (one.numpy(), other.numpy())
            for one, other in zip(inside.split(triangles), link.split(links), strict=True)
        ]

    def logits(self, slices: Sequence[ObservedSlice]) -> list[Logits]:
        """Logits of some slices: what `cccd_junctions.inference` asks a predictor for."""
        return self.predict([make_data(observed.graph, observed.intensity) for observed in slices])
