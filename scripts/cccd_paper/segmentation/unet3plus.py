"""UNet 3+: every level of the decoder reads every scale of the encoder and of the decoder above it.

Huang, Lin, Tong, Hu, Zhang, Iwamoto, Han, Chen and Wu, "UNet 3+: a full-scale connected UNet for medical
image segmentation", ICASSP (2020).
"""

from __future__ import annotations

from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from cccd_paper.segmentation.slices import conv_block, restack, slices_of, upsample_to

#: Levels of the encoder and, but for the deepest, of the decoder.
_LEVELS = 5


def _read(channels: int, width: int) -> nn.Sequential:
    conv = nn.Conv2d(channels, width, 3, padding=1)
    return nn.Sequential(conv, nn.BatchNorm2d(width), nn.ReLU(inplace=True))


class UNet3Plus(nn.Module):
    """A slice network with full-scale skip connections and deep supervision at five levels.

    Parameters
    ----------
    classes : int
        Labels, the background among them.
    width : int
        Channels of the first level, and those that the decoder takes of each scale.
    """

    def __init__(self, classes: int, width: int) -> None:
        super().__init__()
        widths, fused = [width * 2**level for level in range(_LEVELS)], width * _LEVELS
        self.down = nn.ModuleList(map(conv_block, [3, *widths[:-1]], widths))
        # decoder level `to` reads encoder levels up to its own, and the decoder's (or the deepest) below it
        self.read = nn.ModuleList(
            nn.ModuleList(
                _read(widths[scale] if scale <= to or scale == _LEVELS - 1 else fused, width)
                for scale in range(_LEVELS)
            )
            for to in range(_LEVELS - 1)
        )
        self.fuse = nn.ModuleList(_read(fused, fused) for _ in range(_LEVELS - 1))
        self.heads = nn.ModuleList(
            nn.Conv2d(n, classes, 3, padding=1) for n in [fused] * (_LEVELS - 1) + [widths[-1]]
        )

    def outputs(self, volume: Tensor, labels: Tensor) -> list[tuple[Tensor, Tensor]]:
        """Return (logits, labels) of the five levels, the finest first."""
        return [(logits, labels) for logits in self._all(volume, _LEVELS)]

    def forward(self, volume: Tensor) -> Tensor:
        """Map volumes (b, 1, h, w, d) to logits (b, classes, h, w, d), h and w of 16 at least."""
        return self._all(volume, 1)[0]

    def _all(self, volume: Tensor, count: int) -> list[Tensor]:
        x = slices_of(volume)
        levels: list[Tensor] = []
        for block in self.down:
            x = block(functional.max_pool2d(x, 2, ceil_mode=True) if levels else x)
            levels.append(x)
        for to in range(_LEVELS - 2, -1, -1):
            grid = levels[to]
            parts = [
                read(_moved(features, grid))
                for read, features in zip(cast(nn.ModuleList, self.read[to]), levels, strict=True)
            ]
            levels[to] = self.fuse[to](torch.cat(parts, dim=1))
        heads = zip(self.heads[:count], levels, strict=False)
        return [restack(upsample_to(head(features), levels[0]), len(volume)) for head, features in heads]


def _moved(features: Tensor, grid: Tensor) -> Tensor:
    """Move features to another level's grid: the maximum over what becomes one pixel, or interpolation."""
    if features.shape[2] > grid.shape[2]:
        return functional.adaptive_max_pool2d(features, grid.shape[2:])
    return features if features.shape == grid.shape else upsample_to(features, grid)
