"""Signed distances below the voxel and between slices, by a small network trained on random bodies.

The slices' borders are staircases of pixels, and nothing lies between them. A perceptron looks at the
distances within the slices around a place and estimates how far the true surface is from there; it has seen
many random smooth, sheet-like, branching and angular bodies cut into slices of any distance
(`cccd_training.distance` made the bodies and trained it). It runs in plain NumPy.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from cccd.geometry.arrays import FloatArray, IntArray, SingleArray

#: The trained weights.
WEIGHTS = Path(__file__).with_name("learned_distance.npz")
#: Their SHA-256: the workflow lofts again when this file changes, so with other weights it must change.
WEIGHTS_SHA256 = "898d28d49d1cf91fc9e309855a4af86f1f8b950eb0ea02c1761561a1edef8972"
#: Distances within slices say no more than their sign beyond this many pixels; and their unit, in pixels.
RANGE, UNIT = 8.0, 4.0
#: Slice distances in pixels that it has seen.
LEAST_RATIO, MOST_RATIO = 0.5, 7.0
#: Slices to either side, and pixels to each, that the network looks at.
SLICES, REACH = 4, 8
#: Squared radius in pixels of the disc that it sees on a slice, by slices away; and rings of eight beyond it.
_DISCS = {0: 13, 1: 13, 2: 10, 3: 5, 4: 5}
_RINGS = {0: (5, 8), 1: (5, 8), 2: (5,)}
#: Ratios of slice distance to pixel, and heights between slices, at which conditions are piecewise linear.
_RATIOS = np.log(np.array([0.5, 1.0, 1.6, 2.5, 4.0, 7.0]))
_HEIGHTS = np.array([-0.5, -0.25, 0.0, 0.25, 0.5])


def _offsets() -> IntArray:
    """Give the steps (F, 3) in slices and pixels to where the network looks, slice by slice."""
    steps: list[tuple[int, int, int]] = []
    for s in range(-SLICES, SLICES + 1):
        grid = np.arange(-3, 4)
        steps += [(s, int(i), int(j)) for i in grid for j in grid if i * i + j * j <= _DISCS[abs(s)]]
        for radius in _RINGS.get(abs(s), ()):
            aside = round(0.75 * radius)
            steps += [(s, i * radius, j * radius) for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1))]
            steps += [(s, i * aside, j * aside) for i in (1, -1) for j in (1, -1)]
    return np.array(steps, np.int64)


#: Where the network looks: (F, 3) slices and pixels from the place's nearest slice and its pixel.
OFFSETS = _offsets()


def condition_basis(ratio: float, height: FloatArray, exact: bool) -> FloatArray:
    """Hat functions (N, 36) of what the network knows about a stack.

    Parameters
    ----------
    ratio : float
        Slice distance in pixels.
    height : (N,) float64
        Of the places above the nearest slice, in slice distances, from -.5 to .5.
    exact : bool
        Whether distances are known below the pixel, not from a mask.
    """
    at_ratio = _hats(np.full(1, np.log(ratio)), _RATIOS)
    both = at_ratio[:, :, None] * _hats(height, _HEIGHTS)[:, None, :]
    known = np.broadcast_to(at_ratio * float(exact), (len(height), len(_RATIOS)))
    return np.concatenate([both.reshape(len(height), -1), known], axis=1)


def _hats(values: FloatArray, knots: FloatArray) -> FloatArray:
    """Piecewise linear functions (N, K), each one at its own knot and zero at the others."""
    return np.stack([np.interp(values, knots, row) for row in np.eye(len(knots))], axis=1)


def near_surface(ratio: float) -> float:
    """Distances in pixels up to which places are estimated: slices far apart tell less."""
    return min(1.6 + 0.3 * max(ratio - 1, 0), 3.0)


def in_space(
    below: SingleArray, own: SingleArray, above: SingleArray, ratio: float, height: float
) -> SingleArray:
    """Distances in space, to first order, from those within slices; linear between two of them.

    Parameters
    ----------
    below, own, above : (..., I, J) float32
        Distances within neighbouring slices, at most `RANGE`.
    ratio : float
        Slice distance, in the unit of the distances.
    height : float
        Of the places above their own slice, in slice distances; less than zero below it.

    Examples
    --------
    >>> inside, outside = np.full((1, 1), -4.0), np.full((1, 1), 4.0)
    >>> in_space(inside, inside, outside, 1.0, 0.0).round(2).item()  # the surface is half a pixel above
    -0.5
    """
    up, down = np.abs(above - own), np.abs(own - below)
    if height == 0:
        return np.asarray(own / np.sqrt(1 + (np.maximum(up, down) / ratio) ** 2), np.float32)
    beside, rise = (above, up) if height > 0 else (below, down)
    between = (1 - abs(height)) * own + abs(height) * beside
    return np.asarray(between / np.sqrt(1 + (rise / ratio) ** 2), np.float32)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What the network sees of some places, turned so that distances grow along the axes.

    Attributes
    ----------
    seen : (N, F) float32
        Distances within slices in `UNIT`, at `OFFSETS`, of the sign that makes the place outside.
    base : (N,) float32
        Distance of `in_space`, not less than zero.
    sign : (N,) float32
        By which both, and what comes out, are multiplied.
    flipped : (N,) bool
        Whether the slices were put upside down.
    """

    seen: SingleArray
    base: SingleArray
    sign: SingleArray
    flipped: np.ndarray[tuple[int], np.dtype[np.bool_]]

    @classmethod
    def of(cls, padded: SingleArray, nodes: IntArray, base: SingleArray) -> Surroundings:
        """Look around nodes.

        Parameters
        ----------
        padded : (S + 2 SLICES, I + 2 REACH, J + 2 REACH) float32
            Distances within slices, in pixels, negative inside, at most `RANGE`.
        nodes : (N, 3) int64
            Nearest slice and pixel, without the padding.
        base : (N,) float32
            Their distances in pixels by `in_space`.
        """
        flat = padded.ravel()
        strides = np.array([padded.shape[1] * padded.shape[2], padded.shape[2], 1])
        at = (nodes + np.array([SLICES, REACH, REACH])) @ strides
        sign = np.where(base < 0, np.float32(-1), np.float32(1))
        way = _growth(flat, at, strides) * sign[:, None]
        upside, swapped = way[:, 0] < 0, np.abs(way[:, 2]) > np.abs(way[:, 1])
        turn = upside + 2 * swapped + 4 * (way[:, 1] < 0) + 8 * (way[:, 2] < 0)
        seen = np.empty((len(at), len(OFFSETS)), np.float32)
        for number in np.unique(turn):
            here = np.flatnonzero(turn == number)
            seen[here] = flat[at[here, None] + _turned(int(number)) @ strides]
        seen *= sign[:, None] / np.float32(UNIT)
        return cls(seen, np.abs(base), sign, upside)


