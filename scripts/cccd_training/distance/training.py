"""Train the network that estimates distances, in PyTorch; the trained one runs in NumPy."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor, nn

from cccd.surface.learned_distance import OFFSETS, RANGE, SLICES, UNIT, condition_basis
from cccd_training.distance.bodies import Sample

#: Sets of first-layer weights that conditions mix, and the layers' widths.
BANKS, WIDTHS = 2, (256, 128, 64)
#: Stacks of a step, each either way up, and places of each.
STACKS, PLACES = 192, 384
#: Places count less beyond so many pixels of the surface: it is not found there.
COUNTED, BEYOND = 1.2, 0.3
#: Share of a step that the running mean of weights takes on.
AVERAGED = 0.0005
#: Fewest places of a stack, one way up, that are trained with.
FEWEST = 8

Array = np.ndarray[Any, np.dtype[Any]]


class DistanceModel(nn.Module):
    """See `cccd.surface.learned_distance.DistanceNetwork`."""

    slot: Tensor  # which slice (F,) each value that is seen is of

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
        self.register_buffer("slot", torch.tensor(OFFSETS[:, 0] + SLICES), persistent=False)
        self.last = nn.Parameter(torch.zeros(WIDTHS[-1], 1))
        self.biases = nn.ParameterList([nn.Parameter(torch.zeros(conditions, n)) for n in (*WIDTHS, 1)])

    def forward(self, seen: Tensor, base: Tensor, basis: Tensor) -> Tensor:
        """Distances (C, N) of places (C, N, F) under conditions (C, B)."""
        gain = torch.einsum("cb,bqsh->cqsh", basis, self.gain)[:, :, self.slot]
        values = torch.bmm(seen, (self.first * gain).sum(dim=1))
        for matrix, bias in zip([*self.layers, self.last], self.biases[:-1], strict=True):
            values = torch.relu(values + (basis @ bias)[:, None]) @ matrix
        return values[..., 0] + basis @ self.biases[-1] + base


def unpacked(seen: Tensor) -> Tensor:
    """Take back what `cccd_training.distance.bodies.packed` stored, as float32."""
    root = seen.float() / 127
    return root * root.abs() * (RANGE / UNIT)


class _Places:
    """Places of all stacks on one device, sorted by stack and way up."""

    def __init__(self, samples: Sequence[Sample], device: str) -> None:
        groups = [
            (sample, np.flatnonzero(sample.flipped == upside), -sample.height if upside else sample.height)
            for sample in samples
            for upside in (False, True)
            if np.count_nonzero(sample.flipped == upside) >= FEWEST
        ]
        counts = np.array([len(rows) for _, rows, _ in groups])
        basis = [condition_basis(s.ratio, np.full(1, height), s.exact)[0] for s, _, height in groups]

        def joined(parts: Iterable[Array]) -> Tensor:
            return torch.from_numpy(np.concatenate([*parts])).to(device)

        self.seen = joined(sample.seen[rows] for sample, rows, _ in groups)
        self.base = joined(sample.base[rows] for sample, rows, _ in groups)
        self.truth = joined(sample.truth[rows] for sample, rows, _ in groups)
        self.basis = torch.tensor(np.array(basis), dtype=torch.float32, device=device)
        self.count = torch.tensor(counts, device=device)
        self.begin = torch.cumsum(self.count, 0) - self.count

    def draw(self) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Give places of some stacks: seen (C, N, F), base and truth (C, N), conditions (C, B)."""
        device = self.base.device
        group = torch.randint(len(self.count), (STACKS,), device=device)
        share = torch.rand((STACKS, PLACES), device=device)
        rows = self.begin[group, None] + (share * self.count[group, None]).long()
        return unpacked(self.seen[rows]), self.base[rows], self.truth[rows], self.basis[group]


def train(
    samples: Sequence[Sample],
    steps: int,
    rate: float,
    seed: int,
    device: str = "cpu",
    report: Callable[[int, float], None] | None = None,
) -> DistanceModel:
    """Train on samples; the learning rate falls to nothing, and the mean of the last weights is given.

    Parameters
    ----------
    samples : sequence of Sample
    steps : int
    rate : float
        First learning rate.
    seed : int
    device : str, default: "cpu"
        Of PyTorch; holds all samples.
    report : callable, optional
        Called after each step with its number and its loss.
    """
    torch.manual_seed(seed)
    places, model = _Places(samples, device), DistanceModel().to(device)
    mean = torch.optim.swa_utils.AveragedModel(
        model, multi_avg_fn=torch.optim.swa_utils.get_ema_multi_avg_fn(1 - AVERAGED)
    )
    optimiser = torch.optim.AdamW(model.parameters(), rate, weight_decay=1e-4)
    for step in range(steps):
        optimiser.param_groups[0]["lr"] = rate * min(1.0, (step + 1) / 500) * max(0.003, 1 - step / steps)
        seen, base, truth, basis = places.draw()
        weight = torch.where(truth.abs() < COUNTED, 1.0, BEYOND)
        loss = ((model(seen, base, basis) - truth).abs() * weight).sum() / weight.sum()
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimiser.step()
        mean.update_parameters(model)
        if report is not None:
            report(step, float(loss.detach()))
    return cast("DistanceModel", mean.module).cpu()


def save_weights(model: DistanceModel, path: Path) -> None:
    """Write the weights as `cccd.surface.learned_distance.DistanceNetwork.load` reads them."""
    out = {"gain": model.gain, "first": model.first, "last": model.last}
    out |= {f"layer{n}": layer for n, layer in enumerate(model.layers)}
    names = ["bias", *(f"bias{n}" for n in range(len(model.layers))), "last_bias"]
    out |= dict(zip(names, model.biases, strict=True))
    halves = {name: value.detach().numpy().astype(np.float16) for name, value in out.items()}
    np.savez_compressed(path, allow_pickle=False, **halves)
