"""The registry of segmentation networks: what each is, how wide it was published, how wide it is shipped."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from monai.networks.nets.dynunet import DynUNet
from torch import Tensor, nn

from cccd.errors import InputError
from cccd.segmentation.hdenseunet import HDenseUNet
from cccd.segmentation.kiunet import KiUNet3D
from cccd.segmentation.polar_unet import PolarUNet
from cccd.segmentation.unet3plus import UNet3Plus
from cccd.settings.messages import nearest

__all__ = ["NETWORKS", "Network", "Supervised", "build", "parameters"]


class Supervised(Protocol):
    """What every network of the registry has for its training."""

    def outputs(self, volume: Tensor, labels: Tensor) -> list[tuple[Tensor, Tensor]]:
        """Return pairs of logits and labels, the final ones first."""
        ...


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


@dataclass(frozen=True)
class Network:
    """One network of the registry.

    Attributes
    ----------
    title : str
        As tables name it.
    build : callable
        ``build(classes, width, **sizes)``: a module that maps volumes (b, 1, h, w, d) to logits, with a
        method ``outputs(volume, labels)`` for the training: pairs of logits and labels, the final ones first.
    published_width : int
        The width with which its authors measured it.
    width : int
        The width that is shipped: what trains in minutes on a CPU.
    sizes : mapping
        What else is narrower than published where it is shipped.
    """

    title: str
    build: Callable[..., nn.Module]
    published_width: int
    width: int
    sizes: Mapping[str, Any] = field(default_factory=dict[str, Any])


#: Every network, by the name that rules, files and the configuration give it.
NETWORKS: dict[str, Network] = {
    "polar_unet": Network("Polar U-Net", PolarUNet, 32, 9),
    "kiunet_3d": Network("KiU-Net 3D", KiUNet3D, 32, 8),
    "h_denseunet": Network(
        "H-DenseUNet", HDenseUNet, 48, 12, {"layers_2d": [3, 4, 8, 6], "layers_3d": [2, 2, 4, 3]}
    ),
    "unet_3plus": Network("UNet 3+", UNet3Plus, 64, 6),
    "nnunet": Network("nnU-Net (plain)", PlainUNet, 32, 16, {"levels": 4}),
}


def build(name: str, classes: int, width: int, sizes: Mapping[str, Any]) -> nn.Module:
    """Build a network with random weights.

    Raises
    ------
    InputError
        No such network.
    """
    if name not in NETWORKS:
        raise InputError("segmenter", f"there is no network {name!r}", nearest(name, NETWORKS))
    return NETWORKS[name].build(classes, width, **sizes)


def parameters(network: nn.Module) -> int:
    """Count a network's weights.

    Examples
    --------
    >>> parameters(nn.Linear(3, 2))
    8
    """
    return sum(weight.numel() for weight in network.parameters())
