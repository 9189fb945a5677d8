"""What curve reconstruction returns, links between points: counted, ordered, filled.

Points are (N, 2) in (i, j); links are (M, 2) pairs of point numbers, each pair ascending, rows unique.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from cccd.geometry.arrays import connected_parts
from cccd_paper.junctions.grid import follow_chains


@dataclass(frozen=True)
class LinkCounts:
    """How far links are from one closed curve through all points.

    Attributes
    ----------
    connected : int
        Connected segments: connected pieces that have at least one link.
    disconnected : int
        Disconnected segments, the paper's Table 4: the gaps that part the pieces. None for one piece
        without an open end, one for an open piece, otherwise as many as there are pieces.
    open_ends, junctions, left_out : int
        Points with one link, with more than two, with none.
    closed : bool
        A single closed curve: every point that is used has two links, in one piece.
    """

    connected: int
    disconnected: int
    open_ends: int
    junctions: int
    left_out: int
    closed: bool


def unique_links(links: np.ndarray) -> np.ndarray:
    """Links with each pair ascending, sorted, without repeats and without loops at a point."""
    links = np.sort(np.asarray(links, np.int64).reshape(-1, 2), axis=1)
    return np.unique(links[links[:, 0] < links[:, 1]], axis=0)


def count_links(links: np.ndarray, n_points: int) -> LinkCounts:
    """Count pieces, gaps, open ends and junctions of links between ``n_points`` points.

    Examples
    --------
    >>> count_links(np.array([[0, 1], [1, 2], [0, 2]]), 3).closed
    True
    >>> count_links(np.array([[0, 1], [2, 3]]), 4).disconnected
    2
    """
    degree = np.bincount(links.ravel(), minlength=n_points)
    one, other = links.reshape(-1, 2).T
    connected = len(np.unique(connected_parts(one, other, n_points)[degree > 0]))
    open_ends = int(np.count_nonzero(degree == 1))
    junctions = int(np.count_nonzero(degree > 2))
    whole = connected == 1 and open_ends == 0
    return LinkCounts(
        connected=connected,
        disconnected=0 if whole else connected,
        open_ends=open_ends,
        junctions=junctions,
        left_out=int(np.count_nonzero(degree == 0)),
        closed=whole and junctions == 0,
    )


def closed_order(links: np.ndarray, n_points: int) -> np.ndarray:
    """Point numbers in the order of a single closed curve, starting at its lowest number.

    Raises
    ------
    ValueError
        When the links are not a single closed curve.
    """
    if not count_links(links, n_points).closed:
        raise ValueError("the links are not one closed curve")
    (order,), _ = follow_chains(links, n_points)
    return order


def enclosed_region(
    points: np.ndarray, links: np.ndarray, origin: Sequence[float] | np.ndarray, shape: tuple[int, int]
) -> np.ndarray:
    """Pixels (I, J) that the drawn links enclose, the links' own pixels included.

    What cannot be reached from outside without stepping over a link (in 4-connected steps; links are
    8-connected lines) is inside. A single gap lets the outside in, so that only the line itself is left.

    Parameters
    ----------
    points, links : (N, 2) float, (M, 2) int
        Points (i, j) and links.
    origin : (2,)
        Index (i, j) of the region's first pixel.
    shape : (I, J)
        Size of the region.
    """
    canvas = np.zeros((shape[0] + 2, shape[1] + 2), np.uint8)
    pixels = np.rint(np.asarray(points, float) - np.asarray(origin, float)).astype(np.int32) + 1
    segments = np.ascontiguousarray(pixels[links][:, :, ::-1])  # OpenCV's points are (column, row)
    cv2.polylines(canvas, list(segments), isClosed=False, color=1)
    cv2.floodFill(canvas, None, (0, 0), 2, flags=4)
    return canvas[1:-1, 1:-1] != 2
