"""Read contours on planes of any direction: CSL, a text format of research on surfaces from sections."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray
from cccd.inputs.readers import guarded


def read_csl(path: Path) -> list[tuple[FloatArray, list[FloatArray]]]:
    """Read a CSL file: for each plane its unit normal (3,) and its contours (n, 3), in the file's unit.

    Its first line is ``CSLC``; then, plane after plane: number, vertices, contours and the plane's
    ``A B C D`` with Ax + By + Cz + D = 0; its vertices; its contours as numbers of vertices. Planes without
    contours are left out.

    Raises
    ------
    InputError
        No such file, or without contours.
    """
    planes: list[tuple[FloatArray, list[FloatArray]]] = []
    with guarded(path.name, "not a readable CSL file", "export it again"):
        lines = iter([line.split() for line in path.read_text().splitlines() if line.strip()])
        if next(lines) != ["CSLC"]:
            raise ValueError("its first line is not CSLC")
        for _ in range(int(next(lines)[0])):
            _, vertices, parts, *plane = next(lines)
            normal = np.array([float(part) for part in plane[:3]])
            rows = [[float(part) for part in next(lines)] for _ in range(int(vertices))]
            points = np.array(rows).reshape(-1, 3)
            rings: list[FloatArray] = []
            for _ in range(int(parts)):  # vertices, how many; an h there marks a hole; component; corners
                corners = [int(part) for part in next(lines)[2:]]
                rings.append(points[corners])
            if rings:
                planes.append((normal / np.linalg.norm(normal), rings))
    if not planes:
        raise InputError(path.name, "it contains no contours", "export it again")
    return planes
