"""What the networks that work on slices share: a volume as a batch of slices, and back."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional


def slices_of(volume: Tensor) -> Tensor:
    """Return every slice with its two neighbours as channels; the outermost slices stand twice.

    Parameters
    ----------
    volume : (b, 1, h, w, d) tensor
        Slices run along the last axis.

    Returns
    -------
    (b * d, 3, h, w) tensor

    Examples
    --------
    >>> volume = torch.arange(3.0).reshape(1, 1, 1, 1, 3)
    >>> slices_of(volume)[:, :, 0, 0]
    tensor([[0., 0., 1.],
            [0., 1., 2.],
            [1., 2., 2.]])
    """
    padded = torch.cat([volume[..., :1], volume, volume[..., -1:]], dim=-1)
    stack = padded[:, 0].permute(0, 3, 1, 2)  # (b, d + 2, h, w)
    return torch.stack([stack[:, :-2], stack[:, 1:-1], stack[:, 2:]], dim=2).flatten(0, 1)


def restack(slices: Tensor, batch: int) -> Tensor:
    """Return slices (b * d, c, h, w) as volumes (b, c, h, w, d).

    Examples
    --------
    >>> volume = torch.rand(2, 1, 4, 5, 6)
    >>> bool((restack(slices_of(volume)[:, 1:2], 2) == volume).all())
    True
    """
    return slices.unflatten(0, (batch, -1)).permute(0, 2, 3, 4, 1)


def conv_block(channels: int, width: int, bias: bool = True) -> nn.Sequential:
    """Two 3 x 3 convolutions, each with batch normalisation and a rectifier."""
    return nn.Sequential(
        nn.Conv2d(channels, width, 3, padding=1, bias=bias),
        nn.BatchNorm2d(width),
        nn.ReLU(inplace=True),
        nn.Conv2d(width, width, 3, padding=1, bias=bias),
        nn.BatchNorm2d(width),
        nn.ReLU(inplace=True),
    )


def upsample_to(features: Tensor, like: Tensor) -> Tensor:
    """Interpolate features linearly to the grid of others."""
    mode = "bilinear" if features.ndim == 4 else "trilinear"
    return functional.interpolate(features, like.shape[2:], mode=mode, align_corners=False)
