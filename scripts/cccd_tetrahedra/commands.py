"""The option ``--materials`` of ``cccd surface``."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from cccd.errors import InputError
from cccd.files import format_of
from cccd.plugins import formats
from cccd_tetrahedra.materials import read_table

if TYPE_CHECKING:
    from cccd.settings.root import Settings


def with_materials(settings: Settings, given: argparse.Namespace) -> Settings:
    """Return settings with the table that was named, provided that something is made of it."""
    if not any(format_of(path) in formats("tetrahedra") for path in given.output):
        hint = f"write one of {', '.join(f'.{form}' for form in formats('tetrahedra'))}"
        raise InputError("--materials", "no output has tetrahedra", hint)
    read_table(given.materials)
    tetrahedra = settings.surface.tetrahedra.model_copy(update={"materials": given.materials})
    surface = settings.surface.model_copy(update={"tetrahedra": tetrahedra})
    return settings.model_copy(update={"surface": surface})
