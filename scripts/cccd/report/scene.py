"""What the interactive part of a structure holds: meshes, control net, curves and slices, packed."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.interpolate import BSpline

from cccd.chaincode import broken_links, isolated_corners, junction_pixels, on_pixel_chain
from cccd.containers import Boundaries, Curves, Frame, Splines, Structure
from cccd.geometry.bsplines import Patch
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh
from cccd.geometry.ply import read_ply
from cccd.report.meshes import (
    mean_curvature,
    reference_surface,
    simplify,
    sort_spatially,
    voxel_surface,
)
from cccd.report.payload import Grid, pack, quantise
from cccd.report.results import StructureFiles

__all__ = ["Legend", "Scene", "build_scene", "colour_stops"]

#: Diverging maps that remain distinct with any colour vision (Brewer), by what they show.
COLOUR_MAPS = {"distance": "RdBu_r", "curvature": "PuOr_r"}

#: In-plane coordinates are kept to this share of a pixel (coarser for organs over 2000 pixels wide).
_PIXEL_STEP = 1 / 32

#: All slices of a structure together have at most this many pixels in the page.
_SPRITE_PIXELS = 4_000_000

#: The largest width and height that WebP allows.
_WEBP_SIDE = 16383


@dataclass(frozen=True)
class Legend:
    """A colour scale: values run from ``-limit`` to ``limit`` in ``unit``."""

    name: str
    title: str
    limit: float
    unit: str
    low: str
    high: str


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


def build_scene(files: StructureFiles, triangles: int) -> Scene | None:
    """Read one structure's files and pack what there is of them; None when there is nothing to show.

    Parameters
    ----------
    files : StructureFiles
    triangles : int
        Each mesh is simplified to at most this many triangles.
    """
    structure = files.structure()
    scene = Scene("")
    meta: dict[str, Any] = {}
    arrays: dict[str, np.ndarray] = {}
    if files.mesh.is_file():
        _add_meshes(scene, meta, arrays, read_ply(files.mesh), structure, triangles)
    _add_net(scene, meta, arrays, files.patches())
    boundaries, curves = files.boundaries(), files.curves()
    if structure is not None and (boundaries is not None or curves is not None):
        _add_slices(scene, meta, arrays, structure, boundaries, curves, files.splines(), files.corners())
    if not arrays:
        return None
    scene.data = pack(meta, arrays)
    return scene


# The surface ------------------------------------------------------------------------------------------


def _add_meshes(
    scene: Scene,
    meta: dict,
    arrays: dict,
    surface: Mesh,
    structure: Structure | None,
    triangles: int,
) -> None:
    shown, _ = sort_spatially(simplify(surface, triangles))
    cubes = voxel_surface(structure) if structure is not None else None
    reference = reference_surface(structure) if structure is not None else None
    small_cubes = sort_spatially(simplify(cubes, triangles))[0] if cubes is not None else None
    meshes = {"surface": shown} | ({"cubes": small_cubes} if small_cubes is not None else {})
    grid = Grid(np.concatenate([mesh.vertices for mesh in meshes.values()]))
    meta["mm"] = grid
    for name, mesh in meshes.items():
        arrays[f"{name}_points"] = quantise(mesh.vertices, grid)
        arrays[f"{name}_faces"] = mesh.faces.astype(np.uint32)
        scene.parts.add(name)
    _add_values(
        scene, arrays, "curvature", mean_curvature(surface, shown.vertices),
        ("Mean curvature", "per mm", "hollow", "domed"), 95,
    )  # fmt: skip
    if reference is not None:
        mesh, name = reference
        _add_values(
            scene, arrays, "distance", to_mesh(shown.vertices, mesh),
            (f"Distance to {name}", "mm", "inside", "outside"), 98,
        )  # fmt: skip
    if len(shown.faces) < len(surface.faces):
        scene.notes.append(
            f"Simplified for this page from {len(surface.faces):,} to {len(shown.faces):,} triangles."
        )


def _add_values(
    scene: Scene,
    arrays: dict,
    key: str,
    values: np.ndarray,
    words: tuple[str, str, str, str],
    percentile: float,
) -> None:
    """Values at the surface's vertices as bytes on a symmetric scale that spans the given percentile."""
    limit = _round_up(float(np.percentile(np.abs(values), percentile)))
    arrays[f"surface_{key}"] = np.rint(np.clip(values / limit, -1, 1) * 127.5 + 127.5).astype(np.uint8)
    title, unit, low, high = words
    scene.legends.insert(0, Legend(key, title, limit, unit, low, high))


def _round_up(value: float) -> float:
    """Go up to the next of 1, 1.5, 2, 3, 5, 7 times a power of ten."""
    if not np.isfinite(value) or value <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(n * power for n in (1, 1.5, 2, 3, 5, 7, 10) if n * power >= value * (1 - 1e-12)))


