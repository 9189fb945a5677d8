"""Calibrate the error bands on exact truth: ``python -m cccd_calibration.shipped_bands``.

Random bodies, phantoms and nilearn's cortical surfaces are cut into slices and reconstructed; writes
``cccd/bands.json``, and prints what held-out bands cover. Meshes of ``--kept`` train nothing.
"""

from __future__ import annotations

import argparse
import itertools
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import trimesh
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from scipy.special import expit
from tqdm.contrib.concurrent import process_map

from cccd.bands import REGIMES, SHIPPED, SIGNS, Calibration, Curve
from cccd.contours import trace_contours
from cccd.errors import InputError
from cccd.geometry.arrays import FloatArray
from cccd.geometry.mesh import Mesh
from cccd.geometry.raster import voxelise
from cccd.inputs.annotation import EVERY_SLICE
from cccd.inputs.load import structure_of_array
from cccd.settings.root import Settings
from cccd.surface.loft import loft_in_plane
from cccd_calibration.coverage import coverage_figures, coverage_table
from cccd_calibration.factors import Thinned, calibrate
from cccd_calibration.thinning import LEAST_SLICES, compare
from cccd_datasets.implicit_solids import ImplicitFunction, mesh_zero_set
from cccd_datasets.phantoms import ORGANS
from cccd_meshes.closed_meshes import read_closed_mesh
from cccd_training.distance.bodies import ball_with_bumps, closed_body

#: Bodies of each kind, and stacks of each: factors for few are wide, bands for .9 hold .93 after 50 stacks.
ROUND, RANDOM, STACKS = 240, 64, 3
PHANTOMS = ("liver", "kidney", "bronchi", "lungs", "torus", "shell", "two_spheres")
CORTICES = ("pial_left", "white_right")
#: In pixels: edge of the cubes that triangulate a body, and how far slices lie apart at most.
CUBE, MOST_RATIO = 0.5, 15.0
#: mm of a pixel that cortices are cut with.
CORTEX_PIXEL = 2.0
#: Bodies of less volume are specks, and those of more area take too long.
LEAST_VOXELS, MOST_AREA = 1500, 9000
#: Values of each sign, not as logarithms, between which its curve is linear; the first is the least seen.
KNOTS = {
    "slope": (0.05, 0.2, 0.4, 0.8, 1.6, 4),
    "thick": (1, 2, 4, 8, 16),
    "curvature": (0.2, 0.4, 0.8, 1.6, 3.2, 6.4),
}
#: The quantile of offsets that is learnt, and how far its loss is rounded off.
QUANTILE, ROUNDED = 0.9, 0.05
#: Offsets get so many pixels more: their logarithm shall not run off to nothing.
LEAST_OFFSET = 0.01
#: Points of each stack that are trained with; weight of the curves' squares; rounds of the fit.
PER_STACK, RIDGE, ROUNDS = 800, 1e-4, 200
#: Parts of the bodies that are held out in turn; share of the surface that bands shall hold.
FOLDS, SHARE = 5, 0.9


def bodies() -> Iterator[tuple[str, Callable[[], Mesh | None]]]:
    """Names of bodies, and what makes each: a closed mesh whose unit is a pixel, or None."""
    yield from ((f"round/{seed}", partial(_largest, ball_with_bumps, seed)) for seed in range(ROUND))
    yield from ((f"random/{seed}", partial(_largest, closed_body, seed)) for seed in range(RANDOM))
    yield from ((f"{name}/{seed}", partial(_phantom, name, seed)) for name in PHANTOMS for seed in range(2))
    yield from ((f"cortex/{name}", partial(_cortex, name)) for name in CORTICES)


def _largest(draw: Callable[[int], tuple[ImplicitFunction, FloatArray]], seed: int) -> Mesh | None:
    """Mesh of the largest part of a body around the origin; None where it is very small or large."""
    solid, half = draw(seed)
    try:
        mesh = max(mesh_zero_set(solid, -half, half, CUBE).pieces(), key=lambda one: one.volume)
    except ValueError:  # there is nothing
        return None
    return mesh if mesh.volume > LEAST_VOXELS and mesh.area < MOST_AREA else None


