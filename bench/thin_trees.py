"""Trees of thin tubes whose surface is known: ours beside a tuned isosurface, by the radius of the trunk.

    python bench/thin_trees.py [--table FILE]

A trunk forks twice, tubes taper and bend; the thinnest have .46 of its radius. Masks are cut at pixels
of 1 mm and slices 1 to 3 mm apart. The isosurface is that of signed distances, smoothed by windowed sinc at
six settings, of which the closest counts, and the unsmoothed one.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "scripts")]

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from skimage.measure import marching_cubes  # noqa: E402

from cccd import reconstruct  # noqa: E402
from cccd.containers import Frame, Structure  # noqa: E402
from cccd.geometry.mesh import Mesh  # noqa: E402
from cccd_paper.comparisons.baselines.surfaces import FAMILIES  # noqa: E402
from cccd_paper.comparisons.volume_meshes import GRID, windowed_sinc  # noqa: E402
from cccd_workflow.surface_measures import Reference, measure_mesh  # noqa: E402

RADII, SLICES, SEEDS = (2.0, 3.0, 4.5), (1.0, 2.0, 3.0), range(3)
#: mm: grid of the true surface.
FINE = 0.4
BASELINE = "signed distance + isosurface + windowed sinc"
FIGURES = ("assd_mm", "hd95_mm", "bending_per_area_mm2", "volume_bias")


def main() -> None:
    """Measure every tree and write the means."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path, default=ROOT / "docs/thin_trees.csv")
    table = parser.parse_args().table
    rows: list[dict[str, Any]] = []
    for radius in RADII:
        for slices in SLICES:
            for seed in SEEDS:
                for method, figures in measured(*tree(seed, radius, slices)):
                    rows.append({"trunk_mm": radius, "slices_mm": slices, "method": method, **figures})
            means = pd.DataFrame(rows).groupby(["trunk_mm", "slices_mm", "method"], sort=False).mean()
            near = means.loc[(radius, slices)].drop("CCCD")["assd_mm"].idxmin()
            print(means.loc[(radius, slices)].loc[["CCCD", near]].round(3).to_string(), flush=True)
            means.reset_index().to_csv(table, index=False, float_format="%.4g")


def measured(structure: Structure, truth: Mesh) -> list[tuple[str, dict[str, Any]]]:
    """Figures of ours and of the isosurfaces."""
    shape = FAMILIES[BASELINE].shapes[""](structure)
    meshes = {
        "CCCD": reconstruct(structure).lofted.mesh,
        "signed distance + isosurface": shape,
    } | {f"{BASELINE}, {one}": windowed_sinc(shape, one.rounds, one.pass_band) for one in GRID}
    reference = Reference(truth, truth.volume)
    found = {method: measure_mesh(mesh, structure, reference, 20_000) for method, mesh in meshes.items()}
    return [
        (method, {key: figures[key] for key in FIGURES} | {"pieces": len(meshes[method].pieces())})
        for method, figures in found.items()
    ]


def tree(seed: int, radius: float, slices: float) -> tuple[Structure, Mesh]:
    """Give a tree's mask and its surface."""
    tubes = grown(np.random.default_rng(seed), radius)
    ends = np.array([point for start, end, _, _ in tubes for point in (start, end)])
    low, high = ends.min(axis=0) - radius - 3, ends.max(axis=0) + radius + 3
    affine = np.diag([1.0, 1.0, slices, 1.0])
    affine[:3, 3] = low
    mask = distances(nodes(low, high, (1.0, 1.0, slices)), tubes, radius / 4) < 0
    vertices, faces, _, _ = marching_cubes(distances(nodes(low, high, (FINE,) * 3), tubes, radius / 4), 0)
    truth = Mesh(vertices * FINE + low, faces.astype(np.int64)).outwards()
    return Structure("tree", "tree", Frame(affine, 2, mask.shape), np.zeros(3, int), mask=mask), truth


def grown(rng: np.random.Generator, radius: float) -> list[tuple[Any, Any, float, float]]:
    """Tubes of a tree: start, end, and the radius at each."""
    tubes = []

    def grow(point: np.ndarray, way: np.ndarray, radius: float, forks: int) -> None:
        length = radius * rng.uniform(5, 8)
        for _ in range(3):
            way = unit(way + rng.normal(0, 0.15, 3))
            end = point + way * length / 3
            tubes.append((point, end, radius, 0.95 * radius))
            point, radius = end, 0.95 * radius
        if forks:
            aside = unit(np.cross(way, rng.normal(size=3)))
            for turn, share in ((rng.uniform(0.5, 0.9), 0.8), (-rng.uniform(0.4, 0.8), 0.75)):
                grow(point, way * np.cos(turn) + aside * np.sin(turn), share * radius, forks - 1)

    grow(np.zeros(3), unit(rng.normal(size=3)), radius, 2)
    return tubes


def unit(vector: np.ndarray) -> np.ndarray:
    """Scale to length 1."""
    return vector / np.linalg.norm(vector)


def nodes(low: np.ndarray, high: np.ndarray, step: tuple[float, ...]) -> np.ndarray:
    """Points (a, b, c, 3) of a grid."""
    axes = [np.arange(first, last, by) for first, last, by in zip(low, high, step, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def distances(points: np.ndarray, tubes: list[tuple[Any, Any, float, float]], blend: float) -> np.ndarray:
    """Signed distances (a, b, c) to tubes that join smoothly over so many mm (Quilez' smooth minimum)."""
    near = np.full(points.shape[:-1], 1e3)
    for start, end, first, last in tubes:
        way = end - start
        share = np.clip((points - start) @ way / (way @ way), 0, 1)
        away = np.linalg.norm(points - start - share[..., None] * way, axis=-1) - (
            first + (last - first) * share
        )
        mixed = np.clip(0.5 + 0.5 * (away - near) / blend, 0, 1)
        near = away * (1 - mixed) + near * mixed - blend * mixed * (1 - mixed)
    return near


if __name__ == "__main__":
    main()
