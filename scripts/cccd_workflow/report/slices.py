"""A structure's slices as pictures, with what was found on each as lines and pixels over them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import shapely

from cccd.containers import Boundaries, Curves, Frame, Structure
from cccd_workflow.report.render import webp
from cccd_workflow.report.results import StructureFiles

#: What lies over a slice, by its class in the page.
LAYERS = {
    "boundary": "boundary pixels",
    "dropped": "dropped pixels",
    "bridged": "pixels that bridge gaps",
    "curve": "curve",
    "band": "error band",
    "corners": "corners",
}

#: Most slices of a structure that are shown, evenly spread, and most pixels of all of them together.
_MOST, _PIXELS = 60, 2_500_000

#: Lines are kept to this share of a pixel, and their points rounded to as many decimals.
_LINE_PX, _DECIMALS = 0.15, 1


@dataclass(frozen=True)
class SliceSheet:
    """Slices of one structure.

    Attributes
    ----------
    pictures : list of (int, str)
        Number of each slice and its ``<svg>``.
    layers : dict of str to str
        Those of `LAYERS` that are somewhere on them.
    sides : dict of str to str
        Letters of the patient's sides at a picture's left, right, top and bottom.
    count : int
        Slices that there are; not all are shown where there are many.
    """

    pictures: list[tuple[int, str]]
    layers: dict[str, str]
    sides: dict[str, str]
    count: int


def draw_slices(files: StructureFiles) -> SliceSheet | None:
    """Draw a structure's slices; None where there is nothing to draw."""
    structure, curves, boundaries = files.structure(), files.curves(), files.boundaries()
    found = [part for part in (boundaries, curves) if part is not None and len(part)]
    if structure is None or not found:
        return None
    every = np.unique(np.concatenate([part.slice for part in found]))
    chosen = every[np.linspace(0, len(every) - 1, min(_MOST, len(every))).round().astype(int)]
    picture = _Picture.of(structure, np.concatenate([part.points for part in found]).astype(float))
    layers = _layers(files, structure, boundaries, curves, picture)
    greys, first = _greys(structure), int(structure.stack_origin[0])
    pictures = []
    for k in chosen.tolist():
        shown = greys[k - first : k - first + 1] if greys is not None and k >= first else []
        image = _webp(shown[0], picture.matrix, _PIXELS / len(chosen)) if len(shown) else None
        pictures.append((k, picture.svg(k, image, layers)))
    there = {name: words for name, words in LAYERS.items() if name in layers}
    return SliceSheet(pictures, there, picture.sides, len(every))


def _layers(
    files: StructureFiles,
    structure: Structure,
    boundaries: Boundaries | None,
    curves: Curves | None,
    picture: _Picture,
) -> dict[str, dict[int, str]]:
    """Draw every layer: by its class and by slice the ``d`` of a path."""
    found: dict[str, dict[int, str]] = {}
    view, splines, corners = files.view(), files.splines(), files.corners()
    flags, band = (view.flags, view.band) if view is not None else ({}, {})
    traced = structure.mask is not None and not any(flag.any() for flag in flags.values())
    if boundaries is not None and not traced:  # pixels of a mask's border are where its curve is
        owner = np.repeat(boundaries.slice, np.diff(boundaries.offsets))
        found["boundary"] = picture.pixels(boundaries.points, owner)
        if "dropped" in flags:
            found["dropped"] = picture.pixels(boundaries.points[flags["dropped"]], owner[flags["dropped"]])
    if curves is not None and "bridged" in flags:
        owner = np.repeat(curves.slice, np.diff(curves.offsets))
        found["bridged"] = picture.pixels(curves.points[flags["bridged"]], owner[flags["bridged"]])
    if splines is not None:
        found["curve"] = picture.lines([splines.sample(per_pixel=1.0)])
    if band:
        found["band"] = picture.lines(band.values())
    if curves is not None and corners is not None:
        points, offsets = corners
        found["corners"] = picture.dots(points, np.repeat(curves.slice, np.diff(offsets)))
    return {name: paths for name, paths in found.items() if paths}