def _phantom(name: str, seed: int) -> Mesh:
    rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
    anatomy = ORGANS[name](rng)
    low, high = np.asarray(anatomy.bbox_min) - 2, np.asarray(anatomy.bbox_max) + 2
    pixel = float((high - low).max()) / rng.uniform(45, 85)
    mesh = mesh_zero_set(anatomy.organ, low, high, pixel / 2)
    return Mesh(mesh.vertices / pixel, mesh.faces)


def _cortex(name: str) -> Mesh:
    from nilearn.datasets import fetch_surf_fsaverage  # its own files, nothing is downloaded
    from nilearn.surface import load_surf_mesh

    surface = load_surf_mesh(fetch_surf_fsaverage("fsaverage5")[name])
    smooth = trimesh.Trimesh(surface.coordinates, surface.faces).subdivide_loop(2)
    return Mesh(np.asarray(smooth.vertices) / CORTEX_PIXEL, np.asarray(smooth.faces, np.int64)).outwards()


def cut(name: str, mesh: Mesh, ratio: float, rng: np.random.Generator) -> Thinned | None:
    """Cut a body, turned at random, into slices so many pixels apart, and compare its surface with it."""
    step = np.array([1.0, 1.0, ratio])
    points = Rotation.random(random_state=int(rng.integers(1 << 30))).apply(mesh.vertices)
    low = points.min(axis=0) - (2 + rng.random(3)) * step
    affine = np.diag([*step, 1.0])
    affine[:3, 3] = low
    shape = np.ceil((points.max(axis=0) - low) / step + 3).astype(int)
    truth, settings = Mesh(points, mesh.faces).outwards(), Settings()
    mask = voxelise(truth, affine, (int(shape[0]), int(shape[1]), int(shape[2])))
    if mask.any((0, 1)).sum() < LEAST_SLICES:
        return None
    reading = settings.import_.model_copy(update={"slice_axis": 2})
    structure = structure_of_array(mask, affine, reading, name, EVERY_SLICE)
    sections = structure.sections(trace_contours(structure))
    try:
        solid = loft_in_plane(sections, settings.surface)
    except InputError as error:  # too thin a body for so few slices
        print(f"  {name} {ratio:.2f}: {error}")
        return None
    to_plane = np.asarray(np.linalg.inv(solid.stack.to_world), float)
    return compare(name, solid, truth.transformed(to_plane), truth.volume, rng)


def gather(kept: Path | None) -> tuple[list[Thinned], list[Thinned]]:
    """Cut all bodies, and the meshes that are kept apart."""
    own = process_map(_cut, *zip(*bodies(), strict=True), desc="bodies")
    paths = sorted(kept.glob("*.ply")) if kept else []
    found = [_cut(f"kept/{path.stem}", lambda path=path: read_closed_mesh(path).mesh) for path in paths]
    return [*itertools.chain(*own)], [*itertools.chain(*found)]


def _ratios(name: str, rng: np.random.Generator) -> list[float]:
    """Draw slice distances in pixels, each from another regime; the nearest is that of cubic voxels."""
    if name.startswith("kept/"):
        return [1.0, 2.0, 3.0, 5.0]
    low, high = np.array(REGIMES[:-1]), np.minimum(REGIMES[1:], MOST_RATIO)
    drawn = np.where(low < 1, 1.0, np.exp(rng.uniform(np.log(low), np.log(high))))
    return rng.permutation(drawn)[:STACKS].tolist()


def _cut(name: str, make: Callable[[], Mesh | None]) -> list[Thinned]:
    """Cut a body at some distances of slices."""
    rng, mesh = np.random.default_rng(zlib.crc32(name.encode())), make()
    found = [] if mesh is None else [cut(name, mesh, ratio, rng) for ratio in _ratios(name, rng)]
    return [stack for stack in found if stack is not None]


