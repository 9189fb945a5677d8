"""Masks of shapes whose surfaces are known."""

from __future__ import annotations

import numpy as np
import pytest

from cccd.containers import Curves, Frame, Sections, Structure
from cccd.contours import trace_contours
from cccd.geometry.polygons import RaggedPolygons
from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_surface
from cccd.surface.surface import LoftedSurface

SETTINGS = LoftSettings()


def structure_of(mask: np.ndarray, spacing=(1.0, 1.0, 1.0), affine: np.ndarray | None = None) -> Structure:
    if affine is None:
        affine = np.diag([*spacing, 1.0])
    return Structure("case", "organ", Frame(affine, 2, mask.shape), np.zeros(3, int), mask=mask)


def curves_of(mask: np.ndarray, spacing=(1.0, 1.0, 1.0)) -> Curves:
    return trace_contours(structure_of(mask, spacing))


def lofted(mask: np.ndarray, spacing=(1.0, 1.0, 1.0)) -> LoftedSurface:
    return loft_surface(Sections(curves_of(mask, spacing)), SETTINGS)


def drawn(polygons, slices=None, shape=(60, 60, 60), affine=None) -> Curves:
    """Polygons (n, 2) as curves, one slice each unless slices are given, that run along the last axis."""
    ragged = RaggedPolygons.of([np.asarray(polygon, float) for polygon in polygons])
    slices = np.arange(len(polygons)) if slices is None else np.asarray(slices)
    frame = Frame(np.eye(4) if affine is None else affine, 2, shape)
    return Curves(
        ragged.points, ragged.offsets, slices.astype(np.int32), np.zeros(len(polygons), bool), frame
    )


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


def assert_sound(surface):
    """Closed, nowhere through itself, and with the volume of its splines."""
    assert surface.mesh.is_closed_manifold
    assert len(surface.mesh.self_intersections()) == 0
    assert surface.mesh.volume > 0
    tessellated = [body.tessellate(2).volume for body in surface.bodies]
    assert sum(tessellated) == pytest.approx(surface.mesh.volume, rel=1e-9)
