"""Masks of shapes whose surfaces are known."""

from __future__ import annotations

import numpy as np
import pytest

from cccd.containers import Curves, Frame, Structure
from cccd.geometry.polygons import RaggedPolygons
from cccd.settings.surface import LoftSettings
from cccd.tracing import trace_mask

SETTINGS = LoftSettings()


def structure_of(mask: np.ndarray, spacing=(1.0, 1.0, 1.0), affine: np.ndarray | None = None) -> Structure:
    if affine is None:
        affine = np.diag([*spacing, 1.0])
    return Structure("case", "organ", Frame(affine, 2, mask.shape), np.zeros(3, int), mask=mask)


def curves_of(mask: np.ndarray, spacing=(1.0, 1.0, 1.0)) -> Curves:
    return trace_mask(structure_of(mask, spacing))


def grid(*shape: int) -> np.ndarray:
    return np.stack(np.meshgrid(*(np.arange(n, dtype=float) for n in shape), indexing="ij"))


def ball(shape=(60, 60, 60), centre=(30, 30, 30), radius=20.0, spacing=(1.0, 1.0, 1.0)) -> np.ndarray:
    offset = (grid(*shape) - np.reshape(centre, (3, 1, 1, 1))) * np.reshape(spacing, (3, 1, 1, 1))
    return np.sum(offset**2, axis=0) <= radius**2


def fork() -> np.ndarray:
    """A trunk that splits into two legs, as bronchi do."""
    x, y, z = grid(70, 40, 60)
    spread = np.clip(30 - z, 0, None) * 0.6
    left = np.hypot(x - 35 + spread, y - 20) <= 8
    right = np.hypot(x - 35 - spread, y - 20) <= 8
    return (left | right) & (z >= 4) & (z < 55)


def ellipse(a=10.0, b=10.0, centre=(30.0, 30.0), turn=0.0, first=0.0, count=240) -> np.ndarray:
    """Points (count, 2) counter-clockwise on a turned ellipse, from a fraction of the way around."""
    angle = 2 * np.pi * (np.arange(count) / count + first)
    x, y = a * np.cos(angle), b * np.sin(angle)
    cosine, sine = np.cos(turn), np.sin(turn)
    return np.column_stack([cosine * x - sine * y, sine * x + cosine * y]) + centre


def drawn(slices: dict[int, list[np.ndarray]], depth: int, spacing=(1.0, 1.0, 1.0), size=64) -> Curves:
    """Outlines drawn on some of ``depth`` slices; those that run clockwise are holes."""
    outlines = [(k, points) for k in sorted(slices) for points in slices[k]]
    offsets = np.concatenate([[0], np.cumsum([len(points) for _, points in outlines])])
    return Curves(
        np.concatenate([points for _, points in outlines]),
        offsets,
        np.array([k for k, _ in outlines], np.int32),
        RaggedPolygons(np.concatenate([points for _, points in outlines]), offsets).signed_areas < 0,
        Frame(np.diag([*spacing, 1.0]), 2, (size, size, depth)),
    )


def assert_sound(surface):
    """Closed, nowhere through itself, and with the volume of its splines."""
    assert surface.mesh.is_closed_manifold
    assert len(surface.mesh.self_intersections()) == 0
    assert surface.mesh.volume > 0
    tessellated = [body.tessellate(2).volume for body in surface.bodies]
    assert sum(tessellated) == pytest.approx(surface.mesh.volume, rel=1e-9)
