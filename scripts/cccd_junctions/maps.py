"""Boundary maps in memory, ordered."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cccd.api import checked_settings, one_thread
from cccd.containers import Curves, Frame, Structure
from cccd.errors import InputError
from cccd.extras import needing
from cccd.inputs.grid import check_affine, find_slice_axis
from cccd.project import SHIPPED_WEIGHTS
from cccd.settings.root import Settings
from cccd_junctions.ordering import order_maps


@needing("cccd.order", "gnn")
@one_thread
def order(
    boundary_map: np.ndarray,
    affine: np.ndarray | None = None,
    *,
    image: np.ndarray | None = None,
    weights: str | Path = SHIPPED_WEIGHTS,
    settings: Settings | None = None,
) -> Curves:
    """Order the pixels of noisy boundary maps into closed simple curves; needs the extra ``gnn``.

    Parameters
    ----------
    boundary_map : (a, b) or (a, b, c) array
        One map or a stack of maps: every value but 0 is a boundary pixel.
    affine : (4, 4) float, optional
        Index to world mm (RAS); slices are stacked along the largest spacing. Default: voxels of one mm.
    image : array, optional
        The grey slices, of the same shape.
    weights : path
        A trained network. Default: the shipped one.
    settings : Settings, optional
        Section ``gnn.inference``.

    Returns
    -------
    Curves
        Points (i, j) of each closed curve, for `fit_contours` and `reconstruct`.

    Raises
    ------
    InputError
        No map encloses a region.
    """
    settings = checked_settings(settings)
    maps = np.asarray(boundary_map) != 0
    grey = None if image is None else np.asarray(image, np.float32)
    if maps.ndim == 2:
        maps, grey = maps[..., None], None if grey is None else grey[..., None]
    if maps.ndim != 3 or (grey is not None and grey.shape != maps.shape):
        raise InputError(
            "boundary map",
            f"an array of shape {maps.shape}",
            "give (a, b) or (a, b, c), and an image of the same shape",
        )
    grid = check_affine(np.eye(4) if affine is None else affine, "affine")
    a, b, c = maps.shape
    axis = 2 if np.ndim(boundary_map) == 2 else find_slice_axis(grid, settings.import_.slice_axis)
    frame = Frame(grid, axis, (a, b, c))
    structure = Structure("boundary", "map", frame, np.zeros(3, np.int64), image=grey, boundary=maps)
    return order_maps(structure, settings.boundaries, settings.gnn.inference, weights)
