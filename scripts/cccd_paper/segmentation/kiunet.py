"""KiU-Net 3D: a U-Net beside an overcomplete branch that goes to a finer grid instead of a coarser one.

Valanarasu, Sindagi, Hacihaliloglu and Patel, "KiU-Net: overcomplete convolutional architectures for
biomedical image and volumetric segmentation", IEEE TMI (2021); sizes as in its network for LiTS.
"""

from __future__ import annotations

from torch import Tensor, nn
from torch.nn import functional

from cccd_paper.segmentation.slices import upsample_to


def _conv(channels: int, width: int) -> nn.Conv3d:
    return nn.Conv3d(channels, width, 3, padding=1)


def _normal(features: Tensor) -> Tensor:
    single = features.shape[2:].numel() == 1  # has no variance: the deepest level of the smallest patch
    return functional.relu(features if single else functional.instance_norm(features))


def _pool_to(features: Tensor, like: Tensor) -> Tensor:
    """Means of features over what becomes a voxel of another grid."""
    height, width, depth = like.shape[2:]
    return functional.adaptive_avg_pool3d(features, (height, width, depth))


class CrossResidualFusion(nn.Module):
    """Give each branch what the other has: a convolution, moved to its grid, added."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.to_coarse, self.to_fine = _conv(width, width), _conv(width, width)

    def forward(self, coarse: Tensor, fine: Tensor) -> tuple[Tensor, Tensor]:
        """Map features of the U-Net and of the overcomplete branch to what they are together."""
        return (
            coarse + _pool_to(_normal(self.to_coarse(fine)), coarse),
            fine + upsample_to(_normal(self.to_fine(coarse)), fine),
        )


class KiUNet3D(nn.Module):
    """Five poolings with twice the channels after each, beside one level of twice the in-plane size.

    Parameters
    ----------
    classes : int
        Labels, the background among them.
    width : int
        Channels of the first level.

    Notes
    -----
    Skips are added, not concatenated. Training sees four outputs, three from coarser levels. Instance
    normalisation, which has no parameters, stands before the rectifiers: the published network has none, and
    does not learn in the steps that are taken here. The features that the classes are made of keep their
    signs: the published network, of one class, rectifies them, and a second class was never found so.
    """

    def __init__(self, classes: int, width: int) -> None:
        super().__init__()
        widths = [width * 2**level for level in range(5)]
        self.down = nn.ModuleList(map(_conv, [1, *widths[:-1]], widths))
        self.up = nn.ModuleList(map(_conv, widths[:0:-1], widths[-2::-1]))
        self.fine = _conv(1, width)
        self.early, self.late = CrossResidualFusion(width), CrossResidualFusion(width)
        self.last, self.fine_last = _conv(width, 2 * classes), _conv(width, 2 * classes)
        self.head = nn.Conv3d(2 * classes, classes, 1)
        self.coarse_heads = nn.ModuleList(nn.Conv3d(n, classes, 1) for n in widths[-2:0:-1])

    def outputs(self, volume: Tensor, labels: Tensor) -> list[tuple[Tensor, Tensor]]:
        """Return (logits, labels) of the four outputs, the final one first."""
        return [(logits, labels) for logits in self._all(volume)]

    def forward(self, volume: Tensor) -> Tensor:
        """Map volumes (b, 1, h, w, d) to logits (b, classes, h, w, d); sizes of 32 at least."""
        return self._all(volume)[0]

    def _all(self, volume: Tensor) -> list[Tensor]:
        height, width, depth = volume.shape[2:]
        x = _normal(functional.max_pool3d(self.down[0](volume), 2, ceil_mode=True))
        fine = functional.interpolate(self.fine(volume), (2 * height, 2 * width, depth), mode="trilinear")
        x, fine = self.early(x, _normal(fine))
        skips = [x]
        for conv in self.down[1:]:
            x = _normal(functional.max_pool3d(conv(x), 2, ceil_mode=True))
            skips.append(x)
        coarse: list[Tensor] = []
        for level, (conv, skip) in enumerate(zip(self.up, skips[-2::-1], strict=True)):
            x = _normal(upsample_to(conv(x), skip)) + skip
            if level < len(self.coarse_heads):
                coarse.append(upsample_to(self.coarse_heads[level](x), volume))
        x, fine = self.late(x, fine)
        x = upsample_to(self.last(x), volume) + _pool_to(self.fine_last(fine), volume)
        return [self.head(x), *coarse]
