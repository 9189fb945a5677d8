"""Surfaces to rotate in a page: figures of plotly.js (MIT licence), which the page carries along.

The figures are JSON as ``Plotly.newPlot`` takes it. ``viewer.js`` inflates library and figure when a figure
comes into sight; the page asks no server for anything.
"""

from __future__ import annotations

import base64
import html
import json
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cccd.containers import Curves
from cccd.geometry.mesh import Mesh
from cccd.geometry.subdivision import ControlMesh, quad_edges
from cccd_viewers.page_files import View

#: Brewer's RdBu, PuOr and YlOrRd, distinct with any colour vision: reading them from Matplotlib takes .5 s.
_COLOURS = {
    "distance": "0530612166ac4393c392c5ded1e5f0f7f7f7fddbc7f4a582d6604db2182b67001f",
    "curvature": "2d004b5427888073acb2abd2d8daebf7f7f7fee0b6fdb863e08214b358067f3b08",
    "band": "ffffccffeda0fed976feb24cfd8d3cfc4e2ae31a1cbd0026800026",
}

#: Percentile of the values at which a scale ends.
_PERCENTILES = {"distance": 98, "band": 98, "curvature": 95}

_TITLES = {
    "distance": "Distance to {} (mm)",
    "band": "Width of the error band (mm)",
    "curvature": "Mean curvature (1/mm)",
}

_LIGHT = {"ambient": 0.3, "diffuse": 0.6, "specular": 0.15, "roughness": 0.6, "fresnel": 0.1}
_LAMP = {"x": -60_000, "y": -80_000, "z": -60_000}
_COLOUR, _OTHER, _GREY = "#d4b399", "#9eadbd", "#808080"
_NET, _CURVES = "#008f6b", "#1a5c9e"

#: Coordinates of meshes and of lines are rounded to this many decimals of a mm.
_DECIMALS, _OF_LINES = 2, 1


def surface_figure(
    view: View,
    bodies: Sequence[ControlMesh] = (),
    curves: Curves | None = None,
    other: str = "",
    colour: str = "",
) -> dict[str, Any]:
    """Show one structure's surface, with its control mesh and its slices' curves to switch on.

    Parameters
    ----------
    view : View
        Its meshes and what colours the first one.
    bodies : sequence of ControlMesh, optional
        The closed splines, mm RAS.
    curves : Curves, optional
        On the slices.
    other : str, optional
        What the second mesh of the view is called; it is left out without a name.
    colour : str, optional
        Key of ``view.values`` that colours the surface at first; plain without it.

    Returns
    -------
    dict
        ``data`` and ``layout``.
    """
    scales = {name: _scale(view, name) for name in _TITLES if name in view.values}
    surface = _mesh(view.meshes["surface"], "Surface", _COLOUR) | scales.get(colour, {})
    traces = [surface]
    if other:
        traces.append(_mesh(view.meshes["cubes"], other, _OTHER, visible="legendonly"))
    if bodies:
        traces.append(_lines(_net_lines(bodies), "Control mesh", _NET))
    if curves is not None and len(curves):
        traces.append(_lines(_curve_lines(curves), "Curves on the slices", _CURVES))
    choices = {"plain": {"intensity": None, "showscale": False}} | scales
    buttons = [
        {"label": name, "method": "restyle", "args": [{key: [part] for key, part in change.items()}, [0]]}
        for name, change in choices.items()
    ]
    menu = {"buttons": buttons, "x": 0, "xanchor": "left", "y": 1, "yanchor": "top"}
    menu["active"] = list(choices).index(colour) if colour in choices else 0
    return {"data": traces, "layout": _layout([menu])}


def case_figure(organs: Sequence[Mapping[str, Any]], meshes: Mapping[str, Mesh]) -> dict[str, Any]:
    """Show all organs of a case, to switch off by a click on their names, opaque or half transparent.

    Parameters
    ----------
    organs : sequence of mapping
        ``organ``, ``name``, ``color`` (``#rrggbb``) and ``volume_ml`` of each, as ``scene.json`` has them.
    meshes : mapping of str to Mesh
        By organ, mm RAS.
    """
    traces = [
        _mesh(meshes[organ["organ"]], f"{organ['name']} ({organ['volume_ml']:.4g} ml)", organ["color"])
        for organ in sorted(organs, key=lambda organ: -organ["volume_ml"])
    ]
    changes = {
        "opaque": {"opacity": 1},
        "half transparent": {"opacity": 0.35},
        "show all": {"visible": True},
        "hide all": {"visible": "legendonly"},
    }
    buttons = [{"label": name, "method": "restyle", "args": [change]} for name, change in changes.items()]
    menu = {"type": "buttons", "direction": "right", "buttons": buttons, "showactive": False}
    return {"data": traces, "layout": _layout([menu | {"x": 0, "xanchor": "left", "y": 1, "yanchor": "top"}])}


def deflate(text: str) -> str:
    """Compress a text as ``viewer.js`` inflates it: zlib, base64."""
    return base64.b64encode(zlib.compress(text.encode(), 6)).decode("ascii")


