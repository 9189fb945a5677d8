"""What the evidence adds to the product: see `cccd.additions`."""

from __future__ import annotations

from cccd.additions import add
from cccd.segmentation.networks import Network
from cccd.settings.section import setting
from cccd_paper.registry import INPUTS, ITEMS, SECTIONS
from cccd_paper.settings import ComparisonSettings

__all__ = ["register"]

_NETWORKS = {
    "polar_unet": Network("Polar U-Net", "cccd_paper.segmentation.polar_unet.PolarUNet", 32, 9),
    "kiunet_3d": Network("KiU-Net 3D", "cccd_paper.segmentation.kiunet.KiUNet3D", 32, 8),
    "h_denseunet": Network(
        "H-DenseUNet",
        "cccd_paper.segmentation.hdenseunet.HDenseUNet",
        48,
        12,
        {"layers_2d": [3, 4, 8, 6], "layers_3d": [2, 2, 4, 3]},
    ),
    "unet_3plus": Network("UNet 3+", "cccd_paper.segmentation.unet3plus.UNet3Plus", 64, 6),
}


def register() -> None:
    """Add all of it."""
    add("junction network", "paper", "cccd_paper.junctions.network.PaperNetwork")
    add("junction training", "paper", "cccd_paper.junctions.training.PaperTask")
    for name, network in _NETWORKS.items():
        add("segmentation network", name, network)
    default = setting(
        ComparisonSettings(), "the other methods, on the same structures", why="The paper's tables."
    )
    add("settings", "comparisons", (ComparisonSettings, default))
    for key, section in SECTIONS.items():
        add("report section", key, section)
    for name, needed in INPUTS.items():
        add("report input", name, needed)
    for item in ITEMS:
        add("report item", item.key, item)
