"""VTK's own modules: loaded where they are needed, a quarter of a second, without PyVista."""

from __future__ import annotations

from importlib import import_module
from typing import Any, cast

__all__ = ["vtk"]


def vtk(name: str) -> Any:
    """Load a module of VTK by its name; its types are looser than what it returns."""
    return cast(Any, import_module(f"vtkmodules.{name}"))
