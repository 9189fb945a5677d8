"""A trained segmenter as a file: weights of eight bits and the plan that they are used by."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from torch import nn

from cccd_networks.devices import chosen_device
from cccd_networks.model_header import foreign_segmenter, read_segmenter_plan
from cccd_networks.torch_files import save_content
from cccd_segmentation.networks import build
from cccd_segmentation.plan import Plan

#: A network that is ready for use, and how to use it.
Segmenter = tuple[nn.Module, Plan]


def save_segmenter(path: str | Path, model: nn.Module, plan: Plan) -> None:
    """Write what `load_segmenter` reads, in a quarter of the bytes of the training's weights.

    Kernels have whole numbers of -127 to 127, and a factor for each of their outputs; on held-out images the
    mean Dice of no shipped network changes by more than 0.0002. What has one number a channel keeps half
    precision.
    """
    weights: dict[str, Any] = {}
    stored: dict[int, Any] = {}  # MONAI's network names a layer twice: its weights are stored once
    for name, value in model.state_dict().items():
        if not name.endswith("num_batches_tracked"):  # nothing reads it in prediction
            weights[name] = stored.setdefault(value.data_ptr(), _stored(value))
    save_content(Path(path), {"segmenter": plan.as_plain(), "weights": weights})


def _stored(weights: torch.Tensor) -> Any:
    if weights.ndim < 2:
        return weights.half()
    largest = weights.abs().flatten(1).amax(dim=1) / 127
    factors = largest.reshape(-1, *[1] * (weights.ndim - 1)).clamp_min(torch.finfo(torch.float32).tiny)
    return (weights / factors).round().to(torch.int8), factors


def _restored(stored: Any) -> torch.Tensor:
    if isinstance(stored, tuple):
        whole, factors = stored
        return whole * factors
    return stored.float() if stored.is_floating_point() else stored


def load_segmenter(path: str | Path) -> Segmenter:
    """Read a trained network, ready for prediction, on the device that `cccd_networks.devices` chooses.

    Raises
    ------
    InputError
        No file of `save_segmenter`, or weights of another network than it says.
    """
    try:
        plan = Plan.of_plain(read_segmenter_plan(path))
        content = torch.load(path, weights_only=True, map_location="cpu")
        model = build(plan.network, plan.classes, plan.width, plan.sizes)
        weights = {name: _restored(value) for name, value in content["weights"].items()}
        missing, unknown = model.load_state_dict(weights, strict=False)
    except (KeyError, TypeError, RuntimeError) as error:
        raise foreign_segmenter(path, "its weights do not fit") from error
    if unknown or any(not name.endswith("num_batches_tracked") for name in missing):
        raise foreign_segmenter(path, f"its weights are not those of {plan.network}")
    return model.eval().to(chosen_device()), plan
