"""What the interactive part of a structure holds: meshes, control net, curves and slices, packed."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from cccd.containers import Boundaries, Curves, Frame, Structure, View
from cccd.report.net import ControlNet
from cccd.report.payload import Grid, pack, quantise
from cccd.report.results import StructureFiles

__all__ = ["Legend", "Scene", "build_scene", "build_surface_scene", "colour_limit", "colour_stops"]

#: Diverging maps that remain distinct with any colour vision (Brewer), by what they show.
COLOUR_MAPS = {"distance": "RdBu_r", "curvature": "PuOr_r", "band": "YlOrRd"}

#: Percentile of the values at which a scale ends.
_PERCENTILES = {"distance": 98, "band": 98, "curvature": 95}

#: In-plane coordinates are kept to this share of a pixel (coarser for organs over 2000 pixels wide).
_PIXEL_STEP = 1 / 32

#: All slices of a structure together have at most this many pixels in the page.
_SPRITE_PIXELS = 4_000_000

#: The largest width and height that WebP allows.
_WEBP_SIDE = 16383


@dataclass(frozen=True)
class Legend:
    """A colour scale: values run from ``least`` to ``limit`` in ``unit``."""

    name: str
    title: str
    limit: float
    unit: str
    low: str
    high: str
    least: float


@dataclass
class Scene:
    """The packed data of one structure.

    Attributes
    ----------
    data : str
        What `cccd.report.payload.pack` made.
    sprite : str or None
        All slices side by side as base64 WebP.
    parts : set of str
        Which of surface, cubes, net, curves, slices there are.
    legends : list of Legend
    sides : dict
        Letters of the patient's sides at the slice picture's left, right, top and bottom.
    notes : list of str
        What the page should say about the view.
    """

    data: str
    sprite: str | None = None
    parts: set[str] = field(default_factory=set)
    legends: list[Legend] = field(default_factory=list)
    sides: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def colour_stops(count: int = 65) -> dict[str, list[list[int]]]:
    """Colours (count, 3) of 0..255 of every scale, low to high."""
    from matplotlib import colormaps

    share = np.linspace(0, 1, count)
    return {
        name: np.rint(255 * colormaps[map_name](share)[:, :3]).astype(int).tolist()
        for name, map_name in COLOUR_MAPS.items()
    }


@dataclass
class _Piece:
    """Part of a scene: JSON values and arrays for the viewer, and what the page says about them."""

    meta: dict[str, Any] = field(default_factory=dict)
    arrays: dict[str, np.ndarray] = field(default_factory=dict)
    parts: set[str] = field(default_factory=set)
    legends: list[Legend] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def build_scene(files: StructureFiles) -> Scene | None:
    """Pack what there is of one structure's files; None when there is nothing to show."""
    structure, view, net = files.structure(), files.view(), files.net()
    boundaries, curves = files.boundaries(), files.curves()
    pieces = [_pack_meshes(view)] if view is not None else []
    pieces += [_pack_net(net)] if net is not None else []
    scene = Scene("")
    found = [part for part in (boundaries, curves) if part is not None and len(part)]
    if structure is not None and found:
        flags, band = (view.flags, view.band) if view is not None else ({}, {})
        window = _Window.around(structure, found, [*band.values()])
        picture, right, down = _display(structure.frame, window.low, window.high)
        scene.sides = _letters(right, down)
        tiles, tile = _tiles(structure, window.k, picture)
        scene.sprite = _webp(tiles) if tiles is not None else None
        pieces += [_pack_layout(window, structure.frame, {**picture, "tile": tile})]
        pieces += [_pack_boundaries(window, boundaries, flags)] if boundaries is not None else []
        pieces += [_pack_curves(window, curves, files, flags)] if curves is not None else []
        pieces += [_Piece(arrays=_pack_lines(window, name, lines)) for name, lines in band.items()]
    if not pieces:
        return None
    for piece in pieces:
        scene.parts |= piece.parts
        scene.legends += piece.legends
        scene.notes += piece.notes
    meta = {key: value for piece in pieces for key, value in piece.meta.items()}
    arrays = {key: value for piece in pieces for key, value in piece.arrays.items()}
    scene.data = pack(meta, arrays)
    return scene


