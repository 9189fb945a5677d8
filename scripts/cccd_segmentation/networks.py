"""The registry of segmentation networks: what each is, how wide it was published, how wide it is shipped."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from cccd.errors import InputError, nearest
from cccd.plugins import find, table

if TYPE_CHECKING:  # the workflow reads this module each time it starts
    from torch import nn


@dataclass(frozen=True)
class Network:
    """One network of the registry.

    Attributes
    ----------
    title : str
        As tables name it.
    build : str
        Path of a class (`cccd.plugins.find`), called with ``(classes, width, **sizes)``: a module that maps
        volumes (b, 1, h, w, d) to logits, with a method ``outputs(volume, labels)`` for the training: pairs
        of logits and labels, the final ones first.
    published_width : int
        The width with which its authors measured it.
    width : int
        The width that is shipped: what trains in minutes on a CPU.
    sizes : mapping
        What else is narrower than published where it is shipped.
    """

    title: str
    build: str
    published_width: int
    width: int
    sizes: Mapping[str, Any] = field(default_factory=dict[str, Any])


#: This package's own network.
NETWORKS = {
    "nnunet": Network("nnU-Net (plain)", "cccd_segmentation.plain_unet.PlainUNet", 32, 16, {"levels": 4})
}


def networks() -> dict[str, Network]:
    """Every network, by the name that rules, files and the configuration give it."""
    others = (find(path) for path in table("SEGMENTATION_NETWORKS").values())
    return dict(ChainMap(*others, NETWORKS))


def build(name: str, classes: int, width: int, sizes: Mapping[str, Any]) -> nn.Module:
    """Build a network with random weights.

    Raises
    ------
    InputError
        No such network.
    """
    known = networks()
    if name not in known:
        raise InputError("segmenter", f"there is no network {name!r}", nearest(name, known))
    return find(known[name].build)(classes, width, **sizes)


def parameters(network: nn.Module) -> int:
    """Count a network's weights.

    Examples
    --------
    >>> from torch import nn
    >>> parameters(nn.Linear(3, 2))
    8
    """
    return sum(weight.numel() for weight in network.parameters())
