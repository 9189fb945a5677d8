"""The closed surfaces that solids are made of, and how far each lies from the mesh that it follows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from cccd.geometry.decimation import collapse_apart
from cccd.geometry.distance import unsigned_to_mesh
from cccd.geometry.mesh import Mesh
from cccd.tolerances import SOLID_VOLUME
from cccd_solids.kernel import facet_shell

#: Facets are tried with this share of them, again and again.
FEWER = 0.7
#: Points on either surface from which distances are taken.
SAMPLES = 10_000


class Deviation(NamedTuple):
    """Distances in mm between two surfaces, both ways: mean, 99th percentile, largest met."""

    mean: float
    p99: float
    largest: float


class Shell(Protocol):
    """A closed surface in one piece, ready for CAD."""

    @property
    def mesh(self) -> Mesh:
        """Triangles of it: its own, or those that it is measured by."""
        ...

    @property
    def smooth(self) -> bool:
        """Whether its faces are splines."""
        ...

    @property
    def planar(self) -> int:
        """How many of its faces are planes."""
        ...

    def build(self) -> Any:
        """Make the ``TopoDS_Shell``."""
        ...


@dataclass(frozen=True)
class Facets:
    """A shell of planar triangles."""

    mesh: Mesh
    smooth: bool = False

    @property
    def planar(self) -> int:
        """How many of its faces are planes: all."""
        return len(self.mesh.faces)

    def build(self) -> Any:
        """Make the ``TopoDS_Shell``, a plane for each triangle."""
        return facet_shell(self.mesh)


def measure_deviation(first: Mesh, second: Mesh, samples: int = SAMPLES) -> Deviation:
    """Measure distances between two meshes from points that are uniform by area.

    The percentile is the larger one of both ways.
    """
    rng = np.random.default_rng(0)
    there = unsigned_to_mesh(first.sample(samples, rng), second)
    back = unsigned_to_mesh(second.sample(samples, rng), first)
    return Deviation(
        float(there.mean() + back.mean()) / 2,
        float(max(np.percentile(there, 99), np.percentile(back, 99))),
        float(max(there.max(), back.max())),
    )


def follows(shell: Mesh, mesh: Mesh, tolerance: float) -> bool:
    """Whether a shell is as near to its mesh as asked, and holds as much."""
    near = measure_deviation(shell, mesh).p99 <= tolerance
    return near and abs(shell.volume / mesh.volume - 1) <= SOLID_VOLUME


def facets_within(mesh: Mesh, tolerance: float, most: int) -> Facets:
    """Decimate a closed mesh in one piece as far as the tolerance allows.

    Parameters
    ----------
    mesh : Mesh
        A closed manifold.
    tolerance : float
        In mm, of 99 % of the surface.
    most : int
        Most triangles, even if the tolerance asks for more.
    """
    kept = collapse_apart(mesh, most)
    while len(kept.faces) > 16:
        fewer = collapse_apart(kept, round(FEWER * len(kept.faces)))
        if len(fewer.faces) == len(kept.faces) or not follows(fewer, mesh, tolerance):
            break
        if len(fewer.self_intersections()):
            break
        kept = fewer
    return Facets(kept)
