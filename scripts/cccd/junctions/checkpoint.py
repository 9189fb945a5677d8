"""Files of a junction network: the model that a training gives, and what its checkpoints must agree with."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from cccd.devices import chosen_device
from cccd.junctions.network import JunctionNetwork
from cccd.junctions.paper_network import PaperNetwork
from cccd.model_header import foreign, read_header
from cccd.settings.junctions import NetworkSettings
from cccd.torch_files import save_content

__all__ = ["fingerprint", "load_model", "save_model", "start_from"]

_NETWORKS = {"ours": JunctionNetwork, "paper": PaperNetwork}

# Weights of a message-passing layer that carry its messages.
_CARRYING = (
    ".triangle_messages.weight", ".link_messages.weight", ".link_messages.bias", ".contrast.weight",
    ".gate.weight", ".gate.bias",
)  # fmt: skip


def fingerprint(graphs_path: str | Path, settings: NetworkSettings, seed: int) -> str:
    """Digest what a checkpoint must have in common with a run to be resumed by it."""
    graphs = hashlib.sha256(Path(graphs_path).read_bytes()).hexdigest()
    unread = {"pretrained", "test_maps"} | ({"paper"} if settings.network == "ours" else set[str]())
    chosen = settings.model_dump(mode="json", exclude=unread)
    return hashlib.sha256(json.dumps([graphs, chosen, seed], sort_keys=True).encode()).hexdigest()


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


def _read_model(path: str | Path) -> dict[str, Any]:
    try:
        content = torch.load(path, weights_only=True, map_location="cpu")
        return {key: content[key] for key in ("sizes", "weights")}
    except Exception as error:  # torch raises many kinds
        raise foreign(path, type(error).__name__) from error


def load_model(path: str | Path) -> JunctionNetwork | PaperNetwork:
    """Read a trained network, ready for prediction, on the device that `cccd.devices` chooses.

    Raises
    ------
    InputError
        When the file is not one that `save_model` wrote.
    """
    header, content = read_header(path), _read_model(path)
    try:
        model = _NETWORKS[header.network](**content["sizes"])
        model.load_state_dict(content["weights"])
    except (KeyError, TypeError, RuntimeError) as error:
        raise foreign(path, "its weights do not fit") from error
    return model.eval().to(chosen_device())


@torch.no_grad()
def start_from(model: JunctionNetwork | PaperNetwork, path: str | Path, new_messages: float) -> None:
    """Put a file's weights into a network, in place.

    Whether they fit says `cccd.model_header.check_start`.

    What is new (features, messages, layers) hardly acts at first: its messages are scaled
    by ``new_messages``.
    """
    content = _read_model(path)
    for name, value in model.state_dict().items():
        if name.endswith(_CARRYING):
            value.mul_(new_messages)
        old = content["weights"].get(name)
        if old is not None:
            if value.ndim == 2:
                value[:, old.shape[1] :] = 0  # what the old network did not read
            value[tuple(slice(n) for n in old.shape)] = old
