"""The B-spline snake from a circular seed on one structure: Figure 15."""

from __future__ import annotations

import numpy as np
import pandas as pd

from cccd.containers import Curves, Structure
from cccd.geometry.raster import dice, rasterise
from cccd_paper.comparisons.active_contour import seed_circle
from cccd_paper.comparisons.baselines.active_contours import CONTOURS
from cccd_paper.comparisons.baselines.corner_detectors import CORNER_DETECTORS
from cccd_paper.comparisons.parameters import PAPER_TABLE_2
from cccd_paper.comparisons.samples import SliceSample, choose_slices, middle_slice
from cccd_paper.comparisons.timing import timed
from cccd_viewers.page_files import Panel, SliceFigure

# Seeds: radius and offset from the centroid, in radii of a disc of the organ's area. The five of Figure 15,
# by letter; and a sweep from well inside to well outside, from a good guess to a poor one.
_FIGURE_15 = {"a": (1.6, 0.0), "b": (1.2, 0.0), "c": (1.6, 0.3), "d": (1.2, 0.3), "e": (0.5, 0.0)}
_RADII = (0.4, 0.7, 1.0, 1.3, 1.6)
_OFFSETS = (0.0, 0.25, 0.5)
#: Slices of each structure, spread evenly: each takes a run per seed.
_SLICES = 2


def compare_active_contour(structure: Structure, curves: Curves, seed: int) -> pd.DataFrame:
    """Wrap each slice from seeds of many radii and positions.

    Parameters
    ----------
    structure : Structure
    curves : Curves
        The ordered curves, taken as the truth.
    seed : int
        Of the direction in which seeds are moved off the organ's centroid, one for each slice.

    Returns
    -------
    DataFrame
        One row per slice, method (snake on corners, snake on the grey image) and seed: ``setting`` (a
        letter of Figure 15, or ``grid``), ``radius`` and ``offset`` in equivalent radii of the organ
        (that of a disc of its area), ``angle`` in degrees, ``corners``, ``dice``, ``ms``.
    """
    rng = np.random.default_rng(seed)
    rows = []
    for sample in choose_slices(structure, curves, _SLICES):
        angle = float(rng.uniform(0, 2 * np.pi))
        seeds = [(name, *where) for name, where in _FIGURE_15.items()]
        seeds += [("grid", radius, offset) for radius in _RADII for offset in _OFFSETS]
        corners = snake_corners(sample)
        for name, method in CONTOURS.items():
            if name not in {"corners", *sample.images}:
                continue
            for setting, radius, offset in seeds:
                curve, seconds = timed(snake, sample, name, radius, offset, angle)
                region = rasterise([curve], sample.origin, sample.region.shape)
                rows.append(
                    {
                        "case": structure.case,
                        "organ": structure.organ,
                        "slice": sample.k,
                        "method": method.title,
                        "setting": setting,
                        "radius": radius,
                        "offset": offset,
                        "angle": np.degrees(angle),
                        "corners": len(corners),
                        "dice": float(dice(sample.region, region)),
                        "ms": 1e3 * seconds,
                    }
                )
    return pd.DataFrame(rows)


def active_contour_figures(structure: Structure, curves: Curves, seed: int) -> dict[str, SliceFigure]:
    """Figure 15: the snake's seed, its targets, its end and the boundary, one column per setting.

    The upper row is the snake on corners, as in the paper, the lower row the snake on the grey image where
    there is one. Parameters as in `compare_active_contour`; nothing where there is no curve.
    """
    sample = middle_slice(structure, curves, _SLICES)
    if sample is None:
        return {}
    angle = float(np.random.default_rng(seed).uniform(0, 2 * np.pi))
    panels = [
        _snake_panel(sample, name, letter, radius, offset, angle)
        for name in CONTOURS
        if name in {"corners", *sample.images}
        for letter, (radius, offset) in _FIGURE_15.items()
    ]
    return {"figure15": SliceFigure(panels, len(_FIGURE_15), sample.window, sample.images[sample.picture])}


def _snake_panel(
    sample: SliceSample, name: str, letter: str, radius: float, offset: float, angle: float
) -> Panel:
    curve = snake(sample, name, radius, offset, angle)
    layers = {"boundary": sample.curve, "seed": seed_circle(*seed_of(sample, radius, offset, angle), 90)}
    if name == "corners":
        layers["corners"] = snake_corners(sample)
    score = f"Dice {sample.dice_percent(curve):.1f} %"
    title = f"{letter}: radius {radius:g}, offset {offset:g}"
    return Panel(title, layers | {"spline": curve}, score, CONTOURS[name].title)


def equivalent_radius(sample: SliceSample) -> float:
    """Radius in pixels of the disc that has the area of the slice's region."""
    return float(np.sqrt(np.count_nonzero(sample.region) / np.pi))


def snake_corners(sample: SliceSample) -> np.ndarray:
    """Shi-Tomasi corners (K, 2) of the organ's mask in source (i, j), the snake's targets in the paper."""
    parameters = PAPER_TABLE_2["shi_tomasi"]
    return CORNER_DETECTORS["shi_tomasi"].run(sample.images["mask"], **parameters) + sample.origin


def seed_of(sample: SliceSample, radius: float, offset: float, angle: float) -> tuple[np.ndarray, float]:
    """Centre (2,) in source (i, j) and radius in pixels of a seed given in equivalent radii."""
    unit = equivalent_radius(sample)
    centre = np.argwhere(sample.region).mean(0) + sample.origin
    return centre + offset * unit * np.array([np.sin(angle), np.cos(angle)]), radius * unit


def snake(sample: SliceSample, name: str, radius: float, offset: float, angle: float) -> np.ndarray:
    """Curve (n, 2) in source (i, j) of a registered contour from a seed given in equivalent radii."""
    centre, size = seed_of(sample, radius, offset, angle)
    run = CONTOURS[name].run
    if name == "corners":
        return run(snake_corners(sample), centre, size)
    return run(sample.images[name], centre - sample.origin, size) + sample.origin
