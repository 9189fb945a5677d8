"""Triangle meshes to and from binary PLY.

Vertices are written as float64, so that nothing of a mesh's soundness is rounded away; trimesh's and VTK's
writers store float32.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cccd.errors import InputError
from cccd.geometry.mesh import Mesh

#: A triangle of the file.
_TRIANGLE = np.dtype([("count", "u1"), ("corners", "<i4", 3)])


def write_ply(path: str | Path, mesh: Mesh, comment: str) -> None:
    """Write a mesh; ``comment`` is one line of the header."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"comment {comment}\n"
        f"element vertex {len(mesh.vertices)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(mesh.faces)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    table = np.empty(len(mesh.faces), _TRIANGLE)
    table["count"], table["corners"] = 3, mesh.faces
    Path(path).write_bytes(header.encode() + mesh.vertices.astype("<f8").tobytes() + table.tobytes())


def read_ply(path: str | Path) -> Mesh:
    """Read back what `write_ply` wrote.

    Raises
    ------
    InputError
        When the file holds anything else, or less than its header says.
    """
    data = Path(path).read_bytes()
    head, mark, body = data.partition(b"end_header\n")
    counts = [
        int(line.split()[2]) for line in head.decode("ascii", "replace").splitlines() if "element" in line
    ]
    if not mark or len(counts) != 2 or len(body) != 24 * counts[0] + _TRIANGLE.itemsize * counts[1]:
        raise InputError(str(path), "not a mesh that the lofting wrote", "delete it and run snakemake again")
    vertices = np.frombuffer(body, "<f8", 3 * counts[0]).reshape(-1, 3)
    table = np.frombuffer(body, _TRIANGLE, counts[1], 24 * counts[0])
    return Mesh(vertices.copy(), table["corners"].astype(np.int64))
