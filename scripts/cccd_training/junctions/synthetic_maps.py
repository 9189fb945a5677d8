"""Synthetic boundary maps with known truth, drawn afresh from a seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from cccd.geometry.arrays import AnyArray, BoolArray, ByteArray, SingleArray
from cccd.geometry.opencv import border_pixels, distance_to_zero
from cccd_datasets.corruptions import KINDS, corrupt
from cccd_training.junctions.families import FAMILIES
from cccd_training.junctions.labels import fill_contours
from cccd_training.junctions.random_masks import draw_mask
from cccd_training.junctions.synthetic_images import canny_map, draw_image

#: Corruptions of true contours, and edge maps of grey images inside a band and without one.
ALL_KINDS: tuple[str, ...] = (*KINDS, "canny", "canny_whole")

#: How often each kind is drawn for training: those that are hard count more.
KIND_WEIGHTS: dict[str, float] = {
    "clean": 1.0,
    "spurs": 1.0,
    "bridges": 2.0,
    "pinch": 1.0,
    "blocks": 1.0,
    "gaps": 3.0,
    "noise": 2.0,
    "double": 3.0,
    "thick": 4.0,
    "mixed": 8.0,
    "everything": 2.0,
    "canny": 9.0,
    "canny_whole": 0.5,
}

# Larger maps (edge maps of noise, mostly) teach nothing and cost much.
_MOST_PIXELS = 2500

# Edge detectors blur away organs whose border is shorter; kinds that are found by one.
_SHORTEST_SEEN = 60
_SEEN = {"canny", "canny_whole", "label_maps", "detectors"}

# Share of the true border that has pixels so near by, at least, in maps of a family.
_LEAST_SHOWN, _BESIDE_PX = 0.75, 2.0


class RandomStream(IntEnum):
    """Streams of random numbers that must not overlap: the second number of every seed."""

    FROZEN_MAPS = 1
    FRESH_MAPS = 2
    MAP_ORDER = 3
    HIDDEN_IMAGES = 4
    LARGE_MAPS = 5
    EVALUATION = 9


@dataclass
class SyntheticMap:
    """One boundary map and the truth behind it.

    Attributes
    ----------
    pixels : (N, 2) int32
        The map's pixels (i, j) in raster order.
    contours : sequence of (n, 2) int32
        True borders, outer ones and holes.
    kind : str
        One of `ALL_KINDS`, or of `cccd_training.junctions.families.FAMILIES`.
    shape : (2,) tuple of int
        Of the slice.
    image : (I, J) float32 or None
        Grey slice.
    """

    pixels: AnyArray
    contours: Sequence[AnyArray]
    kind: str
    shape: tuple[int, int]
    image: SingleArray | None = None


def draw_map(rng: np.random.Generator, kind: str, severity: float | None = None) -> SyntheticMap:
    """Draw a mask and a boundary map of one kind; ``severity`` is drawn too when it is ``None``.

    A kind is one of `ALL_KINDS` or a family, which has no severity. Edge maps come with their grey slice;
    three in ten of the other kinds do as well.
    """
    while True:
        mask = draw_mask(rng)
        drawn = severity if severity is not None else float(rng.uniform(0.3, 1.5))
        image = None
        contours = [contour.astype(np.int32) for contour in border_pixels(mask)]
        length = sum(len(contour) for contour in contours)
        if kind in _SEEN and length < _SHORTEST_SEEN:
            continue
        if kind in FAMILIES:
            observed, image = FAMILIES[kind](rng, mask)
            if not _shows(observed, contours):
                continue
        elif kind.startswith("canny"):
            image = draw_image(rng, mask)
            band = None if kind == "canny_whole" else 6.0 if severity is not None else rng.uniform(4, 9)
            observed = canny_map(rng, image, mask, band)
        else:
            observed = corrupt(rng, mask, kind, drawn)
            if rng.random() < 0.3:
                image = draw_image(rng, mask)
        pixels = np.argwhere(observed).astype(np.int32)
        if 0.45 * length <= len(pixels) <= _MOST_PIXELS:
            return SyntheticMap(pixels, contours, kind, (mask.shape[0], mask.shape[1]), image)


def _shows(observed: BoolArray, contours: Sequence[AnyArray]) -> bool:
    """Whether a map has pixels beside most of the true border: nobody could tell where another one is."""
    away = distance_to_zero((~observed).astype(np.uint8))
    near = np.concatenate([away[tuple(contour.T)] for contour in contours]) <= _BESIDE_PX
    return bool(observed.any() and near.mean() >= _LEAST_SHOWN)


def draw_large_map(rng: np.random.Generator, nodes: int) -> SyntheticMap:
    """Draw a map of exactly ``nodes`` pixels: some organs side by side, the last pixels left out."""
    parts: list[SyntheticMap] = []
    while sum(len(part.pixels) for part in parts) < nodes:
        parts.append(draw_map(rng, "mixed"))
    height = max(part.shape[0] for part in parts)
    aside = [np.array([0, at], np.int32) for at in np.cumsum([0, *(part.shape[1] for part in parts)])]
    pixels = np.concatenate([part.pixels + shift for part, shift in zip(parts, aside, strict=False)])
    contours = [c + shift for part, shift in zip(parts, aside, strict=False) for c in part.contours]
    return SyntheticMap(pixels[:nodes], contours, "mixed", (height, int(aside[-1][1])))


def truth_mask(drawn: SyntheticMap) -> ByteArray:
    """Fill the true contours to a mask (I, J) uint8, their own pixels included."""
    return fill_contours(drawn.contours, drawn.shape)
