"""A network in training, whatever it is: what moves its weights, and what a later process needs to go on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import torch
from torch import Tensor, nn

# Share of the steps in which the learning rate rises (Smith and Topin 2019): short runs need the fall.
_RISING = 0.1


@dataclass
class Run:
    """A training between two epochs.

    Attributes
    ----------
    model : nn.Module
    optimiser, schedule : Optimizer, LRScheduler
    history : list of dict
        A row of every epoch so far.
    """

    model: Any
    optimiser: torch.optim.Optimizer
    schedule: torch.optim.lr_scheduler.LRScheduler
    history: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])

    @classmethod
    def start(cls, model: nn.Module, peak: float, steps: int, weight_decay: float) -> Self:
        """Start with AdamW (Loshchilov and Hutter 2019), whose rate rises to ``peak`` and falls once."""
        optimiser = torch.optim.AdamW(model.parameters(), lr=peak, weight_decay=weight_decay)
        schedule = torch.optim.lr_scheduler.OneCycleLR(
            optimiser,
            peak,
            total_steps=steps + 1,
            pct_start=max(_RISING, 2 / (steps + 1)),  # a rise of one step divides by zero
            cycle_momentum=False,
        )
        return cls(model, optimiser, schedule)

    @property
    def device(self) -> torch.device:
        """Where the weights are."""
        return next(self.model.parameters()).device

    def step(self, loss: Tensor, most_norm: float) -> bool:
        """Move the weights by a loss whose gradient is cut to a norm; not where it is not finite: False."""
        self.optimiser.zero_grad(set_to_none=True)
        torch.autograd.backward(loss)
        norm = nn.utils.clip_grad_norm_(self.model.parameters(), most_norm)
        finite = bool(torch.isfinite(norm))
        if finite:  # one step that is not would leave no weight that is
            self.optimiser.step()
        self.schedule.step()
        return finite

    def state(self) -> dict[str, Any]:
        """All that a later process needs to go on."""
        return {
            "model": self.model.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "schedule": self.schedule.state_dict(),
            "history": self.history,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what `state` gave."""
        self.model.load_state_dict(state["model"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.schedule.load_state_dict(state["schedule"])
        self.history = state["history"]
