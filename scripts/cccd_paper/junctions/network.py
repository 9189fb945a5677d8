"""The paper's network: eq. (11) on the pixel grid, and link prediction (section 4.2).

The paper prints the convolution, the features, the labels and the dropout. It prints neither depth nor width
nor how a link's value comes from its two pixels: those are ours (`cccd.settings.junctions.PaperSettings`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor, nn
from torch_geometric.data import Batch, Data

from cccd.geometry.arrays import AnyArray, FloatArray, IntArray
from cccd.junctions.layers import EquationEleven, both_ways
from cccd_paper.junctions.grid import GridGraph, chain_loops

__all__ = ["PaperNetwork", "grid_data"]


def grid_data(grid: GridGraph) -> Data:
    """Make a graph for PyTorch Geometric: features +1 and -1, links both ways, candidates to be predicted."""
    return Data(
        x=torch.as_tensor(np.where(grid.observed, 1, -1)[:, None], dtype=torch.float32),
        edge_index=both_ways(torch.as_tensor(np.ascontiguousarray(grid.links.T))),
        edge_label_index=torch.as_tensor(np.ascontiguousarray(grid.candidates.T)),
    )


class PaperNetwork(nn.Module):
    """Values between -1 and +1 of links between neighbouring boundary pixels.

    Parameters
    ----------
    width : int
        Channels of a pixel.
    layers : int
        Convolutions of eq. (11) one after another.
    dropout : float
    """

    kind = "paper"

    def __init__(self, width: int, layers: int, dropout: float):
        super().__init__()
        self.sizes: dict[str, int | float] = {"width": width, "layers": layers, "dropout": dropout}
        self.layers = nn.ModuleList(EquationEleven(width if n else 1, width, dropout) for n in range(layers))
        self.link_head = nn.Linear(2 * width, 1)

    def forward(self, data: Data) -> Tensor:
        """Value (C,) of every candidate, the same in both directions."""
        x: Tensor = data.x
        for layer in self.layers:
            x = layer(x, data.edge_index)
        one, other = (x.index_select(0, end) for end in data.edge_label_index)
        return torch.tanh(self.link_head(torch.cat([one + other, (one - other).abs()], dim=1))).squeeze(1)

    @torch.inference_mode()
    def link_scores(self, grids: Sequence[GridGraph]) -> list[FloatArray]:
        """`forward` in evaluation mode, as float64 arrays (C,): see `LinkPredictor`."""
        batch = Batch.from_data_list([grid_data(grid) for grid in grids])
        values = self.eval()(batch.to(next(self.parameters()).device)).double().cpu()
        return [part.numpy() for part in values.split([len(grid.candidates) for grid in grids])]

    def find_loops(self, maps: Sequence[AnyArray]) -> list[list[IntArray]]:
        """Follow the closed chains of every map (N, 2): what `cccd.junctions.inference` asks for."""
        return chain_loops(maps, self)
