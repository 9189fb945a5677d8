"""Files of a junction network."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from cccd.plugins import find, table
from cccd_junctions.inference import LoopPredictor
from cccd_junctions.network import JunctionNetwork
from cccd_networks.devices import chosen_device
from cccd_networks.model_header import foreign, read_header
from cccd_networks.torch_files import save_content


def save_model(
    path: str | Path,
    network: str,
    sizes: Mapping[str, int | float],
    weights: Mapping[str, torch.Tensor],
    seed: int,
) -> None:
    """Write ``model.pt``: what `load_model` reads."""
    content = {"network": network, "sizes": dict(sizes), "weights": dict(weights), "seed": seed}
    save_content(Path(path), content)


def read_model(path: str | Path) -> dict[str, Any]:
    """Read ``sizes`` and ``weights`` of a file, as they are.

    Raises
    ------
    InputError
        When the file is not one that `save_model` wrote.
    """
    try:
        content = torch.load(path, weights_only=True, map_location="cpu")
        return {key: content[key] for key in ("sizes", "weights")}
    except Exception as error:  # torch raises many kinds
        raise foreign(path, type(error).__name__) from error


def load_model(path: str | Path) -> JunctionNetwork | LoopPredictor:
    """Read a trained network, ready for prediction, on the device that `cccd_networks.devices` chooses.

    Raises
    ------
    InputError
        When the file is not one that `save_model` wrote.
    """
    header, content = read_header(path), read_model(path)
    others = table("JUNCTION_NETWORKS")
    if header.network != "ours" and header.network not in others:
        raise foreign(path, f"no installed package has its network {header.network!r}")
    try:
        network = JunctionNetwork if header.network == "ours" else find(others[header.network])
        model = network(**content["sizes"])
        model.load_state_dict(content["weights"])
    except (KeyError, TypeError, RuntimeError) as error:
        raise foreign(path, "its weights do not fit") from error
    return model.eval().to(chosen_device())
