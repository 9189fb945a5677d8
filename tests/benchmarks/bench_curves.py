"""Time the curves stage on contours of doubling size, beside scipy's `splprep(per=1)` in the same run.

Usage: python tests/benchmarks/bench_curves.py [table.csv]

One row per size and step, in milliseconds of processor time (median of repeated runs on one core).
``chain code + corners + spline`` is what `describe_curves` does for one contour alone, checks for
crossings included; ``batched`` is the same per contour when 32 of them come together. ``ratio`` divides
by ``splprep``, which smooths the same points by a sum of squares equal to that of our own spline, so
that both are equally close.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import splprep

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))

from cccd.chaincode import chain_codes
from cccd.containers import Curves, Frame
from cccd.curves import describe_curves, fit_splines, sample_splines
from cccd.curves.corners import k_cosine_corners
from cccd.curves.measures import distances
from cccd.geometry.arrays import concatenate_ragged
from cccd.settings.curves import CurveSettings
from cccd.tracing import trace_stack

SETTINGS = CurveSettings()
SIZES = (250, 500, 1000, 2000, 4000)
BATCH = 32


def contour(pixels: int, rng: np.random.Generator) -> np.ndarray:
    """Traced outline of a lobed region with about so many boundary pixels."""
    radius = pixels / 6.2
    reach = int(1.6 * radius) + 3
    i, j = np.meshgrid(np.arange(-reach, reach + 1), np.arange(-reach, reach + 1), indexing="ij")
    angle, border = np.arctan2(i, j), np.full(i.shape, radius)
    for wave in range(2, 9):
        border += 0.15 * radius / wave * rng.normal() * np.cos(wave * angle + rng.uniform(0, 2 * np.pi))
    mask = np.hypot(i, j) < border
    return next(iter(trace_stack(mask[None], (0, 0, 0), Frame(np.eye(4), 2, (1, 1, 1)))))


def bundle(polygons: list[np.ndarray]) -> Curves:
    """One contour per slice."""
    points, offsets = concatenate_ragged(polygons)
    slices = np.arange(len(polygons), dtype=np.int32)
    size = int(points.max()) + 10
    return Curves(
        points, offsets, slices, np.zeros(len(polygons), bool), Frame(np.eye(4), 2, (size, size, 99))
    )


def milliseconds(work: Callable[[], object], repeats: int) -> float:
    """Median processor time of a call."""
    work()
    spent = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        spent.append(time.process_time() - start)
    return 1e3 * float(np.median(spent))


def main(path: str | None) -> None:
    """Print the table and write it as CSV when a path is given."""
    rng = np.random.default_rng(0)
    rows = []
    for size in SIZES:
        polygons = [contour(size, rng) for _ in range(BATCH)]
        one, many = bundle(polygons[:1]), bundle(polygons)
        drawn = sample_splines(fit_splines(one), 4)
        squares = float((distances(one.points, one.offsets, drawn) ** 2).sum())
        ring = np.vstack([one.points, one.points[:1]]).T
        knots = len(splprep(ring, per=1, s=squares)[0][0])
        repeats = max(3, 8000 // size)
        steps = {
            "splprep": lambda ring=ring, squares=squares: splprep(ring, per=1, s=squares),
            "chain code": lambda one=one: chain_codes(one.points, one.offsets),
            "corners": lambda one=one: k_cosine_corners(one.points, one.offsets, 7),
            "spline": lambda one=one: fit_splines(one),
            "chain code + corners + spline": lambda one=one: describe_curves(one, SETTINGS),
        }
        took = {step: milliseconds(work, repeats) for step, work in steps.items()}
        took["batched"] = milliseconds(lambda many=many: describe_curves(many, SETTINGS), 3) / BATCH
        for step, spent in took.items():
            rows.append(
                {
                    "pixels": len(one.points),
                    "step": step,
                    "ms": round(spent, 3),
                    "ratio": round(spent / took["splprep"], 2),
                    "control_points": len(fit_splines(one).control_points),
                    "splprep_control_points": knots - 7,
                }
            )
    table = pd.DataFrame(rows)
    print(table.to_string(index=False))
    if path is not None:
        table.to_csv(path, index=False)


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else None)
