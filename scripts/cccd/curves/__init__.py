"""Ordered curves described by few points: chain codes, corners, closed B-splines, and what they are worth."""

from cccd.curves.describe import crossed_warnings, describe_curves, self_crossed_warnings
from cccd.curves.fitting import corner_splines, fit_splines
from cccd.curves.measures import measure_curves

__all__ = [
    "corner_splines",
    "crossed_warnings",
    "describe_curves",
    "fit_splines",
    "measure_curves",
    "self_crossed_warnings",
]