def _growth(flat: SingleArray, at: IntArray, strides: IntArray) -> FloatArray:
    """By how much (N, 3) distances grow around places, along each axis."""
    way = np.zeros((len(at), 3))
    for axis, step in enumerate((1, 2, 2)):
        others = [strides[other] for other in range(3) if other != axis]
        for a in (-1, 0, 1):
            for b in (-1, 0, 1):
                beside = at + a * others[0] + b * others[1]
                way[:, axis] += flat[beside + step * strides[axis]] - flat[beside - step * strides[axis]]
    return way


@cache
def _turned(turn: int) -> IntArray:
    """`OFFSETS` in one of sixteen turns and mirrorings of the stack."""
    s, i, j = OFFSETS.T
    if turn & 2:
        i, j = j, i
    return np.column_stack([-s if turn & 1 else s, -i if turn & 4 else i, -j if turn & 8 else j])


@dataclass(frozen=True, eq=False)
class DistanceNetwork:
    """A perceptron whose first layer depends on the ratio of slices to pixels and on the height between them.

    Attributes
    ----------
    weights : mapping of str to float32 array
        ``first`` (Q, F, H) and how much of each of the Q counts, by slice: ``gain`` (B, Q, 2 SLICES + 1, H);
        ``bias`` (B, H); then ``layer0`` (H, H'), ``bias0`` (B, H') ... to ``last`` (H'', 1) and
        ``last_bias`` (B, 1).
    """

    weights: Mapping[str, SingleArray]

    @classmethod
    def load(cls, path: Path) -> DistanceNetwork:
        """Read weights that `cccd_training.distance` wrote."""
        with np.load(path) as file:
            return cls({name: file[name].astype(np.float32) for name in file})

    @lru_cache(maxsize=256)  # noqa: B019 - one network lives as long as the program
    def layers(self, ratio: float, height: float, exact: bool) -> list[tuple[SingleArray, SingleArray]]:
        """Give the matrices and biases under a condition; see `condition_basis`."""
        w, basis = self.weights, condition_basis(ratio, np.full(1, height), exact)[0].astype(np.float32)
        gain = np.tensordot(basis, w["gain"], 1)[:, OFFSETS[:, 0] + SLICES]
        count = sum(name.startswith("layer") for name in w)
        return [
            ((w["first"] * gain).sum(axis=0), basis @ w["bias"]),
            *((w[f"layer{n}"], basis @ w[f"bias{n}"]) for n in range(count)),
            (w["last"], basis @ w["last_bias"]),
        ]

    def estimate(self, around: Surroundings, ratio: float, height: float, exact: bool) -> SingleArray:
        """Signed distances (N,) in pixels at places that have been looked around.

        Parameters
        ----------
        around : Surroundings
        ratio, height, exact
            As in `condition_basis` and `in_space`.
        """
        out = np.empty(len(around.base), np.float32)
        for upside in (False, True):
            here = np.flatnonzero(around.flipped == upside)
            *inner, (last, offset) = self.layers(ratio, -height if upside else height, exact)
            values = around.seen[here]
            for matrix, bias in inner:
                values = np.maximum(values @ matrix + bias, 0)
            out[here] = (values @ last + offset)[:, 0] + around.base[here]
        return out * around.sign


@cache
def shipped_network() -> DistanceNetwork:
    """Return the network that comes with the package."""
    return DistanceNetwork.load(WEIGHTS)
