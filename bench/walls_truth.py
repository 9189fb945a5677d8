"""Organs with shared walls against exact truth, beside the same organs alone.

    PYTHONPATH=scripts python bench/walls_truth.py [--truth FOLDER] [BODY ...]

Each body of `bench/exact_truth.py` is label 1 of a map; a small ball that touches it is label 2, so that the
body gets walls and no spline. The ratios are those of the body with walls to the body alone; ``spline``, of
solids to these walls. In ``docs/measured/walls_truth.csv``.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import nibabel
import numpy as np
import pandas as pd
from exact_truth import TURN_DEG, sources
from scipy.spatial.transform import Rotation
from truth_bodies import Body, sample_stack
from truth_measures import Target, bending, compare

import cccd
from cccd_walls.solids import build_together
from cccd_walls.splines import fit_organs

TABLE = Path(__file__).resolve().parents[1] / "docs" / "measured" / "walls_truth.csv"
BODIES = ["kidney", "bronchi", "pial left"]


def with_a_neighbour(mask: np.ndarray, ratio: float) -> np.ndarray:
    """Label the body 1, and 2 a small ball around its voxel that is farthest from its centre."""
    place = np.moveaxis(np.indices(mask.shape), 0, -1) * (1, 1, ratio)
    away = np.linalg.norm(place - place[mask].mean(axis=0), axis=-1)
    tip = place[np.unravel_index(np.argmax(np.where(mask, away, -1)), mask.shape)]
    near = np.linalg.norm(place - tip, axis=-1) < max(2.6, 1.7 * ratio)
    return np.where(mask, 1, np.where(near, 2, 0)).astype(np.uint8)


def measured(body: Body, ratio: float) -> dict[str, object]:
    """Compare both with the truth."""
    mask, affine = sample_stack(body, ratio)
    with tempfile.NamedTemporaryFile(suffix=".nii.gz") as file:
        nibabel.Nifti1Image(with_a_neighbour(mask, ratio), affine).to_filename(file.name)
        (with_walls, other), _ = cccd.reconstruct_labels(file.name)
    truth, found = Target(body.truth), []
    for mesh in (with_walls.lofted.mesh, cccd.reconstruct(mask, affine).lofted.mesh):
        near = compare(mesh, truth)
        found.append((near["assd_mm"], near["normals_median_deg"], bending(mesh), len(mesh.faces)))
    (assd, normals, bends, count), alone = found
    both = {"body": with_walls.lofted, "ball": other.lofted}
    ((shell,),) = build_together(both, fit_organs(both, 0.2), 0.2)["body"].bodies
    return {
        "body": body.name,
        "slices": f"{ratio:g}:1",
        "alone_mm": round(alone[0], 4),
        "assd": round(assd / alone[0], 3),
        "normals": round(normals / alone[1], 2),
        "bending": round(bends / alone[2], 2),
        "triangles": count,
        "spline": round(compare(shell.mesh, truth)["assd_mm"] / assd, 3),
        "control_points": len(shell.cover.vertex),
    }


def main() -> None:
    """Measure the bodies at cubes and at thick slices."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bodies", nargs="*", default=BODIES)
    parser.add_argument("--truth", type=Path)
    given = parser.parse_args()
    there = sources(Rotation.from_euler("xyz", TURN_DEG, degrees=True), given.truth, None)
    rows = [measured(there[name].make(), ratio) for name in given.bodies for ratio in (1.0, 3.0)]
    table = pd.DataFrame(rows)
    print(table.to_string(index=False))
    if given.truth is None:
        table.to_csv(TABLE, index=False)


if __name__ == "__main__":
    main()
