"""Train the network that estimates distances, in PyTorch; the trained one runs in NumPy."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor, nn

from cccd.surface.learned_distance import OFFSETS, SLICES, condition_basis
from cccd_training.distance.bodies import Sample, unpacked

__all__ = ["DistanceModel", "save_weights", "train"]

#: Sets of first-layer weights that conditions mix, and the layers' widths.
BANKS, WIDTHS = 2, (192, 64, 32)
#: Stacks of a step, and places of each and of each way up.
STACKS, PLACES = 8, 320
#: Places count less beyond so many pixels of the surface: it is not found there.
COUNTED, BEYOND = 1.2, 0.3
#: Share of a step that the running mean of weights takes on.
AVERAGED = 0.002

Array = np.ndarray[Any, np.dtype[Any]]


class DistanceModel(nn.Module):
    """See `cccd.surface.learned_distance.DistanceNetwork`."""

    def __init__(self) -> None:
        super().__init__()
        conditions = condition_basis(1.0, np.zeros(1), False).shape[1]
        seen, slots = len(OFFSETS), 2 * SLICES + 1
        gain = torch.zeros(conditions, BANKS, slots, WIDTHS[0])
        gain[:, 0] = 1.0
        gain[:, 1:] = torch.linspace(-1, 1, conditions)[:, None, None, None]
        self.gain = nn.Parameter(gain)
        self.first = nn.Parameter(torch.randn(BANKS, seen, WIDTHS[0]) * (1.4 / seen**0.5))
        self.layers = nn.ParameterList(
            [nn.Parameter(torch.randn(a, b) * (2 / a) ** 0.5) for a, b in itertools.pairwise(WIDTHS)]
        )
        self.last = nn.Parameter(torch.zeros(WIDTHS[-1], 1))
        self.biases = nn.ParameterList([nn.Parameter(torch.zeros(conditions, n)) for n in (*WIDTHS, 1)])

    @staticmethod
    def slot() -> Tensor:
        """Which slice (F,) each value that is seen is of."""
        return torch.tensor(OFFSETS[:, 0] + SLICES)

    def forward(self, seen: Tensor, base: Tensor, basis: Tensor) -> Tensor:
        """Distances (C, N) of places (C, N, F) under conditions (C, B)."""
        gain = torch.einsum("cb,bqsh->cqsh", basis, self.gain)[:, :, self.slot()]
        values = torch.bmm(seen, (self.first * gain).sum(dim=1))
        for matrix, bias in zip([*self.layers, self.last], self.biases[:-1], strict=True):
            values = torch.relu(values + (basis @ bias)[:, None]) @ matrix
        return values[..., 0] + basis @ self.biases[-1] + base


def train(
    samples: Sequence[Sample],
    steps: int,
    rate: float,
    seed: int,
    start: DistanceModel | None = None,
    told: Callable[[int, float, DistanceModel], None] | None = None,
) -> DistanceModel:
    """Train on samples; the learning rate falls to nothing, and the mean of the last weights is given.

    Parameters
    ----------
    samples : sequence of Sample
        May grow while the training goes on.
    steps : int
    rate : float
        First learning rate.
    seed : int
    start : DistanceModel, optional
    told : callable, optional
        Called after each step with its number, its loss and the mean model.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    model = start or DistanceModel()
    mean = torch.optim.swa_utils.AveragedModel(
        model, multi_avg_fn=torch.optim.swa_utils.get_ema_multi_avg_fn(1 - AVERAGED)
    )
    optimiser = torch.optim.AdamW(model.parameters(), rate, weight_decay=1e-4)
    for step in range(steps):
        optimiser.param_groups[0]["lr"] = rate * min(1.0, (step + 1) / 500) * max(0.005, 1 - step / steps)
        seen, base, truth, basis = _batch([samples[n] for n in rng.integers(0, len(samples), STACKS)], rng)
        weight = torch.where(truth.abs() < COUNTED, 1.0, BEYOND)
        loss = ((model(seen, base, basis) - truth).abs() * weight).sum() / weight.sum()
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimiser.step()
        mean.update_parameters(model)
        if told is not None:
            told(step, float(loss.detach()), cast("DistanceModel", mean.module))
    return cast("DistanceModel", mean.module)


def _batch(samples: Sequence[Sample], rng: np.random.Generator) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Places of samples, either way up: seen (C, N, F), base and truth (C, N), conditions (C, B)."""
    rows: list[tuple[Array, Array, Array]] = []
    basis: list[Array] = []
    for sample in samples:
        for upside in (False, True):
            own = np.flatnonzero(sample.flipped == upside)
            if len(own) == 0:
                continue
            here = rng.choice(own, PLACES)
            rows.append((unpacked(sample.seen[here]), sample.base[here], sample.truth[here]))
            height = np.full(1, -sample.height if upside else sample.height)
            basis.append(condition_basis(sample.ratio, height, sample.exact)[0])
    seen, base, truth = (
        torch.tensor(np.stack(part), dtype=torch.float32) for part in zip(*rows, strict=True)
    )
    return seen, base, truth, torch.tensor(np.stack(basis), dtype=torch.float32)


def save_weights(model: DistanceModel, path: Path) -> None:
    """Write the weights as `cccd.surface.learned_distance.DistanceNetwork.load` reads them."""
    out = {"gain": model.gain, "first": model.first, "last": model.last}
    out |= {f"layer{n}": layer for n, layer in enumerate(model.layers)}
    names = ["bias", *(f"bias{n}" for n in range(len(model.layers))), "last_bias"]
    out |= dict(zip(names, model.biases, strict=True))
    halves = {name: value.detach().numpy().astype(np.float16) for name, value in out.items()}
    np.savez_compressed(path, allow_pickle=False, **halves)
