"""Numbers packed into a page: integer arrays, as differences, byte-shuffled, deflated, base64.

Differences of neighbours are small and shuffling puts their high bytes, nearly all zero, side by side, so
that deflate takes a triangle of a spatially sorted mesh down to some five bytes. ``structure.js`` undoes it.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

__all__ = ["Grid", "pack", "quantise"]

_TYPES = {np.dtype("uint8"): "u1", np.dtype("uint16"): "u2", np.dtype("uint32"): "u4"}


class Grid(dict):
    """An even grid for coordinates: ``value = origin + step * integer``; JSON-ready."""

    def __init__(self, points: np.ndarray, finest: float = 0.0):
        """Cover ``points`` (P, d) with 16-bit integers, in steps no smaller than ``finest``."""
        low, high = points.min(axis=0), points.max(axis=0)
        step = max(float((high - low).max()) / 65535, finest, np.finfo(float).tiny)
        super().__init__(origin=[float(x) for x in low], step=step)


def quantise(points: np.ndarray, grid: Grid) -> np.ndarray:
    """Integers (P, d) uint16 nearest to ``points`` on ``grid``; at most half a step off within its range."""
    whole = np.rint((points - np.asarray(grid["origin"])) / grid["step"])
    return np.clip(whole, 0, 65535).astype(np.uint16)


def pack(meta: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> str:
    """Pack JSON values and unsigned integer arrays of one or two dimensions into base64 text.

    Parameters
    ----------
    meta : mapping
        Plain JSON.
    arrays : mapping of str to uint8, uint16 or uint32 arrays (n,) or (n, columns)
        Differences are taken down each column.

    Raises
    ------
    KeyError
        When an array has another type.
    """
    header, chunks, offset = {}, [], 0
    for name, array in arrays.items():
        columns = 1 if array.ndim == 1 else array.shape[1]
        table = array.reshape(-1, columns)
        delta = table.copy()
        delta[1:] -= table[:-1]  # unsigned: wraps, and so does the sum that undoes it
        raw = np.ascontiguousarray(delta).reshape(-1).view(np.uint8).reshape(-1, array.dtype.itemsize)
        header[name] = {
            "type": _TYPES[array.dtype],
            "count": int(array.size),
            "columns": columns,
            "offset": offset,
        }
        chunks.append(raw.T.tobytes())
        offset += raw.size
    text = json.dumps({"meta": meta, "arrays": header}, sort_keys=True, allow_nan=False).encode()
    packed = zlib.compress(b"".join([len(text).to_bytes(4, "little"), text, *chunks]), 6)
    return base64.b64encode(packed).decode("ascii")
