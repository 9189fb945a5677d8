"""The paper's network: eq. (11) in Spektral's `GeneralGNN`, and link prediction (section 4.2).

The paper prints the convolution, the features, the labels and the dropout, and names Spektral. Sizes are
chosen in `cccd_networks.settings`. How a link's value comes from its two nodes is not printed: here the last
MLP reads their sum and the size of their difference, which are the same in both directions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor, nn
from torch_geometric.data import Batch, Data

from cccd.geometry.arrays import AnyArray, FloatArray, IntArray
from cccd_paper.junctions.general_gnn import MESSAGE_PASSING, POST_PROCESS, PRE_PROCESS, GeneralGNN, mlp
from cccd_paper.junctions.grid import GridGraph, chain_loops


def link_data(features: FloatArray, links: IntArray, candidates: IntArray) -> Data:
    """Make a graph for PyTorch Geometric.

    Parameters
    ----------
    features : (N, F)
    links : (L, 2)
        Messages run both ways along them, and stand receiver by receiver.
    candidates : (C, 2)
        Links that are to be predicted.
    """
    edges = np.concatenate([links, links[:, ::-1]])
    edges = edges[np.argsort(edges[:, 1], kind="stable")]
    return Data(
        x=torch.as_tensor(features, dtype=torch.float32),
        edge_index=torch.as_tensor(np.ascontiguousarray(edges.T, np.int64)),
        edge_label_index=torch.as_tensor(np.ascontiguousarray(candidates.T, np.int64)),
    )


def grid_data(grid: GridGraph) -> Data:
    """Make a graph of pixels: features +1 and -1, links of boundary pixels to be predicted."""
    return link_data(np.where(grid.observed, 1.0, -1.0)[:, None], grid.links, grid.candidates)


class PaperNetwork(nn.Module):
    """Values between -1 and +1 of links.

    Parameters
    ----------
    channels : int
    dropout : float
    features : int
        Channels of a node's input.
    """

    kind = "paper"

    def __init__(self, channels: int, dropout: float, features: int = 1):
        super().__init__()
        self.sizes: dict[str, int | float] = {"channels": channels, "dropout": dropout, "features": features}
        self.nodes = GeneralGNN(features, channels, MESSAGE_PASSING, PRE_PROCESS, dropout)
        self.links = mlp(2 * self.nodes.width_out, channels, 1, POST_PROCESS, dropout, nn.Tanh())

    def forward(self, data: Data) -> Tensor:
        """Value (C,) of every candidate, the same in both directions."""
        x = self.nodes(data.x, data.edge_index)
        one, other = (x.index_select(0, end) for end in data.edge_label_index)
        return self.links(torch.cat([one + other, (one - other).abs()], dim=1)).squeeze(1)

    @torch.inference_mode()
    def values(self, graphs: Sequence[Data]) -> list[FloatArray]:
        """`forward` of several graphs in evaluation mode, as float64 arrays (C,)."""
        batch = Batch.from_data_list(list(graphs)).to(next(self.parameters()).device)
        found = self.eval()(batch).double().cpu()
        return [part.numpy() for part in found.split([graph.edge_label_index.shape[1] for graph in graphs])]

    def link_scores(self, grids: Sequence[GridGraph]) -> list[FloatArray]:
        """Scores (C,) of the links of every grid: see `LinkPredictor`."""
        return self.values([grid_data(grid) for grid in grids])

    def find_loops(self, maps: Sequence[AnyArray]) -> list[list[IntArray]]:
        """Follow the closed chains of every map (N, 2): what `cccd_junctions.inference` asks for."""
        return chain_loops(maps, self)