def build_surface_scene(view: View) -> Scene:
    """Pack surfaces alone, which belong to no scan."""
    piece = _pack_meshes(view)
    return Scene(pack(piece.meta, piece.arrays), None, piece.parts, piece.legends, {}, piece.notes)


# The surface ------------------------------------------------------------------------------------------


def _pack_meshes(view: View) -> _Piece:
    grid = Grid(np.concatenate([mesh.vertices for mesh in view.meshes.values()]))
    piece = _Piece({"mm": grid}, parts=set(view.meshes))
    for name, mesh in view.meshes.items():
        piece.arrays[f"{name}_points"] = quantise(mesh.vertices, grid)
        piece.arrays[f"{name}_faces"] = mesh.faces.astype(np.uint32)
    shown = view.meshes["surface"]
    scales = {
        "distance": (f"Distance to {view.reference}", "mm", "inside", "outside"),
        "band": ("Width of the error band", "mm", "", ""),
        "curvature": ("Mean curvature", "per mm", "hollow", "domed"),
    }
    for name, (title, unit, low, high) in scales.items():
        if name not in view.values:
            continue
        limit = colour_limit(view.values[name], name)
        least = 0.0 if name == "band" else -limit
        shares = 2 * (view.values[name] - least) / (limit - least) - 1
        piece.arrays[f"surface_{name}"] = _as_bytes(shares)
        piece.legends.append(Legend(name, title, limit, unit, low, high, least))
    if len(shown.faces) < view.triangles:
        piece.notes.append(
            f"Simplified for this page from {view.triangles:,} to {len(shown.faces):,} triangles."
        )
    return piece


def colour_limit(values: np.ndarray, name: str) -> float:
    """Value at which a colour scale ends, so that few values (P,) lie beyond."""
    return _round_up(float(np.percentile(np.abs(values), _PERCENTILES[name])))


def _as_bytes(shares: np.ndarray) -> np.ndarray:
    """Write values from -1 to 1 as bytes, those beyond as the nearer end."""
    return np.rint(np.clip(shares, -1, 1) * 127.5 + 127.5).astype(np.uint8)


def _round_up(value: float) -> float:
    """Go up to the next of 1, 1.5, 2, 3, 5, 7 times a power of ten."""
    if not np.isfinite(value) or value <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(n * power for n in (1, 1.5, 2, 3, 5, 7, 10) if n * power >= value * (1 - 1e-12)))


def _pack_net(net: ControlNet) -> _Piece:
    grid = Grid(net.points)
    arrays = {
        "net_points": quantise(net.points, grid),
        "net_edges": net.edges.astype(np.uint32),
        "net_creases": net.creases.astype(np.uint32),
    }
    return _Piece({"net_mm": grid}, arrays, {"net"})


# The slices -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Window:
    """The slices ``k`` and the pixels from ``low`` to ``high`` that the page shows, and their grid."""

    k: np.ndarray
    low: np.ndarray
    high: np.ndarray
    pixels: Grid

    @classmethod
    def around(
        cls, structure: Structure, found: Sequence[Boundaries | Curves], band: Sequence[Curves] = ()
    ) -> _Window:
        """Show every slice on which there is something, and the structure's whole crop."""
        every = np.concatenate([part.slice for part in found])
        low, high = _extent(structure, np.concatenate([part.points for part in found]).astype(float))
        corners = np.array([low - 1.0, high + 1.0])
        # the band may reach beyond the crop
        pixels = Grid(np.concatenate([corners, *(lines.points for lines in band)]), _PIXEL_STEP)
        return cls(np.arange(every.min(), every.max() + 1), low, high, pixels)

    def per_slice(self, name: str, points: np.ndarray, owner: np.ndarray) -> dict[str, np.ndarray]:
        """Pack points (P, 2) that belong to the slices ``owner`` (P,)."""
        return {
            f"{name}_points": quantise(points.reshape(-1, 2), self.pixels),
            f"{name}_offsets": np.searchsorted(owner, [*self.k, self.k[-1] + 1]).astype(np.uint32),
        }


