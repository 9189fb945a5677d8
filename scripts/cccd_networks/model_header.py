"""What a ``model.pt`` says of itself, read without torch and before any job starts.

A run that would be refused for its model is refused when it is planned: a job that starts loses its outputs,
and with them a model trained before.
"""

from __future__ import annotations

import pickle
import zipfile
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cccd.errors import InputError
from cccd_networks.settings import NetworkSettings

#: Names of networks in words.
NAMES = {"ours": "our network", "paper": "the paper's network"}

# The sizes that can be set; of our network, layers may be added to a start.
_SET = ("width", "layers", "message_layers")


@dataclass(frozen=True)
class ModelHeader:
    """Whose weights a file holds (``ours`` or ``paper``), and the network's sizes."""

    network: str
    sizes: dict[str, Any]


class _HeaderReader(pickle.Unpickler):
    """Reads plain values; of tensors nothing, and of code none."""

    def find_class(self, module: str, name: str) -> Callable[..., Any]:
        if (module, name) == ("collections", "OrderedDict"):
            return OrderedDict
        if module.split(".")[0] == "torch":
            return _nothing
        raise pickle.UnpicklingError(f"{module}.{name} is not allowed in a model")

    def persistent_load(self, pid: Any) -> None:
        return None


def _nothing(*_: Any) -> None:
    return None


def foreign(path: str | Path, why: str) -> InputError:
    """Make the error of a file that is no model of this version."""
    problem = f"not a junction model of this version ({why})"
    return InputError(str(path), problem, "name another in gnn.pretrained, or train one")


def _read_plain(path: str | Path) -> dict[str, Any]:
    """Plain values of a file of torch, without its tensors."""
    with zipfile.ZipFile(path) as archive:
        (name,) = (part for part in archive.namelist() if part.endswith("/data.pkl"))
        with archive.open(name) as file:
            return _HeaderReader(file).load()


def foreign_segmenter(path: str | Path, why: str) -> InputError:
    """Make the error of a file that holds no segmentation network of this version."""
    problem = f"not a segmentation network of this version ({why})"
    hint = "name a model.pt that train_segmenter wrote, or one of workflow/models/segmenters"
    return InputError(str(path), problem, hint)


def read_segmenter_plan(path: str | Path) -> dict[str, Any]:
    """Read what a segmenter's file says of itself: network, labels, grid, grey values.

    Raises
    ------
    InputError
        When the file is not one that `cccd_segmentation.model.save_segmenter` wrote.
    """
    try:
        content = _read_plain(path)
        if "segmenter" in content:
            return dict(content["segmenter"])
        why = "it contains a junction network" if "sizes" in content else "it contains something else"
    except OSError as error:
        raise foreign_segmenter(path, error.strerror or type(error).__name__) from error
    except Exception as error:  # whatever a foreign file makes the readers raise
        raise foreign_segmenter(path, type(error).__name__) from error
    raise foreign_segmenter(path, why)


def read_header(path: str | Path) -> ModelHeader:
    """Read whose weights a file holds, without its tensors.

    Raises
    ------
    InputError
        When the file is not one that `cccd_junctions.checkpoint.save_model` wrote.
    """
    try:
        content = _read_plain(path)
        # files of 0.2 do not say whose they are: they are all ours
        return ModelHeader(content.get("network", "ours"), dict(content["sizes"]))
    except Exception as error:  # whatever a foreign file makes the readers raise
        raise foreign(path, type(error).__name__) from error


def check_model(path: str | Path, network: str) -> ModelHeader:
    """Refuse a file that holds another network's weights than the configuration asks for."""
    header = read_header(path)
    if header.network != network:
        held, wanted = (NAMES.get(name, name) for name in (header.network, network))
        problem = f"contains the weights of {held}, but gnn.network asks for {wanted}"
        raise InputError(str(path), problem, f"set gnn.network to {header.network}, or name another file")
    return header


def check_start(path: str | Path, settings: NetworkSettings) -> None:
    """Refuse a start whose weights do not fit the network that is to be trained, or would be lost."""
    header = check_model(path, settings.network)
    ours = settings.network == "ours"
    section, wanted = ("gnn", settings.sizes) if ours else ("gnn.paper", settings.paper.sizes)
    for key, new in wanted.items():
        old = header.sizes.get(key)
        if old != new and (key != "message_layers" or old is None or old > new):
            hint = "set gnn.start to null"
            hint = f"set {section}.{key} to {old}, or gnn.start to null" if key in _SET else hint
            raise InputError(str(path), f"its {key} is not {new}", hint)
