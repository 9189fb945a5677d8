"""Where networks run: on a GPU where torch finds one, or as the configuration's ``device`` says."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from cccd.errors import InputError

if TYPE_CHECKING:
    import torch

#: Stands in the environment of every job. Like a job's threads it is no input: masks and curves are the same
#: to rounding on either, so a change makes nothing anew.
DEVICE = "CCCD_DEVICE"


def chosen_device() -> torch.device:
    """Device that networks are put on: the environment's ``CCCD_DEVICE`` (auto, cpu or cuda), else auto.

    Raises
    ------
    InputError
        A GPU is asked for and torch finds none, or it is another word.

    Examples
    --------
    >>> os.environ["CCCD_DEVICE"] = "cpu"
    >>> chosen_device()
    device(type='cpu')
    >>> del os.environ["CCCD_DEVICE"]
    """
    import torch  # it takes two seconds to load

    name = os.environ.get(DEVICE, "auto")
    if name not in ("auto", "cpu", "cuda"):
        raise InputError(f"device {name!r}", "there is no such device", "choose one of auto, cpu, cuda")
    found = torch.cuda.is_available()
    if name == "cuda" and not found:
        hint = "use auto or cpu, or install torch's build for CUDA; cccd doctor reports what is there"
        raise InputError("device cuda", "torch finds no GPU here", hint)
    return torch.device("cuda" if found and name != "cpu" else "cpu")
