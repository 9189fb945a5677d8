"""The whole way of one mask to its surface, as the pipeline's jobs go it one by one."""

from __future__ import annotations

from cccd.containers import Structure
from cccd.curves import describe_curves
from cccd.settings.curves import CurveSettings
from cccd.settings.surface import LoftSettings
from cccd.surface import Surface, loft_surface
from cccd.tracing import trace_mask

__all__ = ["reconstruct_mask"]


def reconstruct_mask(structure: Structure, fitting: CurveSettings, lofting: LoftSettings) -> Surface:
    """Trace a structure's mask, fit closed splines to its curves, loft them.

    Parameters
    ----------
    structure : Structure
        With a mask.
    fitting : CurveSettings
        Section ``curves`` of the configuration.
    lofting : LoftSettings
        Section ``surface``.

    Raises
    ------
    InputError
        When the mask has no closed curve.

    Examples
    --------
    >>> import numpy as np
    >>> from cccd.containers import Frame
    >>> i, j, k = np.indices((24, 24, 24)) - 12
    >>> ball = np.hypot(np.hypot(i, j), k) <= 8
    >>> frame = Frame(np.eye(4), 2, ball.shape)
    >>> structure = Structure("case", "ball", frame, np.zeros(3, int), mask=ball)
    >>> surface = reconstruct_mask(structure, CurveSettings(), LoftSettings())
    >>> bool(abs(surface.mesh.volume / ball.sum() - 1) < 0.02)
    True
    """
    fitted = describe_curves(trace_mask(structure), fitting)
    return loft_surface(fitted.curves, lofting, fitted.splines)
