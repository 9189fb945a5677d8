"""The graphs on which junction networks are trained: ``graphs.h5``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cccd.errors import InputError
from cccd.store import new_file, open_file, read_fields, write_fields


@dataclass(frozen=True, eq=False)
class GraphSplit:
    """Graphs of one split of ``graphs.h5``, ragged.

    Attributes
    ----------
    pixels : (P, 2) int16
        Boundary pixels (i, j); ``pixel_offsets`` (G + 1,) say where each graph begins.
    links : (L, 2) int16
        The two nodes of each link, counted within its graph; ``link_offsets`` (G + 1,).
    link_labels : (L,) int8
        +1 for true links and -1 for others (section 4.2).
    inside_shares : (T,) uint8
        Share of each triangle inside, in steps of 1/255; ``triangle_offsets`` (G + 1,).
    contours : (Q, 2) int16
        Points of the true contours; ``contour_offsets`` (C + 1,), and ``contour_graph`` (C,), whose each is.
    image_values : (N,) uint8
        Grey slices, of the graphs that have one; ``image_offsets`` (G + 1,).
    shape : (G, 2) int32
        Of each slice.
    kind : (G,) uint8
        Number of its kind in the file's attribute ``kinds``.
    """

    pixels: np.ndarray
    pixel_offsets: np.ndarray
    links: np.ndarray
    link_labels: np.ndarray
    link_offsets: np.ndarray
    inside_shares: np.ndarray
    triangle_offsets: np.ndarray
    contours: np.ndarray
    contour_offsets: np.ndarray
    contour_graph: np.ndarray
    image_values: np.ndarray
    image_offsets: np.ndarray
    shape: np.ndarray
    kind: np.ndarray

    @property
    def graph_bytes(self) -> int:
        """Bytes of graphs and labels; grey slices are not part of a graph."""
        return sum(column.nbytes for name, column in vars(self).items() if not name.startswith("image"))


# Version of ``graphs.h5``: to be raised when its columns mean something else.
_GRAPHS_VERSION = 3


def write_graphs(
    path: str | Path, splits: Mapping[str, GraphSplit], attributes: Mapping[str, int | str]
) -> None:
    """Write ``graphs.h5``: one group per split (training, validation, test), and what is known of all."""
    with new_file(path) as file:
        file.attrs["version"] = _GRAPHS_VERSION
        for name, value in attributes.items():
            file.attrs[name] = value
        for split, columns in splits.items():
            write_fields(file.create_group(split), columns)


def read_graphs(path: str | Path, split: str) -> GraphSplit:
    """Read one split of ``graphs.h5``."""
    with open_file(path) as file:
        found = int(file.attrs["version"])
        if found != _GRAPHS_VERSION:
            problem = f"graphs of version {found}, and this program reads {_GRAPHS_VERSION}"
            raise InputError(str(path), problem, "delete it and run snakemake again")
        return read_fields(file[split], GraphSplit)


def read_graph_facts(path: str | Path) -> tuple[dict[str, int], dict[str, Any]]:
    """Read how many graphs each split of ``graphs.h5`` holds, and the file's attributes; no graph."""
    with open_file(path) as file:
        counts = {name: len(file[f"{name}/kind"]) for name in ("training", "validation", "test")}
        return counts, dict(file.attrs.items())