def packed(figure: Mapping[str, Any]) -> str:
    """Write a figure into a page."""
    return deflate(json.dumps(figure, allow_nan=False))


def colour_stops(count: int = 65) -> dict[str, list[list[int]]]:
    """Colours (count, 3) of 0..255 of every scale, low to high."""
    stops: dict[str, list[list[int]]] = {}
    for name, written in _COLOURS.items():
        known = np.frombuffer(bytes.fromhex(written), np.uint8).reshape(-1, 3)
        at = np.linspace(0, len(known) - 1, count)
        between = np.rint([np.interp(at, np.arange(len(known)), channel) for channel in known.T])
        stops[name] = between.T.astype(int).tolist()
    return stops


def colour_limit(values: np.ndarray, name: str) -> float:
    """Choose a round number at which a colour scale ends, so that few values (P,) lie beyond."""
    value = float(np.percentile(np.abs(values), _PERCENTILES[name]))
    if not np.isfinite(value) or value <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(n * power for n in (1, 1.5, 2, 3, 5, 7, 10) if n * power >= value * (1 - 1e-12)))


def _scale(view: View, name: str) -> dict[str, Any]:
    """Colour the surface by its values of this name."""
    values = view.values[name]
    limit = colour_limit(values, name)
    stops = colour_stops(9)[name]
    title = {"text": html.escape(_TITLES[name].format(view.reference)), "side": "right"}
    return {
        "intensity": _typed(values, np.float32),
        "colorscale": [[n / 8, f"rgb({r},{g},{b})"] for n, (r, g, b) in enumerate(stops)],
        "cmin": 0 if name == "band" else -limit,
        "cmax": limit,
        "showscale": True,
        "colorbar": {"title": title, "thickness": 14, "len": 0.7, "y": 0.4},
    }


def _mesh(mesh: Mesh, name: str, colour: str, **options: Any) -> dict[str, Any]:
    points = np.round(mesh.vertices, _DECIMALS)
    axes = {axis: _typed(points[:, n], np.float32) for n, axis in enumerate("xyz")}
    corners = {corner: _typed(mesh.faces[:, n], np.uint32) for n, corner in enumerate("ijk")}
    # plotly.js reads tags in names
    shown = {"type": "mesh3d", "name": html.escape(name), "color": colour, "hoverinfo": "x+y+z+name"}
    shown |= {"showlegend": True, "showscale": False, "lighting": _LIGHT, "lightposition": _LAMP}
    return shown | axes | corners | options


def _lines(points: np.ndarray, name: str, colour: str) -> dict[str, Any]:
    """Lines through points (P, 3), broken where these are not finite; switched off at first."""
    axes = {axis: _typed(np.round(points[:, n], _OF_LINES), np.float32) for n, axis in enumerate("xyz")}
    line = {"mode": "lines", "line": {"color": colour, "width": 1.5}, "hoverinfo": "skip"}
    return {"type": "scatter3d", "name": name, "visible": "legendonly"} | axes | line


def _net_lines(bodies: Sequence[ControlMesh]) -> np.ndarray:
    """Edges of control meshes, each followed by a break."""
    ends = np.concatenate([body.vertices[quad_edges(body.quads)[0]] for body in bodies])
    return np.concatenate([ends, np.full((len(ends), 1, 3), np.nan)], axis=1).reshape(-1, 3)


def _curve_lines(curves: Curves) -> np.ndarray:
    """Curves in mm RAS, each closed and followed by a break."""
    k = np.repeat(curves.slice, np.diff(curves.offsets))
    index = np.column_stack([curves.points, k, np.ones(len(k))])
    world = (index @ curves.frame.stack_affine.T)[:, :3]
    gap = np.full((1, 3), np.nan)
    parts = [np.concatenate([one, one[:1], gap]) for one in np.split(world, curves.offsets[1:-1])]
    return np.concatenate(parts)


def _typed(values: np.ndarray, kind: type) -> dict[str, str]:
    """Numbers as plotly.js reads them from base64."""
    array = np.ascontiguousarray(values, kind)
    name = {"float32": "f4", "uint32": "u4"}[array.dtype.name]
    return {"dtype": name, "bdata": base64.b64encode(array.tobytes()).decode("ascii")}


def _layout(menus: list[dict[str, Any]]) -> dict[str, Any]:
    """Set true proportions, seen from the front in parallel projection: the patient's left on the right."""
    names = {"xaxis": "right (mm)", "yaxis": "front (mm)", "zaxis": "head (mm)"}
    axis = {"showbackground": False, "gridcolor": "#b5b5b5", "zeroline": False}
    scene: dict[str, Any] = {key: axis | {"title": {"text": name}} for key, name in names.items()}
    eye = {"x": 0.45, "y": 1.8, "z": 0.5}
    scene |= {"aspectmode": "data", "camera": {"projection": {"type": "orthographic"}, "eye": eye}}
    return {
        "scene": scene,
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "font": {"color": _GREY, "family": "sans-serif"},
        "showlegend": True,
        "legend": {"x": 0, "xanchor": "left", "y": 0, "yanchor": "bottom", "bgcolor": "rgba(0,0,0,0)"},
        "updatemenus": menus,
    }