def _pack_boundaries(window: _Window, boundaries: Boundaries, flags: Mapping[str, np.ndarray]) -> _Piece:
    owner = np.repeat(boundaries.slice, np.diff(boundaries.offsets))
    arrays = window.per_slice("boundary", boundaries.points, owner)
    for name in ("junctions", "isolated_corners", "dropped"):
        if name in flags:
            arrays |= window.per_slice(name, boundaries.points[flags[name]], owner[flags[name]])
    return _Piece(arrays=arrays)


def _pack_curves(
    window: _Window, curves: Curves, files: StructureFiles, flags: Mapping[str, np.ndarray]
) -> _Piece:
    arrays = {}
    if "bridged" in flags:
        owner, bridged = np.repeat(curves.slice, np.diff(curves.offsets)), flags["bridged"]
        arrays |= window.per_slice("bridged", curves.points[bridged], owner[bridged])
    corners, splines = files.corners(), files.splines()
    if corners is None or splines is None:
        return _Piece(arrays=arrays)
    points, offsets = corners
    arrays |= window.per_slice("corners", points, np.repeat(curves.slice, np.diff(offsets)))
    arrays |= _pack_lines(window, "curve", splines.sample(per_pixel=1.0))
    return _Piece(arrays=arrays, parts={"curves"})


def _pack_lines(window: _Window, name: str, lines: Curves) -> dict[str, np.ndarray]:
    """Pack closed lines, each with the slice that it lies on."""
    return {
        f"{name}_points": quantise(lines.points, window.pixels),
        f"{name}_offsets": lines.offsets.astype(np.uint32),
        f"{name}_slice": lines.slice.astype(np.uint32),
    }


def _pack_layout(window: _Window, frame: Frame, picture: Mapping[str, Any]) -> _Piece:
    meta = {
        "pixels": window.pixels,
        "stack_affine": frame.stack_affine.tolist(),
        "slices": {"k": window.k.tolist(), **picture},
    }
    return _Piece(meta, parts={"slices"})


