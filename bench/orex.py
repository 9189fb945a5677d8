"""A blind set that others can rerun: the parallel-plane solids of OReX, every method against the true solid.

    python bench/orex.py [FOLDER]

OReX (Sawdayee, Vaxman and Bermano, CVPR 2023; github.com/haimsaw/OReX) publishes contours on a few planes
(``.csl``) and the solids that they were cut from. Nothing here was tuned on them. ``FOLDER`` is a checkout of
that repository; without it one is cloned into a temporary folder. No data are kept: the table alone goes to
``docs/orex.csv``. A unit of the files is taken for 100 mm and a pixel for 0.5 mm.

Ours has two rows: from the contours as they are, and from the mask that they fill, which is what the
isosurfaces get. Baselines with windowed sinc stand at their best settings, chosen on these very solids.
niimath and 3D Slicer's converters have rows where they are installed (see programs.py).
"""

from one_core import ROOT  # isort: skip

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import pyvista as pv

from cccd.containers import Curves, Frame, Sections, Structure
from cccd.contours import trace_contours
from cccd.geometry.mesh import Mesh
from cccd.geometry.polygons import RaggedPolygons
from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_surface
from cccd_paper.comparisons.isosurfaces import compare_isosurfaces
from cccd_paper.settings import IsosurfaceSettings

REPOSITORY = "https://github.com/haimsaw/OReX"
SOLIDS = ("balloondog", "balloondog_box", "eight_15", "hand", "hand_ok")
MM_PER_UNIT, PIXEL_MM, MARGIN_PX = 100.0, 0.5, 4
COLUMNS = [
    "solid", "slices", "slice_distance_mm", "method", "chosen", "setting", "assd_mm", "hd95_mm",
    "volume_bias", "normals_median_deg", "curvature_per_area_mm", "closed_manifold", "self_intersections",
    "genus", "genus_true", "bytes",
]  # fmt: skip


def read_csl(path: Path) -> tuple[np.ndarray, list[tuple[int, bool, np.ndarray]]]:
    """Read contours on parallel planes.

    Parameters
    ----------
    path : Path
        Its first line is ``CSLC``; then, plane after plane: number, vertices, contours and the plane's
        ``A B C D`` with Ax + By + Cz + D = 0; its vertices; its contours as numbers of vertices. A contour
        whose count has an ``h`` in it is a hole.

    Returns
    -------
    normal : (3,) float64
        Of the planes.
    contours : list of (plane, hole, points (n, 3))
    """
    lines = iter([line.split() for line in path.read_text().splitlines() if line.strip()])
    if next(lines) != ["CSLC"]:
        raise ValueError(f"{path} has no CSL header")
    normals, contours = [], []
    for number in range(int(next(lines)[0])):
        header = next(lines)
        vertices, parts = int(header[1]), int(header[2])
        normals.append([float(value) for value in header[3:6]])
        points = np.array([[float(value) for value in next(lines)] for _ in range(vertices)]).reshape(-1, 3)
        for _ in range(parts):
            size, _, *corners = next(lines)
            contours.append((number, "h" in size, points[[int(corner) for corner in corners]]))
    normal = np.array(normals[0]) / np.linalg.norm(normals[0])
    if not np.allclose(normals, normal):
        raise ValueError(f"{path}: its planes are not parallel")
    return normal, contours


def as_structure(name: str, folder: Path) -> tuple[Structure, Curves]:
    """Put a solid's contours on a grid whose slices are their planes, with the mask that they fill."""
    normal, contours = read_csl(folder / f"{name}.csl")
    points = np.concatenate([MM_PER_UNIT * ring for _, _, ring in contours])
    across = np.roll(normal, 1)  # normals are axes
    axes = np.column_stack([across, np.cross(normal, across), normal])
    low, high = (points @ axes).min(axis=0), (points @ axes).max(axis=0)
    heights = np.unique((points @ normal).round(6))
    spacing = float(np.diff(heights).mean())
    if not np.allclose(np.diff(heights), spacing, rtol=1e-3):
        raise ValueError(f"{name}: its planes are unevenly spaced")
    size = np.array([PIXEL_MM, PIXEL_MM, spacing])
    corner = np.array([*(low[:2] - MARGIN_PX * PIXEL_MM), heights[0]])
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = axes * size, axes @ corner
    rows, columns = (np.ceil((high - corner)[:2] / PIXEL_MM).astype(int) + MARGIN_PX).tolist()
    frame = Frame(affine, 2, (rows, columns, len(heights)))
    curves = _as_curves(contours, (axes, corner, size), frame)
    mask = np.moveaxis(curves.rasterise((0, 0, 0), (len(heights), rows, columns)), 0, 2)
    solid = pv.read(folder / "reference" / f"{name}_scaled.stl").clean(tolerance=1e-7)
    truth = Mesh(
        MM_PER_UNIT * np.asarray(solid.points, float), solid.faces.reshape(-1, 4)[:, 1:].astype(np.int64)
    )
    return Structure("orex", name, frame, np.zeros(3, int), mask=mask, truth=truth.outwards()), curves


def _as_curves(contours, grid, frame: Frame) -> Curves:
    axes, corner, size = grid
    indices = [(MM_PER_UNIT * ring @ axes - corner) / size for _, _, ring in contours]
    hole = np.array([inner for _, inner, _ in contours])
    rings = [index[:, :2] for index in indices]
    inward = (RaggedPolygons.of(rings).signed_areas < 0) != hole
    rings = RaggedPolygons.of(
        [ring[::-1] if turn else ring for ring, turn in zip(rings, inward, strict=True)]
    )
    slices = np.array([round(float(index[0, 2])) for index in indices], np.int32)
    return Curves(rings.points, rings.offsets, slices, hole, frame)


def score(name: str, folder: Path) -> pd.DataFrame:
    """Measure ours and every baseline on one solid."""
    structure, curves = as_structure(name, folder)
    lofting = LoftSettings()
    drawn = loft_surface(Sections(curves), lofting)
    table = compare_isosurfaces(structure, curves, drawn, IsosurfaceSettings(), lofting)
    traced = loft_surface(Sections(trace_contours(structure)), lofting)
    own = compare_isosurfaces(structure, curves, traced, IsosurfaceSettings(methods=()), lofting)
    ours = [table.iloc[[0]].assign(setting="from the contours"), own.assign(setting="from the mask")]
    spacing = structure.frame.slice_spacing
    labels = {"solid": name, "slices": structure.frame.shape[2], "slice_distance_mm": spacing}
    return pd.concat([*ours, table.iloc[1:]]).assign(**labels).reindex(columns=COLUMNS)


def main(arguments: list[str]) -> None:
    """Score the five solids and write ``docs/orex.csv``."""
    with tempfile.TemporaryDirectory() as temporary:
        checkout = Path(arguments[0] if arguments else temporary)
        if not arguments:
            subprocess.run(["git", "clone", "--depth", "1", REPOSITORY, temporary], check=True)
        tables = [score(name, checkout / "Data" / "csl_with_ref") for name in SOLIDS]
    table = pd.concat(tables, ignore_index=True)
    table.to_csv(ROOT / "docs" / "orex.csv", index=False, float_format="%.4g")
    print(table.drop(columns=["slices", "slice_distance_mm", "bytes"]).to_string())


if __name__ == "__main__":
    main(sys.argv[1:])
