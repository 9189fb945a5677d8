"""H-DenseUNet: a DenseUNet on slices feeds a DenseUNet on the volume, and both together decide.

Li, Chen, Qi, Dou, Fu and Heng, "H-DenseUNet: hybrid densely connected UNet for liver and tumor segmentation
from CT volumes", IEEE TMI 37 (2018). The slice network is DenseNet-161 (Huang et al. 2017) with a decoder.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from cccd_paper.segmentation.slices import restack, slices_of, upsample_to

#: Dense layers of each block at the published size: slices (DenseNet-161), volume.
LAYERS_2D, LAYERS_3D = (6, 12, 36, 24), (3, 4, 12, 8)
#: Channels of the decoder's levels at the published size, by growth rate: 768/48 and so on; 504/32 and so on.
_UP_2D, _UP_3D = (16, 8, 2, 2, 4 / 3), (15.75, 7, 6, 3, 2)

_CONV = {2: nn.Conv2d, 3: nn.Conv3d}
_NORM = {2: nn.BatchNorm2d, 3: nn.BatchNorm3d}
_MAX = {2: nn.MaxPool2d, 3: nn.MaxPool3d}
_MEAN = {2: nn.AvgPool2d, 3: nn.AvgPool3d}


def _rectified(dim: int, channels: int, *convolution: nn.Module) -> nn.Sequential:
    """Normalisation and rectifier before a convolution."""
    return nn.Sequential(_NORM[dim](channels), nn.ReLU(inplace=True), *convolution)


class DenseBlock(nn.Module):
    """Layers each of which reads all before it: a 1 x 1 convolution to four times the growth, a 3 x 3 one."""

    def __init__(self, dim: int, channels: int, growth: int, layers: int) -> None:
        super().__init__()
        conv, self.layers = _CONV[dim], nn.ModuleList()
        for layer in range(layers):
            read = channels + layer * growth
            squeeze = _rectified(dim, read, conv(read, 4 * growth, 1, bias=False))
            grow = _rectified(dim, 4 * growth, conv(4 * growth, growth, 3, padding=1, bias=False))
            self.layers.append(nn.Sequential(squeeze, grow))

    def forward(self, x: Tensor) -> Tensor:
        """Append what each layer finds to the channels."""
        for layer in self.layers:
            x = torch.cat([x, layer(x)], dim=1)
        return x


class DenseEncoder(nn.Module):
    """DenseNet without its classifier; gives the features before every halving of the grid.

    Parameters
    ----------
    dim : int
        2 or 3. In 3D the blocks' transitions halve in the plane only.
    channels : int
        Of the input.
    growth : int
        Channels that a layer adds; the stem has twice as many in 2D (96 of 48), three times in 3D (96 of 32).
    layers : sequence of int
        Of each block.
    """

    def __init__(self, dim: int, channels: int, growth: int, layers: Sequence[int]) -> None:
        super().__init__()
        width = dim * growth
        self.widths = [width]
        conv = _CONV[dim]
        self.stem = nn.Sequential(
            conv(channels, width, 7, stride=2, padding=3, bias=False),
            _NORM[dim](width),
            nn.ReLU(inplace=True),
        )
        self.pool = _MAX[dim](3, stride=2, padding=1)
        self.blocks, self.transitions = nn.ModuleList(), nn.ModuleList()
        half = 2 if dim == 2 else (2, 2, 1)
        for index, count in enumerate(layers):
            self.blocks.append(DenseBlock(dim, width, growth, count))
            width += count * growth
            self.widths.append(width)
            if index < len(layers) - 1:
                narrow = conv(width, width // 2, 1, bias=False)
                self.transitions.append(_rectified(dim, width, narrow, _MEAN[dim](half, ceil_mode=True)))
                width //= 2
        self.end = _rectified(dim, width)

    def forward(self, x: Tensor) -> list[Tensor]:
        """Return features from the finest (half the input's size) to the coarsest."""
        features = [self.stem(x)]
        x = self.pool(features[0])
        for index, block in enumerate(self.blocks):
            x = block(x)
            features.append(x)
            if index < len(self.transitions):
                x = self.transitions[index](x)
        return [*features[:-1], self.end(features[-1])]


class DenseUNet(nn.Module):
    """A dense encoder and a decoder that adds the encoder's features, level by level.

    Parameters
    ----------
    dim, channels, growth, layers
        As for `DenseEncoder`.
    ups : sequence of float
        Channels of the decoder's five levels, by the growth rate.
    """

    def __init__(
        self, dim: int, channels: int, growth: int, layers: Sequence[int], ups: Sequence[float]
    ) -> None:
        super().__init__()
        self.encoder = DenseEncoder(dim, channels, growth, layers)
        conv, deep = _CONV[dim], self.encoder.widths[-1]
        skips = self.encoder.widths[-2::-1]
        self.skips, self.up = nn.ModuleList(), nn.ModuleList()
        for level, up in enumerate(ups):
            width = max(8, round(up * growth))
            if level < len(skips):
                self.skips.append(conv(skips[level], deep, 1))
            block = conv(deep, width, 3, padding=1)
            self.up.append(nn.Sequential(block, _NORM[dim](width), nn.ReLU(inplace=True)))
            deep = width
        self.width = deep

    def forward(self, x: Tensor) -> Tensor:
        """Map slices or volumes to features of the same size."""
        *skips, features = self.encoder(x)
        for skip, source, block in zip(self.skips, skips[::-1], self.up, strict=False):
            features = block(upsample_to(features, source) + skip(source))
        return self.up[-1](upsample_to(features, x))


class HDenseUNet(nn.Module):
    """The slice network's logits go into the volume network beside the image; their features are fused.

    Parameters
    ----------
    classes : int
        Labels, the background among them.
    width : int
        Growth rate of the slice network (published: 48); the volume network has two thirds of it.
    layers_2d, layers_3d : sequence of int
        Dense layers per block, published ones by default.
    """

    def __init__(
        self,
        classes: int,
        width: int,
        layers_2d: Sequence[int] = LAYERS_2D,
        layers_3d: Sequence[int] = LAYERS_3D,
    ) -> None:
        super().__init__()
        growth_3d = max(1, width * 2 // 3)
        self.slices = DenseUNet(2, 3, width, layers_2d, _UP_2D)
        self.slice_head = nn.Conv2d(self.slices.width, classes, 1)
        self.volume = DenseUNet(3, 1 + classes, growth_3d, layers_3d, _UP_3D)
        fused = self.volume.width
        self.align = nn.Conv3d(self.slices.width, fused, 1)
        self.fuse = nn.Sequential(
            nn.Conv3d(fused, fused, 3, padding=1), nn.BatchNorm3d(fused), nn.ReLU(inplace=True)
        )
        self.head = nn.Conv3d(fused, classes, 1)

    def outputs(self, volume: Tensor, labels: Tensor) -> list[tuple[Tensor, Tensor]]:
        """Return (logits, labels) of the fusion and of the slice network."""
        return [(logits, labels) for logits in self._all(volume)]

    def forward(self, volume: Tensor) -> Tensor:
        """Map volumes (b, 1, h, w, d) to logits (b, classes, h, w, d)."""
        return self._all(volume)[0]

    def _all(self, volume: Tensor) -> list[Tensor]:
        features = self.slices(slices_of(volume))
        early = restack(self.slice_head(features), len(volume))
        deep = self.volume(torch.cat([volume, early.softmax(dim=1)], dim=1))
        together = self.fuse(deep + self.align(restack(features, len(volume))))
        return [self.head(together), early]
