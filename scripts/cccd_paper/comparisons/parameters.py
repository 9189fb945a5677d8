"""Parameters of the corner detectors: the paper's two sets, and the best of a grid on training slices.

The paper prints different parameters for the same methods in Figure 9 and in Table 2, and none for FAST.
The best ones come from `cccd_paper.comparisons.corner_comparison.search` over `GRID` on training phantoms
(case ``training``: liver, lungs, kidney; four slices each; no cohort reports on them): the highest mean Dice
of the fused spline, for each kind of image, corners in their true order so that the detector is judged and
not the ordering, among parameters that use no more than `LARGEST_SHARE` of the boundary's pixels and find no
more corners in all than the boundary has pixels. Without these bounds detectors win by calling every pixel a
corner.

Section 2's detectors on the chain code have their functions' defaults, and the best of `CHAIN_GRID` by
`cccd_paper.comparisons.k_sweep.search_chain` on the same slices and within the same share of pixels. No best
lies at an end of its grid (`open_edges`). `bench/corner_grids.py` runs both searches.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping

import numpy as np

#: Names of parameter sets, as tables show them.
UNTUNED, BEST_OF_GRID = "defaults", "best of grid"

PAPER_FIGURE_9: dict[str, dict] = {
    "harris": {"block": 3, "aperture": 7, "k": 0.04},
    "shi_tomasi": {"max_corners": 400, "quality": 0.05, "distance": 1},
    "fast": {},
}

PAPER_TABLE_2: dict[str, dict] = {
    "harris": {"block": 2, "aperture": 3, "k": 0.04},
    "shi_tomasi": {"max_corners": 400, "quality": 0.1, "distance": 5},
    "fast": {},
}

GRID: dict[str, dict[str, tuple]] = {
    "harris": {
        "block": (1, 2, 3, 4),
        "aperture": (1, 3, 5),
        "k": (0.0, 0.02, 0.04, 0.06),
        "threshold": (1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 0.01),
        "radius": (0, 1, 2, 3),
    },
    "shi_tomasi": {
        "max_corners": (200, 400, 800, 1600),
        "quality": (1e-5, 1e-4, 0.001, 0.005, 0.01, 0.05, 0.1),
        "distance": (0, 1, 1.5, 2, 3, 5),
    },
    "fast": {"threshold": (0, 1, 2, 5, 10, 12, 15, 20, 30, 40, 60), "suppress": (True, False)},
    "susan": {
        "contrast": (3.0, 5.0, 10.0, 25.0, 40.0),
        "share": (0.4, 0.5, 0.6, 0.75),
        "radius": (0, 1, 2, 3, 4),
    },
}

#: Control points over boundary pixels: the paper's own 189 of 483.
LARGEST_SHARE = 0.3913

#: Winners of `GRID`, for each kind of image.
BEST: dict[str, dict[str, dict]] = {
    "mask": {
        "harris": {"block": 3, "aperture": 3, "k": 0.0, "threshold": 1e-6, "radius": 2},
        "shi_tomasi": {"max_corners": 400, "quality": 0.05, "distance": 0},
        "fast": {"threshold": 0, "suppress": False},
        "susan": {"contrast": 5.0, "share": 0.6, "radius": 3},
    },
    "outline": {
        "harris": {"block": 3, "aperture": 3, "k": 0.04, "threshold": 1e-6, "radius": 1},
        "shi_tomasi": {"max_corners": 400, "quality": 0.0001, "distance": 3},
        "fast": {"threshold": 0, "suppress": False},
        "susan": {"contrast": 5.0, "share": 0.5, "radius": 0},  # no pixel of a thin line is a corner to it
    },
    "grey": {
        "harris": {"block": 3, "aperture": 1, "k": 0.0, "threshold": 0.001, "radius": 1},
        "shi_tomasi": {"max_corners": 800, "quality": 0.0001, "distance": 3},
        "fast": {"threshold": 15, "suppress": True},
        "susan": {"contrast": 5.0, "share": 0.5, "radius": 0},
    },
}

#: Of the detectors on the chain code, which `cccd.curves.corners` has.
CHAIN_GRID: dict[str, dict[str, tuple]] = {
    "Rosenfeld-Johnston": {"share": (0.001, 0.003, 0.005, 0.007, 0.01, 0.015, 0.02, 0.03, 0.05, 0.07, 0.1)},
    "Beus-Tiu": {
        "shortest": (2, 3, 4),
        "longest": (3, 4, 5, 7),
        "cut_off": (0.005, 0.01, 0.02, 0.05, 0.1),
        "threshold": (0.0, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0),
    },
    "Medioni-Yasumoto": {
        "step": (1, 2, 3, 5, 7), "displacement": (0.0, 0.02, 0.05, 0.1, 0.2, 0.35),
    },
    "weighted k-curvature": {"k": (1, 2, 3, 4, 6, 8), "threshold": (0.0, 0.05, 0.1, 0.25, 0.5, 1.0)},
    "Cheng-Hsu": {"k": (1, 2, 3, 4, 6), "threshold": (0.0, 0.25, 0.5, 1.0, 2.0, 4.0)},
}  # fmt: skip

#: The least value of a parameter that has a meaning: nothing lies beyond it.
LEAST: dict[str, dict[str, float]] = {
    "harris": {"block": 1, "aperture": 1, "k": 0, "radius": 0},
    "shi_tomasi": {"distance": 0},
    "fast": {"threshold": 0},
    "susan": {"radius": 0},
    "Beus-Tiu": {"shortest": 2, "threshold": 0},
    "Medioni-Yasumoto": {"step": 1, "displacement": 0},
    "weighted k-curvature": {"k": 1, "threshold": 0},
    "Cheng-Hsu": {"k": 1, "threshold": 0},
}

#: Winners of `CHAIN_GRID`.
CHAIN_BEST: dict[str, dict] = {
    "Rosenfeld-Johnston": {"share": 0.007},
    "Beus-Tiu": {"shortest": 2, "longest": 4, "cut_off": 0.01, "threshold": 10.0},
    "Medioni-Yasumoto": {"step": 1, "displacement": 0.0},
    "weighted k-curvature": {"k": 1, "threshold": 0.0},
    "Cheng-Hsu": {"k": 1, "threshold": 0.0},
}


def grid_points(detector: str, grids: Mapping[str, Mapping[str, tuple]] = GRID) -> Iterator[dict]:
    """Every combination of the detector's grid; a longest value is no shorter than the shortest."""
    axes = grids[detector]
    for values in itertools.product(*axes.values()):
        point = dict(zip(axes, values, strict=True))
        if point.get("longest", np.inf) >= point.get("shortest", 0):
            yield point


def open_edges(detector: str, point: Mapping[str, object]) -> list[str]:
    """Name the parameters that lie at an end of the detector's grid beyond which there are further values."""
    grid, least = (GRID | CHAIN_GRID)[detector], LEAST.get(detector, {})
    ends = []
    for name, axis in grid.items():
        values = sorted(axis)
        low = point[name] == values[0] and point[name] != least.get(name)
        if isinstance(values[0], bool):
            continue
        if low or point[name] == values[-1]:
            ends.append(name)
    return ends


def parameter_sets(detector: str, image: str) -> dict[str, dict]:
    """Return a detector's parameter sets by name: the paper's, and the best of the grid.

    One that the paper never ran has its function's defaults in place of the paper's; one without a grid has
    those alone.
    """
    sets = {"paper, Figure 9": PAPER_FIGURE_9, "paper, Table 2": PAPER_TABLE_2}
    named = {name: table[detector] for name, table in sets.items() if detector in table}
    best = {BEST_OF_GRID: BEST[image][detector]} if detector in BEST[image] else {}
    return (named or {UNTUNED: {}}) | best
