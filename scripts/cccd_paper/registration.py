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


#: Where the printed figures contradict each other, by the table or figure that shows them.
_CONTRADICTIONS = {
    "table1": "716 corners of which 232 lie on the boundary are 67.6 % false, not 67.5 %; section 6.1 "
    "counts 101 Harris corners on the boundary where Table 1 has 232.",
    "table2": "the same fused methods score 87.54, 79.75 and 93.15 % in section 6.1 and 95.4, 73 and 88.4 % "
    "in Table 2, the last two with the same number of points.",
    "table3": "k = 7 uses more points (217) than k = 3 (189), while Figure 10 has 102 against 156, and "
    "k = 12 scores higher than k = 7, while Figure 13 has Dice falling with k. 483 boundary pixels at the "
    "paper's 8 bytes a point are 3.8 KB, not 19.2 KB: the saving compares points with an image. nnU-Net's "
    "88.95 % is for tumours, not for the whole brain.",
    "figure10": "for k = 5 the text has 121 points, the caption 105.",
    "training": "40 validation graphs of 290 are 14 %, not 5 %.",
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
    for key, sentence in _CONTRADICTIONS.items():
        add("report remark", key, f"In the paper itself: {sentence}")
