"""Meshes written part by part, as they are made: files that are larger than memory."""

from __future__ import annotations

import shutil
import struct
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, cast

import numpy as np

from cccd.errors import InputError
from cccd.files.stl import binary_stl
from cccd.geometry.mesh import Mesh
from cccd.geometry.ply import TRIANGLE, ply_header
from cccd.settings.formats import NOTE
from cccd.store import atomic_path
from cccd.surface.slabs import Piece

__all__ = ["STREAMED", "Written", "write_pieces"]

#: Suffixes that can be written part by part.
STREAMED = (".ply", ".stl")

#: Bytes of a binary STL before its triangles: a note, and their number.
_STL_HEAD = 84


class Written(NamedTuple):
    """What was written: triangles, the volume within in mm^3, and the lengths of its box along x, y, z."""

    triangles: int
    volume: float
    size: tuple[float, float, float]


def write_pieces(paths: list[Path], pieces: Iterable[Piece]) -> Written:
    """Write a surface part by part.

    Parameters
    ----------
    paths : list of path
        ``.ply`` (float64) or ``.stl`` (binary, float32), in mm RAS.
    pieces : iterable of Piece

    Raises
    ------
    InputError
        There is no part.
    """
    vertices = triangles = 0
    volume, low, high = 0.0, np.full(3, np.inf), np.full(3, -np.inf)
    with (
        tempfile.TemporaryFile() as points,
        tempfile.TemporaryFile() as faces,
        tempfile.TemporaryFile() as stl,
    ):
        for piece in pieces:
            points.write(piece.mesh.vertices[piece.fresh].astype("<f8").tobytes())
            table = np.empty(len(piece.mesh.faces), TRIANGLE)
            table["count"], table["corners"] = 3, piece.numbers[piece.mesh.faces]
            faces.write(table.tobytes())
            stl.write(binary_stl(piece.mesh, NOTE)[_STL_HEAD:])
            vertices += int(np.count_nonzero(piece.fresh))
            triangles += len(piece.mesh.faces)
            volume += _volume_to_origin(piece.mesh)
            low = np.minimum(low, piece.mesh.vertices.min(axis=0))
            high = np.maximum(high, piece.mesh.vertices.max(axis=0))
        if not triangles:
            raise InputError(str(paths[0]), "there is no surface", "check the label")
        ply = ply_header(vertices, triangles, NOTE).encode()
        head = NOTE.encode("ascii", "replace")[:80].ljust(80) + struct.pack("<I", triangles)
        for path in paths:
            parts = [points, faces] if path.suffix.lower() == ".ply" else [stl]
            with atomic_path(path) as temporary, temporary.open("wb") as file:
                file.write(ply if path.suffix.lower() == ".ply" else head)
                for part in parts:
                    part.seek(0)
                    shutil.copyfileobj(cast(Any, part), cast(BinaryIO, file))
    x, y, z = (high - low).tolist()
    return Written(triangles, volume, (x, y, z))


def _volume_to_origin(mesh: Mesh) -> float:
    """Signed volume in mm^3 between the triangles of an open mesh and the origin; parts add up."""
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    return float(np.einsum("fc,fc->", a, np.cross(b, c))) / 6
