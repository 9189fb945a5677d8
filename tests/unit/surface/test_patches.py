"""Control nets follow the organ and leave the pixels' noise."""

import numpy as np
import pytest
from shapes import ellipse

from cccd.geometry.polygons import signed_area
from cccd.settings.surface import FittingSettings
from cccd.surface.fitting import fit_samples
from cccd.surface.patches import _patch
from cccd.surface.refinement import fit_within_budget
from cccd.surface.samples import Samples, sample_tube
from cccd.surface.tubes import Section, Tube

AROUND, LEVELS = 128, 12
FITTING = FittingSettings()


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
    fit = fit_samples(corrugated(waves), (AROUND // 2, 8), 0.6, 3)
    # Control points of a fine net wave as the surface does, but for the B-spline's own damping.
    knot = 2 * np.pi * waves / (AROUND // 2)
    damping = (2 + np.cos(knot)) / 3
    radius = np.linalg.norm(fit.net[:, 4], axis=1)
    depth = damping * np.abs(np.fft.rfft(radius)[waves]) * 2 / len(radius) / (2 if knot == np.pi else 1)
    assert depth / 0.3 == pytest.approx(passes, abs=0.15)


def nowhere(points, within):
    """A target field that knows nothing: no sample is hidden."""
    return np.zeros(len(points)), np.zeros(len(points))


def sections_of(radius_at, heights):
    return [Section.of_outline(z, ellipse(radius_at(z), radius_at(z))) for z in heights]


def fitted(tube, size=(16, 6), around=96):
    samples = sample_tube(tube, around, nowhere, 1.0, 4.0, FITTING)
    fit = fit_samples(samples, size, FITTING.smoothing_pixels, FITTING.corrections)
    return samples, fit, _patch(fit, tube.hole)


def on_patch(patch, count=400):
    rng = np.random.default_rng(0)
    return patch.evaluate(rng.random(count), rng.random(count) * patch.knots_v[-1])


@pytest.mark.parametrize("slope", [0.0, 0.3, -0.5])
def test_cylinders_and_cones_are_reproduced(slope):
    heights = np.arange(0.0, 21.0)
    tube = Tube(sections_of(lambda z: 14 + slope * z, heights), (None, None), False, 0, ("cut", "cut"))
    samples, fit, patch = fitted(tube)
    points = on_patch(patch)
    assert np.hypot(*(points[:, :2] - 30).T) == pytest.approx(14 + slope * points[:, 2], abs=0.05)
    assert (points[:, 2].min(), points[:, 2].max()) == pytest.approx((0, 20), abs=0.2)
    assert fit.error < 0.02
    assert samples.weights.min() == 1
    assert len(samples.jumps) == 0


def test_sections_keep_their_area():
    """An ellipse with few control points would shrink under least squares alone."""
    outline = ellipse(16, 6)
    sections = [Section.of_outline(float(z), outline) for z in range(20)]
    tube = Tube(sections, (None, None), False, 0, ("cut", "cut"))
    _, _, patch = fitted(tube, (8, 5))
    u = np.arange(500) / 500
    middle = patch.evaluate(u, np.full(500, patch.knots_v[-1] / 2))[:, :2]
    assert signed_area(middle) == pytest.approx(signed_area(outline), rel=2e-3)


def test_a_rounded_end_is_level_and_closes_on_its_pole():
    pole = np.array([30.0, 30.0, 24.0])
    heights = np.append(np.arange(0.0, 20.0, 2.0), 24 - 4 * np.array([0.96, 0.85, 0.65, 0.4, 0.15]) ** 2)
    radius = np.append(np.full(10, 10.0), 10 * np.array([0.96, 0.85, 0.65, 0.4, 0.15]))
    sections = [Section.of_outline(z, ellipse(r, r)) for z, r in zip(heights, radius, strict=True)]
    _, fit, patch = fitted(Tube(sections, (None, pole), False, 0, ("cut", "cap")), (16, 9))
    assert patch.control_points[:, -1] == pytest.approx(np.tile(pole, (16, 1)))
    assert patch.control_points[:, -2, 2] == pytest.approx(24)
    assert np.all(np.diff(fit.heights) >= 0)


def test_samples_off_the_target_and_beside_jumps_weigh_little():
    heights = np.arange(0.0, 21.0)
    tube = Tube(sections_of(lambda z: 14 if z < 10 else 24, heights), (None, None), False, 0, ("cut", "cut"))

    def lower_half_known(points, within):
        return np.where(points[:, 2] < 3, 5.0, 0.0), np.ones(len(points))

    samples = sample_tube(tube, 96, lower_half_known, 1.0, 0.5, FITTING)
    light = samples.weights[:, 0] < 1
    assert np.array_equal(np.flatnonzero(light), [0, 1, 2, 9, 10])
    radius = np.hypot(*(samples.jumps[:, :2] - 30).T)
    assert np.all((radius > 14) & (radius < 24))
    assert np.all((samples.jumps[:, 2] > 9) & (samples.jumps[:, 2] < 10))


def test_control_points_go_where_the_errors_are():
    heights = np.arange(0.0, 24.0)
    plain = Tube(sections_of(lambda z: 14, heights), (None, None), False, 0, ("cut", "cut"))
    angle = 2 * np.pi * np.arange(240) / 240
    star = 30 + (14 + 2 * np.cos(7 * angle))[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    lobed = Tube([Section.of_outline(z, star) for z in heights], (None, None), False, 0, ("cut", "cut"))
    samples = [sample_tube(tube, 96, nowhere, 1.0, 4.0, FITTING) for tube in (plain, lobed)]
    roomy = fit_within_budget(samples, 0.05, 800, FITTING)
    assert all(fit.error < 0.06 for fit in roomy)
    even = fit_within_budget(samples, 9.0, 800, FITTING)
    assert roomy[0].net.shape == even[0].net.shape  # good enough from the start
    around, along = (np.subtract(roomy[1].net.shape, even[1].net.shape) > 0)[:2]
    assert around  # where the lobes are ...
    assert not along  # ... and not where the tube is straight
    assert even[1].error > 0.05
    tight = fit_within_budget(samples, 0.001, 300, FITTING)
    assert 240 < sum(fit.count for fit in tight) <= 300
