"""napari's plugin: a labels layer becomes a smooth surface layer, and files of surfaces open.

napari finds it by the manifest ``napari.yaml``; nothing else imports it, nor napari.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import numpy as np

from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray

#: What napari makes a layer of: data, its arguments, its kind.
LayerData = tuple[Any, dict[str, Any], str]


def make_surface(
    labels: napari.layers.Labels,  # noqa: F821  # pyright: ignore[reportUndefinedVariable]
    label: int = 0,
    annotated: Literal["auto", "nonempty", "every slice"] = "auto",
    colour_by_error_band: bool = False,
) -> list[napari.types.LayerDataTuple]:  # noqa: F821  # pyright: ignore[reportUndefinedVariable]
    """Make a smooth closed surface of a labels layer, as a layer in the same place.

    Parameters
    ----------
    labels : napari.layers.Labels
        Three axes; its scale, or its affine, says how large voxels are.
    label : int
        The organ's value; 0: the label that is selected in the layer.
    annotated : {"auto", "nonempty", "every slice"}
        Which slices are annotated; the others are filled (`cccd.read`).
    colour_by_error_band : bool
        The values of the surface's vertices are the width of its error band in mm.

    Returns
    -------
    list of (data, dict, "surface")
        One layer; none where the labels give no surface, and napari then says why.
    """
    from napari.utils import progress  # pyright: ignore[reportMissingImports]
    from napari.utils.notifications import (  # pyright: ignore[reportMissingImports]
        show_error,
        show_warning,
    )

    if labels is None:
        show_error("there is no labels layer: open one, or draw one")
        return []
    steps = progress(total=3, desc="smooth surface")
    try:
        made, warnings = surface_of_layer(
            labels, label, annotated, colour_by_error_band, lambda name: steps.update(1)
        )
    except InputError as error:
        show_error(str(error))
        return []
    finally:
        steps.close()
    for warning in warnings:
        show_warning(f"{labels.name}: {warning}")
    return [made]


def surface_of_layer(
    labels: Any,
    label: int = 0,
    annotated: str = "auto",
    colour_by_error_band: bool = False,
    progress: Callable[[str], None] | None = None,
) -> tuple[LayerData, list[str]]:
    """Make the data of a surface layer; see `make_surface`.

    Returns
    -------
    layer : (data, dict, "surface")
        Vertices are in napari's world, so the layer needs no scale.
    warnings : list of str

    Raises
    ------
    InputError
        The layer has not three axes, nothing of the label, or too few slices with it.
    """
    import cccd

    name = f"layer {labels.name}"
    if labels.ndim != 3:
        raise InputError(name, f"it has {labels.ndim} axes, not three", "choose one time point or channel")
    value = int(label) or int(labels.selected_label)
    mask = np.asarray(labels.data) == value
    if not mask.any():
        there = ", ".join(map(str, np.unique(np.asarray(labels.data))[:10]))
        raise InputError(name, f"no voxel has the label {value}", f"its values: {there}")
    affine = affine_of_layer(labels)
    surface = cccd.reconstruct(mask, affine, annotated=annotated, progress=progress)
    warnings = list(surface.warnings)
    if np.array_equal(affine[:3, :3], np.eye(3)):
        warnings.append("its scale is 1 in all directions: set layer.scale to the voxels' edges in mm")
    vertices, faces = surface.vertices, surface.faces
    values = np.ones(len(vertices))
    arguments: dict[str, Any] = {"name": f"{labels.name} {value} surface", "colormap": "gray"}
    band = surface.lofted.band
    if colour_by_error_band and band is not None:
        values = np.asarray(band.outer + band.inner, float)
        arguments["colormap"] = "viridis"
    if getattr(labels, "units", None) is not None:
        arguments["units"] = labels.units
    arguments["metadata"] = {"volume_ml": surface.volume / 1000, "warnings": warnings}
    return ((vertices, faces, values), arguments, "surface"), warnings


def affine_of_layer(layer: Any) -> FloatArray:
    """Give the affine (4, 4) from a layer's voxels to napari's world."""
    corners = np.vstack([np.zeros(3), np.eye(3)])
    world = np.array([layer.data_to_world(corner) for corner in corners], float)
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = (world[1:] - world[0]).T, world[0]
    return affine


def get_reader(path: str | list[str]) -> Callable[[Any], list[LayerData]] | None:
    """Give napari a reader of surfaces, for files that have one."""
    from cccd_meshes.read_meshes import is_mesh

    paths = [path] if isinstance(path, str) else path
    return read_surfaces if all(is_mesh(Path(one)) for one in paths) else None


def read_surfaces(path: str | list[str]) -> list[LayerData]:
    """Read files of surfaces; their x, y and z are the axes 2, 1 and 0, as in images that napari opens."""
    from cccd_meshes.read_meshes import read_mesh

    layers: list[LayerData] = []
    for one in [path] if isinstance(path, str) else path:
        mesh = read_mesh(one).mesh
        data = mesh.vertices[:, ::-1], mesh.faces[:, ::-1]
        layers.append((data, {"name": Path(one).stem, "colormap": "gray"}, "surface"))
    return layers
