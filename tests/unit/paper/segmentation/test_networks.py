"""The networks of Table 3 have their authors' sizes, and map any volume to logits of its size."""

import itertools

import pytest
import torch
from support.refusals import refusal
from torch import nn

from cccd_paper.segmentation.hdenseunet import LAYERS_2D, DenseEncoder
from cccd_paper.segmentation.polar_unet import PolarUNet, UNet
from cccd_segmentation.networks import build, networks, parameters
from cccd_segmentation.plain_unet import PlainUNet


def published(make):
    """Parameters of a network at its published width; no memory is taken."""
    with torch.device("meta"):
        return parameters(make())


def test_polar_unet_is_the_u_net_of_its_repository():
    # 7.763 million: the U-Net of 32 channels that its repository takes (three channels in, one out); ours has
    # two classes out, which is one further map of 32 weights and a bias
    assert published(lambda: UNet(2, 32)) == 7_763_041 + 33
    assert published(lambda: PolarUNet(2, 32)) == 2 * (7_763_041 + 33)


def test_unet_3plus_has_the_paper_s_27_million():
    # 26.97 million: Huang et al. 2020, Table 1, with the VGG-16 encoder's five levels
    assert published(lambda: build("unet_3plus", 2, 64, {})) == pytest.approx(26.97e6, rel=0.002)


def test_nnunet_s_plain_network_has_31_million():
    # 31.2 million: as Roy et al. 2023 (MedNeXt, Table 1) count nnU-Net's default 3D network
    assert published(lambda: PlainUNet(2, 32)) == pytest.approx(31.2e6, rel=0.002)


def test_h_denseunet_s_slice_encoder_is_densenet_161():
    # 28,681,000: torchvision's count of DenseNet-161, its classifier of 2208 x 1000 + 1000 among them;
    # its first and last normalisations are ours as well
    encoder = published(lambda: DenseEncoder(2, 3, 48, LAYERS_2D))
    assert encoder == 28_681_000 - 2208 * 1000 - 1000


def test_kiunet_has_the_sizes_of_its_repository():
    # No count is published for LiTS. By hand, from the layers of LiTS/net/models.py: five convolutions up to
    # 512 channels and back to 2, the overcomplete pair, and the four outputs
    widths = [1, 32, 64, 128, 256, 512]
    pairs = [*itertools.pairwise(widths), *zip(widths[:1:-1], widths[-2:0:-1], strict=False)]
    pairs += [(32, 2), (1, 32), (32, 2)]
    theirs = sum(27 * a * b + b for a, b in pairs) + 3 + 65 + 129 + 257
    ours = published(lambda: build("kiunet_3d", 2, 32, {}))
    fusion = 4 * (27 * 32 * 32 + 32)  # the cross residual fusion, which that file has commented out
    assert ours - fusion == pytest.approx(theirs, rel=0.001)


def test_kiunet_s_classes_are_made_of_features_of_either_sign():
    """Rectified ones can only lower a logit whose weights are negative: a label that is never found."""
    torch.manual_seed(0)
    model = build("kiunet_3d", 3, 4, {}).eval()
    seen = []
    model.head.register_forward_pre_hook(lambda _, given: seen.append(given[0]))
    with torch.no_grad():
        model(torch.randn(1, 1, 32, 32, 32))
    assert (seen[0].amin(dim=(0, 2, 3, 4)) < 0).any()


def test_an_unknown_name_gets_the_nearest():
    assert "did you mean 'nnunet'" in refusal(build, "nunet", 2, 8, {})


@pytest.mark.parametrize("name", networks())
def test_every_network_maps_a_volume_to_logits_of_its_size(name):
    torch.manual_seed(0)
    model = build(name, 3, 4, networks()[name].sizes).eval()
    with torch.no_grad():
        assert model(torch.randn(1, 1, 32, 48, 32)).shape == (1, 3, 32, 48, 32)


@pytest.mark.parametrize("name", networks())
def test_every_network_learns_a_bright_cube(name):
    """At most fifteen steps on one volume halve the sum of the outputs' losses."""
    torch.manual_seed(1)
    model = build(name, 2, 4, networks()[name].sizes).train()
    labels = torch.zeros(1, 1, 32, 32, 32, dtype=torch.long)
    labels[..., 8:24, 6:22, 8:26] = 1
    volume = labels + 0.1 * torch.randn(labels.shape)
    optimiser = torch.optim.AdamW(model.parameters(), lr=0.01)

    def losses():
        return [nn.functional.cross_entropy(a, b[:, 0]) for a, b in model.outputs(volume, labels)]

    seen = []
    while len(seen) < 16 and not (seen and seen[-1] < 0.5 * seen[0]):
        optimiser.zero_grad()
        loss = sum(losses())
        seen.append(float(loss.detach()))
        loss.backward()
        optimiser.step()
    assert seen[-1] < 0.5 * seen[0]
