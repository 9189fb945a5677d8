"""Control nets follow the organ and leave the pixels' noise."""

import numpy as np
import pytest

from cccd.surface.fitting import fit_samples
from cccd.surface.samples import Samples

AROUND, LEVELS = 128, 12


def corrugated(waves: int, depth: float = 0.3) -> Samples:
    """A tube of 128 px around whose radius waves so many times on the way around."""
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    radius = AROUND / (2 * np.pi) + depth * np.cos(waves * angle)
    outline = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    z = np.arange(LEVELS, dtype=float)
    vertical = np.broadcast_to([1.0, 0.0], (LEVELS, AROUND, 2))
    return Samples(
        np.tile(outline, (LEVELS, 1, 1)),
        np.tile(np.arange(AROUND) / AROUND, (LEVELS, 1)),
        z,
        z,
        np.full(LEVELS, np.pi * np.mean(radius**2)),
        vertical,
        (None, None),
        np.ones((LEVELS, AROUND)),
        np.zeros((0, 3)),
        1.0,
    )


@pytest.mark.parametrize(("waves", "passes"), [(4, 1.0), (8, 1.0), (32, 0.5)])
def test_long_waves_pass_and_those_of_four_pixels_are_halved(waves, passes):
    fit = fit_samples(corrugated(waves), (AROUND // 2, 8))
    # Control points of a fine net wave as the surface does, but for the B-spline's own damping.
    knot = 2 * np.pi * waves / (AROUND // 2)
    damping = (2 + np.cos(knot)) / 3
    radius = np.linalg.norm(fit.net[:, 4], axis=1)
    depth = damping * np.abs(np.fft.rfft(radius)[waves]) * 2 / len(radius) / (2 if knot == np.pi else 1)
    assert depth / 0.3 == pytest.approx(passes, abs=0.15)
