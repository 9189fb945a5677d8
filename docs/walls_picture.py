"""Draw organs of a label map with shared walls (upper rows) and made alone (lower rows): docs/walls.jpg.

PYTHONPATH=scripts python docs/walls_picture.py MAP ORGAN [ORGAN ...]
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyvista

import cccd
from cccd.geometry.mesh import Mesh
from cccd_labels.whole_map import WholeMap

PICTURE = Path(__file__).with_name("walls.jpg")
#: Organs in a row, and pixels of each.
ACROSS, PIXELS = 5, 260


def made(path: Path, names: list[str]) -> dict[str, tuple[Mesh, Mesh]]:
    """Make the organs both ways, by name: with shared walls, and alone."""
    whole = WholeMap.read(path, None, None, "auto", cccd.Settings())
    found = {one.label.organ: one for one in whole.surfaces(1, str)}
    alone = {name: cccd.reconstruct(whole.structures[found[name].number]) for name in names}
    return {name: (found[name].surface.lofted.mesh, alone[name].lofted.mesh) for name in names}


def drawn(mesh: Mesh, name: str) -> np.ndarray:
    """Draw a mesh as it is, with flat triangles: bytes (height, width, 3)."""
    plotter = pyvista.Plotter(off_screen=True, window_size=(PIXELS, PIXELS))
    plotter.add_mesh(pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces), color="tan")
    plotter.add_text(name, font_size=7, color="black")
    plotter.view_vector((-0.4, 1.0, 0.3), (0, 0, 1))
    plotter.camera.zoom(1.2)
    plotter.set_background("white")
    picture = np.asarray(plotter.screenshot(return_img=True))
    plotter.close()
    return picture


def draw(organs: Mapping[str, tuple[Mesh, Mesh]]) -> None:
    """Write the picture."""
    from PIL import Image

    names, rows = list(organs), []
    for start in range(0, len(names), ACROSS):
        for way, said in enumerate(("", " alone")):
            row = [drawn(organs[name][way], name + said) for name in names[start : start + ACROSS]]
            rows.append(np.concatenate(row, axis=1))
    Image.fromarray(np.concatenate(rows)).save(PICTURE, quality=80)


if __name__ == "__main__":
    draw(made(Path(sys.argv[1]), sys.argv[2:]))
