"""The surface of one structure, as the later stages know it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cccd.containers import Frame
from cccd.geometry.bsplines import Patch
from cccd.geometry.mesh import Mesh

__all__ = ["Surface"]


@dataclass
class Surface:
    """The surface of one structure.

    Attributes
    ----------
    patches : list of Patch
        Control nets in mm RAS.
    vertices : (V, 3) float64
        mm RAS.
    faces : (F, 3) int64
        Counter-clockwise from outside.
    frame : Frame
        The grid of the source volume.
    report : dict
        Plain JSON: tubes, branches, caps, cut ends, control points, bytes, warnings.
    """

    patches: list[Patch]
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    frame: Frame
    report: dict[str, Any] = field(default_factory=dict)

    @property
    def mesh(self) -> Mesh:
        """Vertices and faces together."""
        return Mesh(self.vertices, self.faces)
