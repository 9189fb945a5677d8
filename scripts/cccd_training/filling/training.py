"""Train the network that fills between slices, in PyTorch; the trained one runs in NumPy (`cccd.filling`)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from cccd.filling.network import FARTHEST, PARTS
from cccd_training.filling.bodies import SlicedBody

__all__ = ["FillingModel", "interpolated", "save_weights", "train"]

#: True distances beyond this many nodes are not learnt; predictions count up to a little further.
LEARNT, COUNTED = 1.2, 1.7


class FillingModel(nn.Module):
    """Residual convolutions 3 x 3 x 3 on the nodes near the surface; see `cccd.filling.FillingNetwork`."""

    def __init__(self, width: int = 20, layers: int = 4) -> None:
        super().__init__()
        self.first = nn.Conv3d(4, width, 3, padding=1)
        self.body = nn.ModuleList(nn.Conv3d(width, width, 3, padding=1) for _ in range(layers))
        self.last = nn.Conv3d(width, int(np.prod(PARTS)), 1)
        nn.init.zeros_(self.last.weight)
        if self.last.bias is not None:
            nn.init.zeros_(self.last.bias)  # before training it corrects nothing

    def forward(self, distance: Tensor, ratio: Tensor, pixel: Tensor) -> tuple[Tensor, Tensor]:
        """Corrections (N, 16, A, B, S) and the nodes (N, 1, A, B, S) near the surface, of (N, 1, A, B, S)."""
        near = _near_surface(distance)
        whole = torch.ones_like(distance)
        constants = [whole * value.view(-1, 1, 1, 1, 1) for value in (ratio - 2, 2 * pixel - 1)]
        features = torch.cat([distance.clamp(-2, 2), torch.tanh(3 * distance), *constants], 1) * near
        hidden = torch.relu(self.first(features)) * near
        for layer in self.body:
            hidden = hidden + torch.relu(layer(hidden)) * near
        return self.last(hidden), near


def _near_surface(distance: Tensor) -> Tensor:
    """Nodes within two of a change of sign."""
    inside = functional.pad((distance < 0).float(), (1,) * 6, mode="replicate")
    crossed = (functional.max_pool3d(inside, 3, 1) > -functional.max_pool3d(-inside, 3, 1)).float()
    return functional.max_pool3d(crossed, 3, 1, 1)


def interpolated(distance: Tensor) -> Tensor:
    """Linear interpolation (N, 16, A, B, S) at the parts of a node: what the network corrects."""
    padded = functional.pad(distance.clamp(-FARTHEST, FARTHEST), (0, 1, 0, 1, 0, 1), mode="replicate")
    parts: list[Tensor] = []
    for part in np.ndindex(*PARTS):
        value = padded
        for axis, (n, of) in enumerate(zip(part, PARTS, strict=True), start=2):
            size = value.shape[axis] - 1
            low, high = value.narrow(axis, 0, size), value.narrow(axis, 1, size)
            value = low + n / of * (high - low)
        parts.append(value)
    return torch.cat(parts, 1)


def train(
    bodies: Sequence[SlicedBody], steps: int, rate: float, seed: int, start: FillingModel | None = None
) -> tuple[FillingModel, list[float]]:
    """Train on sliced bodies, six of one slice distance a step; the learning rate falls to nothing.

    Returns
    -------
    model : FillingModel
    losses : list of float
        Mean distance error in nodes of every step.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    model = start or FillingModel()
    optimiser = torch.optim.Adam(model.parameters(), rate)
    groups = [[b for b in bodies if b.ratio == ratio] for ratio in sorted({b.ratio for b in bodies})]
    losses: list[float] = []
    for step in range(steps):
        optimiser.param_groups[0]["lr"] = rate * max(0.01, 1 - step / steps)
        group = groups[rng.integers(len(groups))]
        batch = [_turned(group[n], rng) for n in rng.integers(0, len(group), 6)]
        loss = _loss(model, batch)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(float(loss.detach()))
    return model, losses


def _turned(body: SlicedBody, rng: np.random.Generator) -> SlicedBody:
    """Swap a body's axes in the plane, or inside and outside, at random."""
    distance, truth = body.distance, body.truth
    if rng.random() < 0.5:
        distance = distance.transpose(1, 0, 2)
        truth = truth.reshape(*PARTS, *body.distance.shape).transpose(1, 0, 2, 4, 3, 5)
        truth = truth.reshape(-1, *distance.shape)
    sign = rng.choice([-1.0, 1.0])
    return SlicedBody(sign * distance, sign * truth, body.ratio, body.pixel)


def _loss(model: FillingModel, batch: Sequence[SlicedBody]) -> Tensor:
    """Mean absolute error in nodes near the true surface."""
    distance = torch.tensor(np.stack([body.distance for body in batch]), dtype=torch.float32)[:, None]
    truth = torch.tensor(np.stack([body.truth for body in batch]), dtype=torch.float32)
    ratio, pixel = (torch.tensor([getattr(body, name) for body in batch]) for name in ("ratio", "pixel"))
    corrections, near = model(distance, ratio.float(), pixel.float())
    counts = (near > 0) & (truth.abs() < LEARNT)
    counts[..., -1:] = False
    predicted = (interpolated(distance) + corrections).clamp(-COUNTED, COUNTED)
    return (predicted - torch.nan_to_num(truth))[counts].abs().mean()


def save_weights(model: FillingModel, path: Path) -> None:
    """Write the weights as `cccd.filling.FillingNetwork.load` reads them."""
    out = {"head": model.last.weight[:, :, 0, 0, 0].T, "head_bias": model.last.bias}
    for n, layer in enumerate([model.first, *model.body]):
        assert isinstance(layer, nn.Conv3d)
        out[f"kernel{n}"] = layer.weight.permute(2, 3, 4, 1, 0).flatten(0, 2)
        out[f"bias{n}"] = layer.bias
    np.savez(path, **{name: value.detach().numpy().copy() for name, value in out.items()})