def _extent(structure: Structure, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last pixel (i, j) shown: the structure's crop, or what the points cover."""
    for name in ("image", "mask", "boundary"):
        stack = structure.stack(name)
        if stack is not None:
            low = structure.stack_origin[1:]
            return low.astype(int), low + np.array(stack.shape[1:]) - 1
    return np.floor(points.min(axis=0)).astype(int) - 3, np.ceil(points.max(axis=0)).astype(int) + 3


def _display(frame: Frame, low: np.ndarray, high: np.ndarray) -> tuple[dict, np.ndarray, np.ndarray]:
    """How a slice lies on the screen: as a radiologist reads it.

    Axial and coronal slices have the patient's left on the right; axial slices have the front on top, the
    others the head; sagittal slices have the front on the left.

    Returns
    -------
    picture : dict
        ``width``, ``height`` in pixels, ``aspect`` (height of a pixel over its width) and ``to_picture``,
        the matrix (2, 3) from (i, j, 1) to (x, y) with y down.
    right, down : (3,) float arrays
        Directions in the world (RAS).
    """
    along = frame.stack_affine[:3, :3] / np.linalg.norm(frame.stack_affine[:3, :3], axis=0)
    through = int(np.argmax(np.abs(along[:, 2])))
    right = np.array([0.0, -1.0, 0.0]) if through == 0 else np.array([-1.0, 0.0, 0.0])
    down = np.array([0.0, -1.0, 0.0]) if through == 2 else np.array([0.0, 0.0, -1.0])
    swap = abs(along[:, 0] @ right) + abs(along[:, 1] @ down) < abs(along[:, 1] @ right) + abs(
        along[:, 0] @ down
    )
    axes = (1, 0) if swap else (0, 1)
    matrix = np.zeros((2, 3))
    directions = []
    for row, (axis, wanted) in enumerate(zip(axes, (right, down), strict=True)):
        flip = along[:, axis] @ wanted < 0
        matrix[row, axis] = -1 if flip else 1
        matrix[row, 2] = high[axis] if flip else -low[axis]
        directions.append(-along[:, axis] if flip else along[:, axis])
    size, spacing = high - low + 1, frame.pixel_spacing
    picture = {
        "width": int(size[axes[0]]),
        "height": int(size[axes[1]]),
        "aspect": float(spacing[axes[1]] / spacing[axes[0]]),
        "to_picture": matrix.tolist(),
    }
    return picture, directions[0], directions[1]


def _letters(right: np.ndarray, down: np.ndarray) -> dict[str, str]:
    """Letters of the patient's sides at the picture's edges; two for an oblique slice."""

    def letter(direction: np.ndarray) -> str:
        order = np.argsort(-np.abs(direction))
        return "".join("RAS"[a] if direction[a] > 0 else "LPI"[a] for a in order if abs(direction[a]) > 0.38)

    return {"right": letter(right), "left": letter(-right), "bottom": letter(down), "top": letter(-down)}


def _tiles(structure: Structure, k: np.ndarray, picture: Mapping[str, Any]) -> tuple[np.ndarray | None, dict]:
    """Lay the slices side by side in one 8-bit image, each as it lies on the screen; return the layout."""
    stack = structure.stack("image")
    if stack is None:
        return None, {"columns": 1, "width": 1, "height": 1, "shrink": 1}
    shown = np.full((len(k), *stack.shape[1:]), np.nan, np.float32)
    inside = (k >= structure.stack_origin[0]) & (k < structure.stack_origin[0] + len(stack))
    shown[inside] = stack[k[inside] - structure.stack_origin[0]]
    shrink = max(1, int(np.ceil(np.sqrt(shown.size / _SPRITE_PIXELS))))
    matrix = np.array(picture["to_picture"])
    if matrix[0, 0] != 0:  # x runs along i: rows of the picture are j
        shown = shown.transpose(0, 2, 1)
    x_flipped, y_flipped = matrix[0, :2].sum() < 0, matrix[1, :2].sum() < 0
    shown = shown[:, :: -1 if y_flipped else 1, :: -1 if x_flipped else 1]
    height, width = (-(-n // shrink) for n in shown.shape[1:])
    padding = [(0, 0), (0, height * shrink - shown.shape[1]), (0, width * shrink - shown.shape[2])]
    blocks = np.pad(shown, padding, mode="edge").reshape(len(k), height, shrink, width, shrink)
    grey = blocks.mean(axis=(2, 4))
    finite = grey[np.isfinite(grey)]
    dark, bright = np.percentile(finite, [1, 99.5]) if finite.size else (0.0, 1.0)
    scaled = np.nan_to_num((grey - dark) / max(bright - dark, np.finfo(np.float32).tiny))
    columns = int(np.clip(round(np.sqrt(len(k) * height / width)), 1, _WEBP_SIDE // width))
    rows = -(-len(k) // columns)
    sheet = np.zeros((rows * columns, height, width), np.uint8)
    sheet[: len(k)] = np.rint(255 * np.clip(scaled, 0, 1))
    sheet = sheet.reshape(rows, columns, height, width).transpose(0, 2, 1, 3)
    arrangement = {"columns": columns, "width": width, "height": height, "shrink": shrink}
    return sheet.reshape(rows * height, columns * width), arrangement


def _webp(grey: np.ndarray, quality: int = 70) -> str:
    """Encode a grey picture (h, w) uint8 as base64 WebP."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(grey).save(buffer, "WEBP", quality=quality, method=4)
    return base64.b64encode(buffer.getvalue()).decode("ascii")
