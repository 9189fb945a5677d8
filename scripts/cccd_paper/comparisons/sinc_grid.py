"""Windowed-sinc smoothing at many settings for little more than the price of one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from cccd.geometry.mesh import Mesh

__all__ = ["GRID", "Smoothing", "smoothed"]


class Smoothing(NamedTuple):
    """A setting of VTK's windowed-sinc filter."""

    pass_band: float
    rounds: int

    def __str__(self) -> str:
        """Write it as the tables do."""
        slicers = ", 3D Slicer's default" if self == _SLICER else ""
        return f"pass band {self.pass_band:g}, {self.rounds} rounds{slicers}"


#: 3D Slicer's smoothing factor of 0.5: its pass band is 10 to the power of -4 times the factor.
_SLICER = Smoothing(0.01, 20)
#: What is tried.
GRID = tuple(Smoothing(band, rounds) for band in (0.1, 0.05, 0.01) for rounds in (20, 60))

#: Of Nuttall's window, which VTK takes.
_NUTTALL = np.array([0.355768, 0.487396, 0.144232, 0.012604])
#: The filter is this near to 1 at the end of its pass band, as in VTK.
_AT_PASS_BAND = 1e-3


def smoothed(mesh: Mesh, settings: Sequence[Smoothing]) -> list[np.ndarray]:
    """Vertices (V, 3) of a closed mesh after smoothing by each setting, as VTK's filter moves them.

    The filter is a sum of Chebyshev polynomials of the mesh's Laplacian (Taubin et al. 1996). The
    polynomials are the same for every setting, so each round is gone once for all of them.
    """
    corners = mesh.faces
    links = (corners.ravel(), np.roll(corners, -1, axis=1).ravel())
    ones, size = np.ones(corners.size, np.float32), len(mesh.vertices)
    neighbours = csr_array((ones, links), shape=(size, size))
    count = np.maximum(np.diff(neighbours.indptr), 1)
    neighbours.data /= np.repeat(count, np.diff(neighbours.indptr)).astype(np.float32)
    middle = mesh.vertices.mean(axis=0)
    before = (mesh.vertices - middle).astype(np.float32)
    shares = [_coefficients(*setting).astype(np.float32) for setting in settings]
    now = 0.5 * (before + neighbours @ before)
    moved = [share[0] * before + share[1] * now for share in shares]
    for n in range(2, max(len(share) for share in shares)):
        before, now = now, now + neighbours @ now - before
        for share, out in zip(shares, moved, strict=True):
            if n < len(share):
                out += share[n] * now
    return [out + middle for out in moved]


def _coefficients(pass_band: float, rounds: int) -> np.ndarray:
    """Coefficients (rounds + 1,), the cut-off moved until the end of the pass band is let through."""
    n = np.arange(rounds + 1)
    edge = np.arccos(1 - 0.5 * pass_band)
    window = np.cos(np.outer(n * np.pi / (rounds + 1), np.arange(4))) @ _NUTTALL
    at_edge, shift = np.cos(n * edge), 0.0
    for _ in range(500):
        cut = edge + shift
        share = window * np.r_[cut / np.pi, 2 * np.sin(n[1:] * cut) / (n[1:] * np.pi)]
        missing = share @ at_edge - 1
        if abs(missing) < _AT_PASS_BAND:
            break
        slope = np.zeros(rounds + 3)
        for k in range(rounds - 2, -1, -1):
            slope[k] = slope[k + 2] + 2 * (k + 1) * share[k + 1]
        shift -= missing / (slope[: rounds + 1] @ at_edge)
    return share
