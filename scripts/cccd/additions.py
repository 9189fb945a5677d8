"""What other packages add to this one: networks, comparisons, parts of the report and of the configuration.

This package names none of them. A package ``cccd_<name>`` that lies beside it may have a module
``registration`` whose function ``register()`` calls `add`, once, before anything is looked up by `added`::

    def register() -> None:
        add("junction network", "mine", "cccd_mine.network.MyNetwork")

Functions and classes are named by their dotted path (`cccd.lookup.find`): registering loads nothing heavy.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from cccd.lookup import find

__all__ = ["add", "added", "packages", "registrations"]

_ADDED: dict[str, dict[str, Any]] = {}


def add(kind: str, name: str, what: Any) -> None:
    """Add something of a kind under a name of its own.

    ========================== ===================================================================
    kind                       what
    ========================== ===================================================================
    ``"settings"``             a section of the configuration: its model and its default, as
                               `pydantic.create_model` has fields
    ``"junction network"``     path of a class, by the name that a ``model.pt`` says
    ``"junction training"``    path of what trains such a network, a `cccd_training.junctions.tasks.Task`
    ``"segmentation network"`` a `cccd.segmentation.networks.Network`
    ``"report section"``       title and introduction
    ``"report item"``          a `cccd.report.registry.Item`
    ``"report input"``         a `cccd.report.registry.Input`
    ========================== ===================================================================

    Raises
    ------
    ValueError
        The name is taken.
    """
    if name in _ADDED.setdefault(kind, {}):
        raise ValueError(f"there is a {kind} {name!r} already")
    _ADDED[kind][name] = what


def added(kind: str) -> Mapping[str, Any]:
    """Everything of a kind by its name, in the order in which it was added.

    Examples
    --------
    >>> dict(added("teapot"))
    {}
    """
    _register_all()
    return MappingProxyType(_ADDED.get(kind, {}))


def packages() -> tuple[Path, ...]:
    """Folders of this package and of those beside it, by name."""
    here = Path(__file__).resolve().parent
    return (here, *sorted(path.parent for path in here.parent.glob("cccd_*/__init__.py")))


def registrations() -> tuple[str, ...]:
    """Dotted paths of the functions ``register`` of the packages beside this one."""
    beside = (path for path in packages()[1:] if (path / "registration.py").is_file())
    return tuple(f"{path.name}.registration.register" for path in beside)


@functools.cache
def _register_all() -> None:
    for registration in registrations():
        find(registration)()
