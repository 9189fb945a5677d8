"""What is observed of a slice: its boundary map as a graph, and its grey values."""

from __future__ import annotations

from dataclasses import dataclass

from cccd.geometry.arrays import AnyArray, RealArray
from cccd_junctions.delaunay import DelaunayGraph, build_graph
from cccd_junctions.intensity import IntensitySlice, image_edges, normalised_intensity


@dataclass(frozen=True, eq=False)
class ObservedSlice:
    """The graph of a slice's boundary map and of further edges of its image; the image if there is one."""

    graph: DelaunayGraph
    intensity: IntensitySlice | None = None


def observe(pixels: AnyArray, image: RealArray | None) -> ObservedSlice:
    """Triangulate a boundary map's pixels (N, 2), and further edges of its grey slice (I, J) if it has one.

    The pixels index the image.
    """
    if image is None:
        return ObservedSlice(build_graph(pixels))
    intensity = normalised_intensity(image, pixels)
    return ObservedSlice(build_graph(pixels, image_edges(intensity, pixels)), intensity)
