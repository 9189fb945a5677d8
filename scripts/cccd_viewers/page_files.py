"""What the page draws of a structure, as its jobs leave it: figures of slices, small meshes with values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from cccd.containers import Curves
from cccd.geometry.mesh import Mesh
from cccd.store import new_file, open_file, read_fields, read_value, write_fields


@dataclass(frozen=True)
class Panel:
    """What a figure draws over one picture of a slice.

    Attributes
    ----------
    title, detail : str
        Above the panel, one below the other.
    layers : dict of str to array
        Closed curves and points ``(n, 2)`` and links ``(m, 2, 2)``, all in source (i, j), by what they are:
        ``boundary``, ``spline``, ``seed``, ``corners``, ``links``.
    row : str
        Name of the row that the panel begins.
    """

    title: str
    layers: dict[str, np.ndarray]
    detail: str = ""
    row: str = ""


@dataclass(frozen=True)
class SliceFigure:
    """A figure of one slice, as a comparison leaves it for the report to draw.

    Attributes
    ----------
    panels : list of Panel
        Row by row.
    columns : int
        Panels in a row; 0 for all.
    window : (2, 2) int64 or None
        First and last pixel (i, j) shown; None for all that is drawn.
    image : (I, J) uint8 or None
        The grey slice within the window.
    """

    panels: list[Panel]
    columns: int = 0
    window: np.ndarray | None = None
    image: np.ndarray | None = None


@dataclass(frozen=True)
class View:
    """What the page's viewer shows of one structure beside its curves and control nets.

    Attributes
    ----------
    meshes : dict of str to Mesh
        Made small: ``surface`` and, of a mask, ``cubes``: marching cubes on it.
    values : dict of str to (V,) float
        At the surface's vertices: ``curvature`` in 1/mm and, with a reference, ``distance`` in mm; with an
        error band, its width ``band`` in mm.
    triangles : int
        Of the whole surface.
    reference : str
        What ``distance`` is measured to; empty without it.
    flags : dict of str to (P,) bool
        ``dropped`` of the boundary's pixels, ``bridged`` of the curves' points.
    band : dict of str to Curves
        Lines in which the slices meet the ``inner`` and the ``outer`` surface of the error band.
    """

    meshes: dict[str, Mesh]
    values: dict[str, np.ndarray]
    triangles: int
    reference: str
    flags: dict[str, np.ndarray]
    band: dict[str, Curves] = field(default_factory=dict)


def write_figures(path: str | Path, figures: Mapping[str, SliceFigure]) -> None:
    """Write what the report draws of one structure: one group per figure, in it one per panel."""
    with new_file(path) as file:
        for name, figure in figures.items():
            write_fields(file.create_group(name), figure)


def read_figure(path: str | Path, name: str) -> SliceFigure | None:
    """Read one figure of `write_figures`; None when the structure has nothing to draw for it."""
    with open_file(path) as file:
        return read_value(file, name, SliceFigure | None)


def write_view(path: str | Path, view: View) -> None:
    """Write ``view.h5``: small meshes, values at their vertices, flags of pixels, lines of the band."""
    with new_file(path) as file:
        meshes = {
            name: Mesh(cast(Any, mesh.vertices.astype(np.float32)), cast(Any, mesh.faces.astype(np.int32)))
            for name, mesh in view.meshes.items()
        }
        values = {name: column.astype(np.float32) for name, column in view.values.items()}
        write_fields(file, replace(view, meshes=meshes, values=values))


def read_view(path: str | Path) -> View:
    """Read ``view.h5``."""
    with open_file(path) as file:
        view = read_fields(file, View)
    meshes = {
        name: Mesh(mesh.vertices.astype(float), mesh.faces.astype(np.int64))
        for name, mesh in view.meshes.items()
    }
    return replace(view, meshes=meshes, values={name: of.astype(float) for name, of in view.values.items()})
