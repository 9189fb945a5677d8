"""Random bodies cut into slices: what the learned filling is trained on. No organ is among them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter

from cccd.containers import Frame, Sections, Structure
from cccd.curves import describe_curves
from cccd.errors import InputError
from cccd.filling.network import FARTHEST
from cccd.settings.curves import CurveSettings
from cccd.settings.surface import LoftSettings
from cccd.surface.fields import distance_fields
from cccd.surface.outlines import lofted_outlines
from cccd.tracing import trace_mask

__all__ = ["SlicedBody", "sliced_body"]

#: Voxels along each edge of a body, and fine voxels to a node of the network's grid.
SIZE, FINE = 64, 4
#: Slice distances in nodes, as often as they are drawn; share of bodies of which slices are kept as they are.
RATIOS, THICK_SHARE = (1, 2, 2, 2, 3), 0.45
#: Pixels around a body, and those beyond them that stay empty, when its slices are traced.
AROUND, EMPTY = 2, 6

Array = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True, eq=False)
class SlicedBody:
    """What the slices of a body say, and where its surface truly is; all in nodes.

    Attributes
    ----------
    distance : (A, B, S) float32
        In-plane signed distances at the nodes, from the closed splines of the slices.
    truth : (16, A, B, S) float32
        True signed distances at the parts of a node; NaN beyond the body.
    ratio, pixel : float
        Slice distance and pixel.
    """

    distance: Array
    truth: Array
    ratio: float
    pixel: float


def sliced_body(seed: int) -> SlicedBody | None:
    """Draw a body and cut it into slices; None where there is too little of it, or no curve.

    Either every slice is averaged over blocks and cut at one half, as coarse scans are, or single fine slices
    are kept with gaps between them, as thick ones are.
    """
    rng = np.random.default_rng(seed)
    ratio, thick = int(rng.choice(RATIOS)), bool(rng.random() < THICK_SHARE)
    body = _body(rng)
    if not 0.02 < body.mean() < 0.95:
        return None
    truth = (distance_transform_edt(~body) - distance_transform_edt(body)).astype(np.float32)
    truth -= np.sign(truth) / 2
    seen = body
    if rng.random() < 0.3:  # drawn by an unsteady hand
        noise = gaussian_filter(rng.standard_normal(body.shape).astype(np.float32), 1.2)
        seen = truth + noise * rng.uniform(1, 4) < 0
    step, nodes = FINE * ratio, SIZE // FINE
    count = SIZE // step
    if thick:
        every = FINE // int(rng.choice([2, 4, 4]))
        slices, pixel = seen[::every, ::every, step // 2 :: step][:, :, :count], every / FINE
    else:
        blocks = seen[:, :, : count * step].reshape(nodes, FINE, nodes, FINE, count, step)
        slices, pixel = blocks.mean((1, 3, 5)) >= 0.5, 1.0
    if slices.sum() < 30 or (found := _distances(slices, pixel, ratio)) is None:
        return None
    at_nodes = found[:, :: round(1 / pixel), :: round(1 / pixel)].transpose(1, 2, 0)
    at_nodes = np.clip(at_nodes, -FARTHEST, FARTHEST)
    return SlicedBody(at_nodes, _at_parts(truth, ratio, thick, at_nodes.shape), ratio, pixel)


def _distances(slices: Array, pixel: float, ratio: int) -> Array | None:
    """In-plane signed distances (S, I, J) in nodes, by the way that masks go: traced, splined, drawn."""
    edges = ((AROUND, AROUND), (AROUND, AROUND), (0, 0))
    mask = np.pad(np.pad(slices, edges, mode="edge"), ((EMPTY, EMPTY), (EMPTY, EMPTY), (0, 0)))
    frame = Frame(np.diag([pixel, pixel, ratio, 1.0]), 2, mask.shape)
    try:
        fitted = describe_curves(
            trace_mask(Structure("body", "body", frame, np.zeros(3, int), mask=mask)), CurveSettings()
        )
        numbers, distance, origin = distance_fields(
            lofted_outlines(Sections(fitted.curves, fitted.splines), LoftSettings())
        )
    except InputError:
        return None
    full = np.full((mask.shape[2], *mask.shape[:2]), 3 * FARTHEST, np.float32)
    low = np.maximum(origin, 0)
    high = np.minimum(origin + distance.shape[1:], mask.shape[:2])
    own = tuple(slice(*ends) for ends in zip(low - origin, high - origin, strict=True))
    full[np.ix_(numbers, np.arange(low[0], high[0]), np.arange(low[1], high[1]))] = distance[:, *own]
    inner = slice(AROUND + EMPTY, -AROUND - EMPTY)
    return full[:, inner, inner]


def _at_parts(truth: Array, ratio: int, thick: bool, shape: tuple[int, ...]) -> Array:
    """Take true distances (16, A, B, S) in nodes at the parts of a node; ``truth`` is in fine voxels."""
    step = FINE * ratio
    if thick:
        first, grid = (0, 0, step // 2), truth
    else:  # a node is the centre of its block, between voxels
        grid = truth
        for axis in range(3):
            grid = (np.delete(grid, 0, axis) + np.delete(grid, -1, axis)) / 2
        first = (FINE // 2 - 1, FINE // 2 - 1, step // 2 - 1)
    out = np.full((2, 2, 4, *shape), np.nan, np.float32)
    for a, b, c in np.ndindex(2, 2, 4):
        part = grid[
            first[0] + FINE // 2 * a :: FINE, first[1] + FINE // 2 * b :: FINE, first[2] + ratio * c :: step
        ][: shape[0], : shape[1], : shape[2]]
        out[a, b, c, : part.shape[0], : part.shape[1], : part.shape[2]] = part / FINE
    return out.reshape(16, *shape)


def _body(rng: np.random.Generator) -> Array:
    """Draw a smooth or rough body, tubes that branch, a body cut by a thin plate, or a body with tubes."""
    kind = rng.choice(["field", "field", "field", "tubes", "tubes", "plate", "both"])
    if kind == "tubes":
        return _tubes(rng)
    field = _random_field(rng)
    body = field > np.quantile(field, rng.uniform(0.35, 0.8))
    if kind == "plate":
        body &= np.abs(_random_field(rng)) >= rng.uniform(0.02, 0.12)
    return body | _tubes(rng) if kind == "both" else body


def _random_field(rng: np.random.Generator) -> Array:
    """Gaussian random field with a random correlation length, roughness and anisotropy."""
    roughness, length = rng.uniform(3.0, 5.5), np.exp(rng.uniform(np.log(10), np.log(50)))
    stretch = np.exp(rng.normal(0, 0.25, 3))
    full, half = np.fft.fftfreq(SIZE), np.fft.rfftfreq(SIZE)
    axes = np.meshgrid(full, full, half, indexing="ij")
    frequency = np.sqrt(sum((axis * by) ** 2 for axis, by in zip(axes, stretch, strict=True)))
    noise = np.fft.rfftn(rng.standard_normal((SIZE,) * 3).astype(np.float32))
    shaped = noise * (1 + (2 * frequency * length) ** 2) ** (-roughness / 2)
    field = np.fft.irfftn(shaped, s=(SIZE,) * 3, axes=(0, 1, 2)).astype(np.float32)
    return field / field.std()


def _tubes(rng: np.random.Generator) -> Array:
    """Draw a few tubes that wind, taper and branch."""
    points: list[Array] = []
    radii: list[float] = []

    def walk(at: Array, way: Array, radius: float, steps: int, generation: int) -> None:
        for _ in range(steps):
            points.append(at.copy())
            radii.append(radius)
            way = way + rng.normal(0, 0.12, 3)
            way = way / np.linalg.norm(way)
            at = at + way
            radius = max(1.2, radius * (1 + rng.normal(0, 0.01) - 0.004))
            if generation < 3 and rng.random() < 0.03:
                aside = way + rng.normal(0, 0.7, 3)
                aside /= np.linalg.norm(aside)
                walk(at.copy(), aside, radius * rng.uniform(0.6, 0.9), int(0.7 * steps), generation + 1)

    for _ in range(rng.integers(1, 5)):
        way = rng.normal(0, 1, 3)
        radius = float(np.exp(rng.uniform(np.log(1.8), np.log(8))))
        walk(rng.uniform(10, SIZE - 10, 3), way / np.linalg.norm(way), radius, int(rng.integers(40, 90)), 0)
    at, radius = np.array(points), np.array(radii)
    near = np.all((at > -5) & (at < SIZE + 5), axis=1)
    at, radius = np.clip(np.rint(at[near]), 0, SIZE - 1).astype(int), np.round(2 * radius[near]) / 2
    body = np.zeros((SIZE,) * 3, bool)
    for width in np.unique(radius):
        away = np.ones_like(body)
        away[tuple(at[radius == width].T)] = False
        body |= distance_transform_edt(away) < width
    return body
