"""Networks run where the configuration says; a GPU gives what the processor gives."""

import numpy as np
import pytest
import torch

from cccd.errors import InputError
from cccd.project import PROJECT
from cccd_networks.devices import DEVICE, chosen_device

GPU = torch.cuda.is_available()


@pytest.mark.parametrize("name", ["cpu", "auto"])
def test_a_device_is_there(monkeypatch, name):
    monkeypatch.setenv(DEVICE, name)
    assert chosen_device().type == ("cuda" if GPU and name == "auto" else "cpu")


@pytest.mark.parametrize(
    ("name", "words"), [("gpu", "choose one of auto, cpu, cuda"), ("cuda", "torch finds no GPU here")]
)
def test_a_device_that_is_not_there_is_refused(monkeypatch, name, words):
    monkeypatch.setenv(DEVICE, name)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(InputError, match=words):
        chosen_device()


@pytest.mark.skipif(not GPU, reason="torch finds no GPU here")
def test_a_gpu_gives_the_probabilities_of_the_processor(monkeypatch):
    from cccd.inputs.grid import Volume
    from cccd_segmentation.inference import probabilities
    from cccd_segmentation.model import load_segmenter

    scan = Volume(np.random.default_rng(0).normal(0, 1, (40, 44, 36)).astype(np.float32), np.eye(4), "scan")
    weights = PROJECT / "workflow" / "models" / "segmenters" / "hippocampus" / "nnunet.pt"
    found = []
    for name in ("cpu", "cuda"):
        monkeypatch.setenv(DEVICE, name)
        model, plan = load_segmenter(weights)
        found.append(probabilities(model, scan, plan))
    assert abs(found[0] - found[1]).max() < 5e-3  # half precision: 0.0005 where a processor emulates it
