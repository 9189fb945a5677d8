"""The least distance between two organs, with its interval."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from cccd.surface.surface import LoftedSurface

if TYPE_CHECKING:
    import pandas as pd

#: Organs whose boxes lie further apart than this in mm are not compared.
NEAR_MM = 30.0
#: Columns of `distance_table`.
DISTANCES = ("case", "organ", "other_organ", "distance_mm", "low_mm", "high_mm")


class Between(NamedTuple):
    """A least distance in mm, and its interval."""

    mm: float
    low_mm: float
    high_mm: float


def least_distance(first: LoftedSurface, second: LoftedSurface) -> Between:
    """Measure the least distance between the vertices of two surfaces.

    The interval is that of the bands: each organ may reach as far as its outer surface, and no less far than
    its inner one. It is the distance itself where a surface has no band.

    Examples
    --------
    >>> from cccd.containers import Frame
    >>> from cccd.geometry.mesh import Mesh
    >>> corner = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    >>> faces = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)])
    >>> frame = Frame(np.eye(4), 2, (9, 9, 9))
    >>> near, far = (LoftedSurface([], Mesh(corner + (x, 0, 0), faces), frame) for x in (0, 4))
    >>> least_distance(near, far)
    Between(mm=3.0, low_mm=3.0, high_mm=3.0)
    """
    found = cKDTree(second.vertices).query(first.vertices)
    away, nearest = np.asarray(found[0], float), np.asarray(found[1], np.int64)
    low, high = away, away
    if first.band is not None:
        low, high = low - first.band.outer, high + first.band.inner
    if second.band is not None:
        low, high = low - second.band.outer[nearest], high + second.band.inner[nearest]
    return Between(*(max(float(values.min()), 0.0) for values in (away, low, high)))


def near_pairs(surfaces: Mapping[str, LoftedSurface]) -> dict[tuple[str, str], Between]:
    """Measure all pairs of surfaces whose boxes lie within `NEAR_MM` of each other."""
    boxes = {
        name: (surface.vertices.min(axis=0), surface.vertices.max(axis=0))
        for name, surface in surfaces.items()
    }
    found: dict[tuple[str, str], Between] = {}
    for one, other in itertools.combinations(surfaces, 2):
        (low, high), (lower, higher) = boxes[one], boxes[other]
        if np.linalg.norm(np.maximum(np.maximum(lower - high, low - higher), 0)) <= NEAR_MM:
            found[one, other] = least_distance(surfaces[one], surfaces[other])
    return found


def distance_table(case: str, found: Mapping[tuple[str, str], Between]) -> pd.DataFrame:
    """List the distances of a case's pairs, the nearest first; columns are `DISTANCES`."""
    import pandas as pd  # slow to import, and only tables need it

    rows = [(case, *pair, *(round(mm, 4) for mm in between)) for pair, between in found.items()]
    return pd.DataFrame(sorted(rows, key=lambda row: row[3]), columns=list(DISTANCES))
