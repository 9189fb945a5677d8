"""3MF, for printing: in millimetres, with a colour, and with the thinnest wall among its metadata."""

from __future__ import annotations

import ctypes
import locale
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

import numpy as np

from cccd.files.write import ExportOptions
from cccd.geometry.thickness import wall_thickness
from cccd.settings.formats import COLOUR, NOTE
from cccd.surface.surface import LoftedSurface

#: Where the file keeps what is not the format's own.
NAMESPACE = "https://cccd.example/3mf"


def write(path: Path, surface: LoftedSurface, options: ExportOptions) -> None:
    """Write the mesh in mm RAS; metadata ``thinnest_wall_mm`` says how thick 99 % of it is at least."""
    import lib3mf as untyped  # pyright: ignore[reportMissingTypeStubs]  # of the extra print

    lib3mf = cast(Any, untyped)
    model = lib3mf.get_wrapper().CreateModel()
    model.SetUnit(lib3mf.ModelUnit.MilliMeter)
    body = model.AddMeshObject()
    body.SetName(options.organ)
    body.SetGeometry(
        _array(lib3mf.Position, np.asarray(surface.vertices, np.float32)),
        _array(lib3mf.Triangle, np.asarray(surface.faces, np.uint32)),
    )
    materials = model.AddBaseMaterialGroup()
    red, green, blue = (round(255 * share) for share in COLOUR)
    material = materials.AddMaterial(options.organ, lib3mf.Color(red, green, blue, 255))
    body.SetObjectLevelProperty(materials.GetResourceID(), material)
    identity = lib3mf.Transform(((1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)))
    model.AddBuildItem(body, identity)
    facts = model.GetMetaDataGroup()
    facts.AddMetaData("", "Title", options.organ, "xs:string", True)
    facts.AddMetaData("", "Description", NOTE, "xs:string", True)
    thinnest = f"{wall_thickness(surface.mesh, 0.01):.2f}"
    facts.AddMetaData(NAMESPACE, "thinnest_wall_mm", thinnest, "xs:string", True)
    with _own_locale():
        model.QueryWriter("3mf").WriteToFile(str(path))


@contextmanager
def _own_locale() -> Generator[None]:
    """Bring back the process's locale, which the library's writer leaves at ``C``: texts would be ASCII."""
    before = locale.setlocale(locale.LC_ALL)
    try:
        yield
    finally:
        locale.setlocale(locale.LC_ALL, before)


def _array(kind: type[ctypes.Structure], rows: np.ndarray) -> Any:
    """Rows of an array as the library's structures."""
    return (kind * len(rows)).from_buffer_copy(np.ascontiguousarray(rows).tobytes())
