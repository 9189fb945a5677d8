"""nnU-Net's plain network."""

from __future__ import annotations

from monai.networks.nets.dynunet import DynUNet
from torch import Tensor, nn


class PlainUNet(nn.Module):
    """The plain 3D U-Net of nnU-Net (Isensee et al. 2021), MONAI's ``DynUNet``.

    Parameters
    ----------
    classes : int
        Labels, the background among them.
    width : int
        Channels of the first level; they double, up to ten times as many.
    levels : int
        Of the grid.
    """

    def __init__(self, classes: int, width: int, levels: int = 6) -> None:
        super().__init__()
        self.net = DynUNet(
            3,
            1,
            classes,
            kernel_size=[3] * levels,
            strides=[1] + [2] * (levels - 1),
            upsample_kernel_size=[2] * (levels - 1),
            filters=[min(width * 2**level, 10 * width) for level in range(levels)],
            norm_name=("INSTANCE", {"affine": True}),
        )

    def outputs(self, volume: Tensor, labels: Tensor) -> list[tuple[Tensor, Tensor]]:
        """Return (logits, labels)."""
        return [(self.net(volume), labels)]

    def forward(self, volume: Tensor) -> Tensor:
        """Map volumes (b, 1, h, w, d) to logits (b, classes, h, w, d); sizes multiples of 2^(levels - 1)."""
        return self.net(volume)