def _add_net(scene: Scene, meta: dict, arrays: dict, patches: list[Patch] | None) -> None:
    if not patches:
        return
    points = np.concatenate([patch.control_points.reshape(-1, 3) for patch in patches])
    meta["net_mm"] = Grid(points)
    arrays["net_points"] = quantise(points, meta["net_mm"])
    meta["patches"] = [
        {
            "nu": patch.control_points.shape[0],
            "nv": patch.control_points.shape[1],
            "closed_u": patch.closed_u,
            "closed_v": patch.closed_v,
        }
        for patch in patches
    ]
    scene.parts.add("net")


# The slices -------------------------------------------------------------------------------------------


def _add_slices(
    scene: Scene,
    meta: dict,
    arrays: dict,
    structure: Structure,
    boundaries: Boundaries | None,
    curves: Curves | None,
    splines: Splines | None,
    corners: tuple[np.ndarray, np.ndarray] | None,
) -> None:
    found = [part.slice for part in (boundaries, curves) if part is not None and len(part)]
    if not found:
        return
    every = np.concatenate(found)
    k = np.arange(every.min(), every.max() + 1)
    points = [part.points for part in (boundaries, curves) if part is not None]
    low, high = _window(structure, np.concatenate(points).astype(float))
    pixels = Grid(np.array([low - 1.0, high + 1.0]), _PIXEL_STEP)
    frame = structure.frame
    meta |= {"pixels": pixels, "stack_affine": frame.stack_affine.tolist()}

    def add(name: str, where: np.ndarray, owner: np.ndarray) -> None:
        arrays[f"{name}_points"] = quantise(where.reshape(-1, 2), pixels)
        arrays[f"{name}_offsets"] = np.searchsorted(owner, [*k, k[-1] + 1]).astype(np.uint32)

    if boundaries is not None:
        owner = np.repeat(boundaries.slice, np.diff(boundaries.offsets))
        add("boundary", boundaries.points, owner)
        for name, flags in (
            ("junctions", junction_pixels(boundaries)),
            ("isolated_before", isolated_corners(boundaries)),
        ):
            add(name, boundaries.points[flags], owner[flags])
    if curves is not None and splines is not None and corners is not None:
        owner = np.repeat(curves.slice, np.diff(curves.offsets))
        if on_pixel_chain(curves.points, curves.offsets).any():  # contours as given have no chain code
            broken = broken_links(curves.points, curves.offsets)
            add("isolated_after", curves.points[broken], owner[broken])
        add("corners", corners[0], np.repeat(curves.slice, np.diff(corners[1])))
        line, offsets = _evaluate(splines)
        arrays["curve_points"] = quantise(line, pixels)
        arrays["curve_offsets"] = offsets.astype(np.uint32)
        arrays["curve_slice"] = splines.slice.astype(np.uint32)
        scene.parts.add("curves")
    picture, right, down = _display(frame, low, high)
    layout = {"k": k.tolist(), **picture}
    tiles, tile = _tiles(structure, k, low, high, picture)
    if tiles is not None:
        scene.sprite = _webp(tiles)
    meta["slices"] = layout | {"tile": tile}
    scene.sides = _letters(right, down)
    scene.parts.add("slices")


def _window(structure: Structure, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last pixel (i, j) shown: the structure's crop, or what the points cover."""
    for name in ("image", "mask", "boundary"):
        stack = structure.stack(name)
        if stack is not None:
            low = structure.stack_origin[1:]
            return low.astype(int), low + np.array(stack.shape[1:]) - 1
    return np.floor(points.min(axis=0)).astype(int) - 3, np.ceil(points.max(axis=0)).astype(int) + 3


def _evaluate(splines: Splines) -> tuple[np.ndarray, np.ndarray]:
    """Polylines of the closed splines: points (P, 2) and offsets (C + 1,)."""
    parts, degree = [], splines.degree
    for control, knots in splines:
        count = int(np.clip(4 * len(control), 24, 240))
        u = np.linspace(knots[degree], knots[-degree - 1], count, endpoint=False)
        parts.append(BSpline(knots, np.vstack([control, control[:degree]]), degree)(u))
    offsets = np.concatenate([[0], np.cumsum([len(part) for part in parts])])
    return (np.concatenate(parts) if parts else np.zeros((0, 2))), offsets


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


def _tiles(
    structure: Structure, k: np.ndarray, low: np.ndarray, high: np.ndarray, picture: Mapping[str, Any]
) -> tuple[np.ndarray | None, dict]:
    """Lay the slices side by side in one 8-bit image, each as it lies on the screen; tell the arrangement."""
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