def train(stacks: Sequence[Thinned], names: Sequence[str] = SIGNS) -> dict[str, Curve]:
    """Learn what each sign adds to the logarithm of the quantile of offsets; each body weighs as much."""
    rng, count = np.random.default_rng(0), Counter(stack.organ for stack in stacks)
    some = [rng.choice(len(stack.offset), PER_STACK) for stack in stacks]
    seen = np.concatenate([stack.signs[rows] for stack, rows in zip(stacks, some, strict=True)])
    offset = np.concatenate([stack.offset[rows] for stack, rows in zip(stacks, some, strict=True)])
    weight = np.repeat([1 / count[stack.organ] for stack in stacks], PER_STACK)
    knots = {name: np.log(KNOTS[name]) for name in names}
    hats = [np.interp(seen[:, SIGNS.index(n)], at, row) for n, at in knots.items() for row in np.eye(len(at))]
    x, y = np.column_stack([np.ones(len(seen)), *hats]), np.log(np.abs(offset) + LEAST_OFFSET)
    ridge, w = RIDGE * (np.arange(x.shape[1]) > 0), weight / weight.sum()

    def loss(adds: FloatArray) -> tuple[float, FloatArray]:
        miss = y - x @ adds
        total = w @ (QUANTILE * miss + ROUNDED * np.logaddexp(0, -miss / ROUNDED)) + ridge @ adds**2
        return float(total), 2 * ridge * adds - (w * (QUANTILE - expit(-miss / ROUNDED))) @ x

    start, *learnt = minimize(loss, np.zeros(x.shape[1]), jac=True, method="L-BFGS-B").x
    curves = {name: Curve((0.0,), (0.0,)) for name in SIGNS}
    for name, at in knots.items():
        adds, learnt = start + np.array(learnt[: len(at)]), learnt[len(at) :]
        curves[name] = Curve((*np.round(at, 4).tolist(),), (*np.round(adds, 4).tolist(),))
        start = 0.0
    return curves


def held_out(stacks: Sequence[Thinned], apart: Sequence[Thinned], names: Sequence[str] = SIGNS) -> None:
    """Print what the bands of bodies cover that neither trained the scale nor made the factors."""
    rows = list[dict[str, float]]()
    for fold in range(FOLDS):
        held = [zlib.crc32(stack.organ.encode()) % FOLDS == fold for stack in stacks]
        known = _calibrated([stack for stack, of in zip(stacks, held, strict=True) if not of], names)
        rows += [coverage_figures(stack, known, SHARE) for stack in itertools.compress(stacks, held)]
    print(f"held out, {', '.join(names)}\n{coverage_table(rows)}", flush=True)
    if apart:
        known = _calibrated(stacks, names)
        print(f"kept apart\n{coverage_table([coverage_figures(stack, known, SHARE) for stack in apart])}")


def _calibrated(stacks: Sequence[Thinned], names: Sequence[str] = SIGNS) -> Calibration:
    kinds = sorted(Counter(organ.partition("/")[0] for organ in {stack.organ for stack in stacks}).items())
    made_of = f"{len(stacks)} stacks of {sum(count for _, count in kinds)} bodies of exact truth: "
    made_of += ", ".join(f"{kind} ({count})" for kind, count in kinds)
    return calibrate(stacks, Calibration(made_of, train(stacks, names)), made_of, SHARE, "bodies")


def main() -> None:
    """Gather, hold out, train on all, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kept", type=Path, help="folder of closed meshes (.ply), in pixels, kept apart")
    asked = parser.parse_args()
    stacks, apart = gather(asked.kept)
    for left_out in [None, *SIGNS]:
        held_out(stacks, apart, [name for name in SIGNS if name != left_out])
    _calibrated(stacks).write(SHIPPED)


if __name__ == "__main__":
    main()
