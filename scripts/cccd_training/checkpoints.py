"""Checkpoints of a training with torch, whatever the network: written whole, and resumed from."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from cccd_networks.torch_files import save_content

logger = logging.getLogger(__name__)

# How many checkpoints are kept: the newest may be torn.
_KEPT = 2


@dataclass(frozen=True)
class Checkpoints:
    """Checkpoints of one run, an epoch each, in a folder.

    Attributes
    ----------
    folder : path
    fingerprint : str
        Of the run that they belong to.
    """

    folder: Path
    fingerprint: str

    def _newest_first(self) -> list[Path]:
        return sorted(self.folder.glob("epoch_*.pt"), reverse=True)

    def save(self, epoch: int, state: Mapping[str, Any]) -> None:
        """Write an epoch's state; all but the newest two are deleted."""
        self.folder.mkdir(parents=True, exist_ok=True)
        save_content(self.folder / f"epoch_{epoch:04d}.pt", {"fingerprint": self.fingerprint, **state})
        for old in self._newest_first()[_KEPT:]:
            old.unlink()

    def newest(self) -> dict[str, Any] | None:
        """Read the newest state that is whole and belongs to this run."""
        for path in self._newest_first():
            try:
                state = torch.load(path, weights_only=True, map_location="cpu")
                if state["fingerprint"] == self.fingerprint:
                    logger.info("resuming after %s", path.name)
                    return state
            except Exception as error:  # whatever a torn file makes the reader raise
                logger.warning("%s cannot be read (%s); trying the one before", path.name, error)
        return None
