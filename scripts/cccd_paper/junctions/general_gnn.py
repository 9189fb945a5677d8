"""`GeneralGNN` of Spektral 1.x on PyTorch Geometric: the design that eq. (11) is taken from.

Eq. (11) is Spektral's `GeneralConv` letter for letter, and section 4.3 names Spektral. Both come from You,
Ying and Leskovec (Design space for graph neural networks, NeurIPS 2020). `CHANNELS` and the numbers of layers
are the defaults of Spektral's `GeneralGNN`.
"""

from __future__ import annotations

from collections import OrderedDict

import torch
from torch import Tensor, nn

from cccd_junctions.layers import EquationEleven

#: Defaults of Spektral's `GeneralGNN`.
CHANNELS, MESSAGE_PASSING, PRE_PROCESS, POST_PROCESS = 256, 4, 2, 2

#: Keras adds this to variances.
EPSILON = 1e-3


def _prelu(channels: int) -> nn.PReLU:
    # Keras has a slope for each channel, and begins with 0
    return nn.PReLU(channels, init=0.0)


class GeneralConv(EquationEleven):
    """Eq. (11) with PReLU as Act: Spektral's `GeneralConv`."""

    def __init__(self, width_in: int, width_out: int, dropout: float):
        super().__init__(width_in, width_out, dropout)
        self.norm = nn.BatchNorm1d(width_out, EPSILON)
        self.activation = _prelu(width_out)

    def sent(self, x: Tensor) -> Tensor:
        """``PReLU(Dropout(BN(x W + b)))`` of every node."""
        return self.activation(self.dropout(self.norm(self.dense(x))))


def mlp(
    width_in: int, width: int, width_out: int, layers: int, dropout: float, last: nn.Module
) -> nn.Sequential:
    """Layers ``Act(Dropout(BN(x W + b)))`` of Spektral's `MLP`; ``last`` is the activation at the end."""
    parts: OrderedDict[str, nn.Module] = OrderedDict()
    for n in range(layers):
        final = n == layers - 1
        size = width_out if final else width
        parts |= {
            f"dense_{n}": nn.Linear(width if n else width_in, size),
            f"norm_{n}": nn.BatchNorm1d(size, EPSILON),
            f"dropout_{n}": nn.Dropout(dropout),
            f"activation_{n}": last if final else _prelu(size),
        }
    return nn.Sequential(parts)


class GeneralGNN(nn.Module):
    """Layers before, convolutions with skips by concatenation: Spektral's `GeneralGNN` up to its last MLP.

    Parameters
    ----------
    features : int
        Channels of a node's input.
    channels, message_passing, pre_process : int
    dropout : float
    """

    def __init__(
        self,
        features: int,
        channels: int = CHANNELS,
        message_passing: int = MESSAGE_PASSING,
        pre_process: int = PRE_PROCESS,
        dropout: float = 0.0,
    ):
        super().__init__()
        self.pre = mlp(features, channels, channels, pre_process, dropout, _prelu(channels))
        self.layers = nn.ModuleList(
            GeneralConv(channels * (n + 1), channels, dropout) for n in range(message_passing)
        )
        self.width_out = channels * (message_passing + 1)

    def forward(self, x: Tensor, edge_index: Tensor) -> Tensor:
        """States (N, ``width_out``) of nodes with features (N, F) and edges (2, E)."""
        out = self.pre(x)
        for layer in self.layers:
            out = torch.cat([layer(out, edge_index), out], dim=1)
        return out
