"""The segmentation networks of Table 3."""

from cccd_segmentation.networks import Network

__all__ = ["NETWORKS"]

#: As `cccd_segmentation.networks.NETWORKS`.
NETWORKS = {
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