@dataclass(frozen=True)
class _Picture:
    """How a slice lies on the screen: as a radiologist reads it.

    Axial and coronal slices have the patient's left on the right; axial slices have the front on top, the
    others the head; sagittal slices have the front on the left. ``matrix`` (2, 3) leads from (i, j, 1) to the
    picture's pixels, y down; ``aspect`` is a pixel's height over its width.
    """

    matrix: np.ndarray
    width: int
    height: int
    aspect: float
    sides: dict[str, str]

    @classmethod
    def of(cls, structure: Structure, points: np.ndarray) -> _Picture:
        """Show the structure's crop, or what points (P, 2) cover."""
        low, high = _extent(structure, points)
        matrix, right, down = _display(structure.frame, low, high)
        columns = np.abs(matrix[:, :2]).argmax(axis=1)
        (width, height), spacing = (high - low + 1)[columns], structure.frame.pixel_spacing[columns]
        return cls(matrix, int(width), int(height), float(spacing[1] / spacing[0]), _letters(right, down))

    def place(self, points: np.ndarray) -> np.ndarray:
        """Points (P, 2) of the source as the picture's (x, y); a pixel's centre is at one half."""
        return points @ self.matrix[:, :2].T + self.matrix[:, 2] + 0.5

    def pixels(self, points: np.ndarray, owner: np.ndarray) -> dict[int, str]:
        """Fill the pixels (P, 2) of the slices ``owner`` (P,)."""
        corners = np.floor(self.place(points.reshape(-1, 2))).astype(int)
        return _grouped([f"M{x} {y}h1v1h-1z" for x, y in corners.tolist()], owner)

    def dots(self, points: np.ndarray, owner: np.ndarray) -> dict[int, str]:
        """Lines of no length at points (P, 2), which round ends make dots."""
        places = self.place(points.reshape(-1, 2)).round(_DECIMALS)
        return _grouped([f"M{x} {y}h0" for x, y in places.tolist()], owner)

    def lines(self, parts: Iterable[Curves]) -> dict[int, str]:
        """Draw closed lines."""
        texts, owner = [], []
        for curves in parts:
            for one, k in zip(curves, curves.slice, strict=True):
                ring = shapely.simplify(shapely.linearrings(self.place(one)), _LINE_PX)
                points = shapely.get_coordinates(ring)[:-1].round(_DECIMALS)
                texts.append("M" + " ".join(map(str, points.ravel().tolist())) + "z")
                owner.append(k)
        return _grouped(texts, np.array(owner, int))

    def svg(self, k: int, image: str | None, layers: dict[str, dict[int, str]]) -> str:
        """Draw a slice: its picture (base64 WebP), if there is any, and its layers."""
        size = f'width="{self.width}" height="{self.height}" preserveAspectRatio="none"'
        drawn = f'<image href="data:image/webp;base64,{image}" {size}/>' if image else ""
        paths = "".join(f'<path class="{name}" d="{on[k]}"/>' for name, on in layers.items() if k in on)
        shape = f"aspect-ratio: {self.width} / {self.height * self.aspect:.6g}"
        box = f'viewBox="0 0 {self.width} {self.height}" preserveAspectRatio="none" style="{shape}"'
        return f'<svg {box} role="img" aria-label="Slice {k}">{drawn}{paths}</svg>'


def _grouped(texts: list[str], owner: np.ndarray) -> dict[int, str]:
    """Join texts by the slice that owns each."""
    found: dict[int, list[str]] = {}
    for k, text in zip(owner.tolist(), texts, strict=True):
        found.setdefault(k, []).append(text)
    return {k: "".join(parts) for k, parts in found.items()}


def _extent(structure: Structure, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """First and last pixel (i, j) shown: the structure's crop, or what the points cover."""
    for name in ("image", "mask", "boundary"):
        stack = structure.stack(name)
        if stack is not None:
            low = structure.stack_origin[1:]
            return low.astype(int), low + np.array(stack.shape[1:]) - 1
    return np.floor(points.min(axis=0)).astype(int) - 3, np.ceil(points.max(axis=0)).astype(int) + 3


def _display(frame: Frame, low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matrix (2, 3) from (i, j, 1) to (x, y), and the world's directions (3,) to the right and down."""
    along = frame.stack_affine[:3, :3] / np.linalg.norm(frame.stack_affine[:3, :3], axis=0)
    through = int(np.argmax(np.abs(along[:, 2])))
    right = np.array([0.0, -1.0, 0.0]) if through == 0 else np.array([-1.0, 0.0, 0.0])
    down = np.array([0.0, -1.0, 0.0]) if through == 2 else np.array([0.0, 0.0, -1.0])
    straight = abs(along[:, 0] @ right) + abs(along[:, 1] @ down)
    crossed = abs(along[:, 1] @ right) + abs(along[:, 0] @ down)
    axes = (1, 0) if straight < crossed else (0, 1)
    matrix, directions = np.zeros((2, 3)), []
    for row, (axis, wanted) in enumerate(zip(axes, (right, down), strict=True)):
        flip = along[:, axis] @ wanted < 0
        matrix[row, axis] = -1 if flip else 1
        matrix[row, 2] = high[axis] if flip else -low[axis]
        directions.append(-along[:, axis] if flip else along[:, axis])
    return matrix, directions[0], directions[1]


def _letters(right: np.ndarray, down: np.ndarray) -> dict[str, str]:
    """Letters of the patient's sides at the picture's edges; two for an oblique slice."""

    def letter(direction: np.ndarray) -> str:
        order = np.argsort(-np.abs(direction))
        return "".join("RAS"[a] if direction[a] > 0 else "LPI"[a] for a in order if abs(direction[a]) > 0.38)

    return {"right": letter(right), "left": letter(-right), "bottom": letter(down), "top": letter(-down)}


def _greys(structure: Structure) -> np.ndarray | None:
    """Scale the image (the mask, without one) to 0..255, as bright as its organs need; None without both."""
    image, mask = structure.stack("image"), structure.stack("mask")
    if image is None:
        return None if mask is None else mask.astype(np.uint8) * 160
    dark, bright = np.nanpercentile(image, [1, 99.5])
    scaled = np.nan_to_num((image - dark) / max(bright - dark, np.finfo(np.float32).tiny))
    return np.rint(255 * np.clip(scaled, 0, 1)).astype(np.uint8)


def _webp(grey: np.ndarray, matrix: np.ndarray, most: float) -> str:
    """One slice (I, J) as it lies on the screen, of ``most`` pixels at most: base64 WebP."""
    from PIL import Image

    grey = grey.T if matrix[0, 0] != 0 else grey  # x runs along i: rows of the picture are j
    grey = grey[:: -1 if matrix[1, :2].sum() < 0 else 1, :: -1 if matrix[0, :2].sum() < 0 else 1]
    picture = Image.fromarray(np.ascontiguousarray(grey))
    shrink = max(1.0, np.sqrt(grey.size / most))
    picture.thumbnail((max(1, round(picture.width / shrink)), max(1, round(picture.height / shrink))))
    return webp(picture, 70)
