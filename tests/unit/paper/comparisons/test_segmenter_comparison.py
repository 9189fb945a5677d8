"""Shipped networks look at a scan once."""

import numpy as np
import torch

from cccd.containers import Frame, Structure
from cccd.inputs.grid import Volume
from cccd_paper.comparisons.segmenters import ShippedNetworks
from cccd_segmentation.plan import Intensity, Plan


class Bright(torch.nn.Module):
    """Finds what is brighter than the mean, and counts how often it is asked."""

    def __init__(self):
        super().__init__()
        self.asked = 0

    def forward(self, volume):
        self.asked += 1
        return torch.cat([-9 * volume, 9 * volume], dim=1)


def test_table_and_figure_share_what_a_network_found():
    image = np.zeros((40, 36, 34))
    image[10:30, 8:28, 9:25] = 100
    scan = Volume(image, np.eye(4), "scan")
    plan = Plan("nnunet", 2, {}, (1,), "RAS", (1.0, 1.0, 1.0), Intensity("MR"), (32, 32, 32))
    segmenter = (Bright(), plan)
    networks = ShippedNetworks([segmenter])
    structure = Structure("p", "cube", Frame(np.eye(4), 2, image.shape), np.zeros(3, int))
    found = networks.chances(segmenter, structure, scan, 0)
    assert np.array_equal(found >= 0.5, image > 0)
    asked = segmenter[0].asked
    assert networks.chances(segmenter, structure, scan, 0) is found
    assert segmenter[0].asked == asked
    networks.chances(segmenter, structure, scan, 1)  # another phantom
    assert segmenter[0].asked > asked
