"""The junction network: which links are true, and which triangles are inside."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import torch
from torch import Tensor, nn

from cccd.junctions.batch import CORNER_WIDTH, GraphBatch, make_batch
from cccd.junctions.delaunay import DelaunayGraph
from cccd.junctions.energy import Logits
from cccd.junctions.features import LINKS, NODES, TRIANGLES
from cccd.junctions.intensity import IntensitySlice
from cccd.junctions.layers import GatedConvolution, MessageLayer, RowGroups

__all__ = ["JunctionNetwork"]

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
        self.pixel_layers = nn.ModuleList(
            GatedConvolution(width, width, dropout, heads) for _ in range(pixel_layers)
        )
        # parts of a link's gates that are the same, and that change sign, for its two directions
        self.even_gates = nn.ModuleList(nn.Linear(LINKS.width, heads) for _ in range(pixel_layers))
        self.odd_gates = nn.ModuleList(nn.Linear(2, heads, bias=False) for _ in range(pixel_layers))
        self.corner_layer = GatedConvolution(width, width, dropout, heads)
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

    def forward(self, batch: GraphBatch) -> tuple[Tensor, Tensor]:
        """Logits that a triangle (T,) is inside and that a link (L,) is true."""
        features = self.link_encoder[0](batch.links)  # normalised: gates read the same
        x = self._pixel_states(batch, features)
        t = self.triangle_encoder(batch.triangles)
        t = t + self.corner_layer.over_sides(x, batch.corners, self.corner_gate(batch.corner_direction))
        ends = self.end_encoder(x)
        first, second = batch.link_nodes
        e = self.link_encoder[1](features) + ends.index_select(0, first) + ends.index_select(0, second)
        regions, link_groups = (
            [RowGroups.of(number) for number in part] for part in (batch.regions, batch.link_groups)
        )
        for layer in self.message_layers:
            t, e = layer(t, e, batch, regions, link_groups)
        return self.inside_head(t).squeeze(1), self.link_head(e).squeeze(1)

    def _pixel_states(self, batch: GraphBatch, link_features: Tensor) -> Tensor:
        """States of the pixels (V, width) after their own layers."""
        x: Tensor = self.pixel_encoder(batch.nodes.float() / 255)
        first, second = batch.link_nodes
        source, target = torch.cat([first, second]), torch.cat([second, first])
        for module, even, odd in zip(self.pixel_layers, self.even_gates, self.odd_gates, strict=True):
            layer = cast(GatedConvolution, module)
            both, turned = even(link_features), odd(batch.link_direction)
            x = x + layer.along_links(x, source, target, torch.cat([both + turned, both - turned]))
        return x

    @torch.inference_mode()
    def predict(self, batch: GraphBatch) -> Logits:
        """`forward` in evaluation mode, as float64 arrays (T,) and (L,)."""
        device = next(self.parameters()).device
        inside, link = self.eval()(batch.to(device))
        return inside.double().cpu().numpy(), link.double().cpu().numpy()

    def logits(self, graph: DelaunayGraph, intensities: Sequence[IntensitySlice | None]) -> Logits:
        """Logits of a batch of slices: what `cccd.junctions.inference` asks a predictor for."""
        return self.predict(make_batch(graph, intensities))
