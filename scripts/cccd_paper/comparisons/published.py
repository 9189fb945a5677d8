"""Figures as printed: the paper's Tables 1-5, and the segmentation networks it quotes.

Nothing here is measured. A network's figure comes from another task on other data (grey images, where the
paper's CCCD starts from the true boundary) and is marked so wherever it is shown.
"""

from __future__ import annotations

import pandas as pd

#: What stands beside every network's figure.
OTHER_DATA = "published figure, other data"

TABLE_1 = pd.DataFrame(
    [("harris", 716, 232, 67.5), ("shi_tomasi", 53, 11, 79.24), ("fast", 212, 212, 0.0)],
    columns=["detector", "corners", "on_boundary", "false_percent"],
)

#: Table 2, and Figure 9 with the text of section 6.1, which differ for the same three methods.
TABLE_2 = pd.DataFrame(
    [
        ("harris", "paper, Table 2", 95.4, 232),
        ("harris", "paper, Figure 9", 87.54, 101),
        ("shi_tomasi", "paper, Table 2", 73.0, 11),
        ("shi_tomasi", "paper, Figure 9", 79.75, 11),
        ("fast", "paper, Table 2", 88.4, 212),
        ("fast", "paper, Figure 9", 93.15, 212),
        ("cccd", "k = 3", 98.49, 156),
        ("cccd", "k = 5", 95.83, 121),
        ("cccd", "k = 7", 96.00, 102),
        ("cccd", "k = 20", 88.75, 67),
    ],
    columns=["detector", "parameters", "dice_percent", "control_points"],
)

#: The organ of Table 3's scans.
TABLE_3_ORGAN = "liver"

TABLE_3 = pd.DataFrame(
    [
        ("Polar U-Net", 2021, None, 483, 93.02, 19.2),
        ("KiU-Net 3D", 2020, None, 483, 94.23, 19.2),
        ("H-DenseUNet", 2017, None, 483, 96.5, 19.2),
        ("Proposed CCCD", None, 12, 133, 96.37, 1.03),
        ("Proposed CCCD", None, 7, 217, 96.00, 1.69),
        ("Proposed CCCD", None, 3, 189, 98.49, 1.47),
    ],
    columns=["method", "year", "k", "boundary_pixels", "dice_percent", "memory_kb"],
)

TABLE_4 = pd.DataFrame(
    [
        ("Ground truth", 1, 0),
        ("Connect2D", 2, 2),
        ("Crawl", 4, 4),
        ("NN-Crust", 12, 12),
        ("Proposed CCCD", 1, 0),
    ],
    columns=["method", "connected", "disconnected"],
)

#: Seconds; corners and curves are separate columns of the printed table.
TABLE_5 = pd.DataFrame(
    [
        ("harris", 1.885, None),
        ("shi_tomasi", 1.304, None),
        ("fast", 0.93, None),
        ("connect2d", None, 3.44),
        ("crawl", None, 6.87),
        ("nn_crust", None, 5.34),
        ("cccd", 2.889, 0.395),
    ],
    columns=["key", "corner_s", "curve_s"],
)

#: Segmentation networks of Table 3 and section 2, with the data their Dice score was reported on.
NETWORKS = pd.DataFrame(
    [
        ("Polar U-Net", 2021, 93.02, "LiTS17, liver", "the paper's reference [11]"),
        ("KiU-Net 3D", 2020, 94.23, "LiTS17, liver", "the paper's reference [12]"),
        ("H-DenseUNet", 2017, 96.5, "LiTS17, liver", "the paper's reference [13]"),
        ("UNet 3+", 2020, 96.75, "LiTS17, liver", "the paper's reference [44]"),
        ("nnU-Net", 2020, 88.95, "BraTS 2020, whole tumour", "the paper's reference [45]"),
        ("Gite et al.", 2022, 96.30, "lung, data not stated", "the paper's reference [46]"),
    ],
    columns=["method", "year", "dice_percent", "data", "source"],
)
