"""Where a training begins, and what its checkpoints must agree with."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import torch
from torch import nn

from cccd_junctions.checkpoint import read_model
from cccd_networks.settings import NetworkSettings

# Factor of messages that the weights of the start are without: what is new hardly acts at first.
_NEW_MESSAGES = 0.1

# Weights of a message-passing layer that carry its messages.
_CARRYING = (
    ".triangle_messages.weight", ".link_messages.weight", ".link_messages.bias", ".contrast.weight",
    ".gate.weight", ".gate.bias",
)  # fmt: skip


def fingerprint(graphs_path: str | Path, settings: NetworkSettings, seed: int) -> str:
    """Digest what a checkpoint must have in common with a run to be resumed by it."""
    graphs = hashlib.sha256(Path(graphs_path).read_bytes()).hexdigest()
    unread = {"pretrained", "test_maps", "inference"} | (
        {"paper"} if settings.network == "ours" else set[str]()
    )
    chosen = settings.model_dump(mode="json", exclude=unread)
    return hashlib.sha256(json.dumps([graphs, chosen, seed], sort_keys=True).encode()).hexdigest()


@torch.no_grad()
def start_from(model: nn.Module, path: str | Path) -> None:
    """Put a file's weights into a network, in place.

    Whether they fit says `cccd_networks.model_header.check_start`.

    What is new (features, messages, layers) hardly acts at first: its messages are scaled down.
    """
    content = read_model(path)
    for name, value in model.state_dict().items():
        if name.endswith(_CARRYING):
            value.mul_(_NEW_MESSAGES)
        old = content["weights"].get(name)
        if old is not None:
            if value.ndim == 2:
                value[:, old.shape[1] :] = 0  # what the old network did not read
            value[tuple(slice(n) for n in old.shape)] = old
