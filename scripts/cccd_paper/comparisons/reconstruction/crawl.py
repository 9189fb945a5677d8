"""Crawl: A. D. Parakkat, R. Muthuganapathy, Crawl through neighbors, CGF 35 (2016) 177-186."""

from __future__ import annotations

import numpy as np

from cccd.geometry._jit import jit
from cccd.tolerances import ROUNDING
from cccd_paper.comparisons.links import unique_links
from cccd_paper.comparisons.reconstruction.delaunay import triangulate


def crawl(points: np.ndarray) -> np.ndarray:
    """Crawl from the shortest Delaunay edges in both directions, always to the nearest point ahead.

    Every shortest edge between two points not yet reached is a seed. From an end, the next point is the
    nearest Delaunay neighbour at an angle of at least 90 degrees to the link behind; the crawl ends where
    there is none or where it has two links already, and closes when it meets an open end.
    """
    mesh = triangulate(points)
    start, end, _, _ = mesh.directed()
    first = np.searchsorted(start, np.arange(len(points) + 1))
    seeds = mesh.edges[np.argsort(mesh.length, kind="stable")]
    return unique_links(_crawl(np.ascontiguousarray(points, float), first, end, seeds))


@jit
def _crawl(points, first, neighbour, seeds):
    degree = np.zeros(len(points), np.int64)
    links = np.empty((len(points), 2), np.int64)
    count = 0
    for seed in range(len(seeds)):
        if degree[seeds[seed, 0]] > 0 or degree[seeds[seed, 1]] > 0:
            continue
        links[count] = seeds[seed]
        count += 1
        degree[seeds[seed, 0]] = degree[seeds[seed, 1]] = 1
        for direction in range(2):
            behind, here = seeds[seed, 1 - direction], seeds[seed, direction]
            while degree[here] == 1:
                back = points[behind] - points[here]
                ahead = -1
                for place in range(first[here], first[here + 1]):
                    towards = points[neighbour[place]] - points[here]
                    size = towards[0] ** 2 + towards[1] ** 2
                    if back[0] * towards[0] + back[1] * towards[1] <= ROUNDING * size:
                        ahead = neighbour[place]  # neighbours come nearest first
                        break
                if ahead < 0 or degree[ahead] == 2:
                    break
                links[count, 0], links[count, 1] = here, ahead
                count += 1
                degree[here] += 1
                degree[ahead] += 1
                behind, here = here, ahead
    return links[:count]
