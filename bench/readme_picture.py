"""Draw README's picture: a mask of thick slices as isosurface, as filtered isosurface and as spline surface.

    python bench/readme_picture.py

The kidney is the project's phantom, so its surface is known: the distances to it (ASSD) are printed. The
filter is VTK's windowed sinc at the best setting of the grid in `truth_rivals`.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np
import pyvista
from exact_truth import ours
from scipy.spatial.transform import Rotation
from truth_bodies import analytic_body, sample_stack
from truth_measures import Target, from_polydata, mean_distance, transformed
from truth_rivals import EDGES, by_windowed_sinc, isosurface, with_margin

from cccd.geometry.mesh import Mesh

PICTURE = Path(__file__).parents[1] / "docs" / "surface.png"
#: Slices lie so many pixels of 1 mm apart.
APART = 8.0
#: Directions from which each surface is seen, and pixels of a view.
VIEWS, SIZE = ((0.3, -1.0, 0.25), (-1.0, -0.5, 0.25)), (210, 330)


def drawn(mesh: Mesh, flat: bool) -> np.ndarray:
    """Draw a mesh from each side, beside each other: bytes (height, width, 3)."""
    views: list[np.ndarray] = []
    for direction in VIEWS:
        plotter = pyvista.Plotter(off_screen=True, window_size=SIZE)
        data = pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
        plotter.add_mesh(data, color="tan", smooth_shading=not flat, specular=0.2)
        plotter.view_vector(direction, (0, 0, 1))
        plotter.enable_parallel_projection()
        plotter.camera.zoom(1.25)
        plotter.set_background("white")
        plotter.enable_anti_aliasing("ssaa")
        views.append(np.asarray(plotter.screenshot(return_img=True)))
        plotter.close()
    return np.concatenate(views, axis=1)


def main() -> None:
    """Reconstruct, measure, draw."""
    body = analytic_body("kidney", Rotation.identity())
    mask, affine = sample_stack(body, APART)
    truth = Target(body.truth)
    wider, start = with_margin(mask, affine)
    filtered = min(
        (made for made in by_windowed_sinc(mask, affine) if made.method == EDGES),
        key=lambda made: mean_distance(made.mesh, truth),
    )
    surfaces = {
        "isosurface": transformed(from_polydata(isosurface(wider, 0.5)), start),
        f"isosurface, filtered ({filtered.setting})": filtered.mesh,
        "CCCD": ours(mask, affine)[0].mesh,
    }
    for name, mesh in surfaces.items():
        print(f"{name}: {mean_distance(mesh, truth):.2f} mm from the true surface")
    pictures = [drawn(mesh, name == "isosurface") for name, mesh in surfaces.items()]
    matplotlib.image.imsave(PICTURE, np.concatenate(pictures, axis=1))


if __name__ == "__main__":
    main()
