"""How many boundary maps the shipped network and its decoder order as they should: alone, and in stacks.

    python bench/junction_maps.py [--maps 20] [--stacks 1] [--severity 1] [--kinds mixed ...]
                                             [--final] [--ablation FILE]

Every map is of one organ without holes, whose outline is `SHORTEST_PX` long at least. Single maps are of
random organs (`cccd_training.junctions.random_masks`); stacks are of random bodies, `SLICES` slices in
order, all damaged in the same way. Edge maps (``canny``) come with their grey slices; those of a stack have
the same tissues around the organ, and so the same reasons to fail. Maps are ordered in several ways
(`WAYS`). ``doubtful`` is the share that the uncertainty tells to look at, ``caught`` the share of the wrong
ones that are among these; ``ms`` is processor time per map, from pixels to scored curves. What is tried is
tried on the development maps; the final ones have a seed of their own, for figures that are written down in
the end.

``--ablation`` writes what each mechanism gains, over all kinds (`MECHANISMS`): right maps and mean Dice with
it and without, the standard error of the difference (over maps, and of stacks over stacks), and the lines of
its modules. “Doubts” counts a wrong map that is listed for a look as right. workflow/models/README.md has
what earlier runs found.
"""

from one_core import ROOT  # isort: skip

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import ndimage

from cccd.geometry.arrays import ByteArray
from cccd.geometry.opencv import border_pixels
from cccd_datasets.corruptions import KINDS, corrupt
from cccd_junctions.checkpoint import load_model
from cccd_junctions.inference import Predictor, read_slices
from cccd_junctions.ordering import DEFAULTS
from cccd_junctions.stacks import ReadSlice, label_slices
from cccd_junctions.uncertainty import listed_from
from cccd_paper.comparisons.junction_comparison import by_true_labels
from cccd_paper.junctions.grid import build_grid, find_chains
from cccd_paper.junctions.training import grid_labels
from cccd_training.junctions.scoring import SliceScore, score_labels, score_slice
from cccd_training.junctions.synthetic_images import canny_map, draw_image
from cccd_training.junctions.synthetic_maps import SyntheticMap, draw_map

MODEL = ROOT / "workflow" / "models" / "junctions.pt"

#: The first number of every seed.
DEVELOPMENT, FINAL = 2021, 77_210_316
#: The ten kinds, and edges of images.
TEN = tuple(kind for kind in KINDS if kind != "everything")
EVALUATED = (*TEN, "canny")
#: Pixels of the shortest outline.
SHORTEST_PX = 150
#: Slices of a stack.
SLICES = 30
#: Half the width of a body's slices.
_HALF = 90


def single_maps(seed: int, kind: str, count: int, severity: float) -> list[SyntheticMap]:
    """Maps of one kind, each of another organ."""
    rng = np.random.default_rng([seed, 1, EVALUATED.index(kind)])
    maps: list[SyntheticMap] = []
    while len(maps) < count:
        drawn = draw_map(rng, kind, severity)
        if len(drawn.contours) == 1 and len(drawn.contours[0]) >= SHORTEST_PX:
            maps.append(drawn)
    return maps


def body(rng: np.random.Generator) -> ByteArray:
    """Random body (SLICES, I, J), of which every slice is one piece without holes.

    A ball, stretched and bent, with lobes and wrinkles, without the slices close to its poles.
    """
    k, i, j = np.ogrid[-0.85 : 0.85 : SLICES * 1j, -_HALF : _HALF + 1, -_HALF : _HALF + 1]
    radius, stretch = rng.uniform(30, 55), np.exp(rng.normal(0, 0.2))
    bend, lean = rng.normal(0, 5, 2), rng.normal(0, 6, 2)
    reach = np.hypot(
        (i - lean[0] * k - bend[0] * k**2) * stretch, (j - lean[1] * k - bend[1] * k**2) / stretch
    )
    field = 1 - np.hypot(reach / radius, k)
    shape = (SLICES, 2 * _HALF + 1, 2 * _HALF + 1)
    for size_px, share in ((22, rng.uniform(0.05, 0.22)), (7, rng.uniform(0, 0.04))):
        # slices lie about three pixels apart
        field = field + share * _noise(rng, shape, (size_px / 3, size_px, size_px))
    return np.stack([_one_piece(layer) for layer in field > 0]).astype(np.uint8)


def _noise(rng: np.random.Generator, shape: Sequence[int], sizes: Sequence[float]) -> np.ndarray:
    """Gaussian random field of unit variance with features of about these sizes along each axis."""
    coarse = rng.standard_normal([int(n / size) + 4 for n, size in zip(shape, sizes, strict=True)])
    fine = ndimage.zoom(coarse, [n / m for n, m in zip(shape, coarse.shape, strict=True)], order=3)
    return fine / fine.std()


def _one_piece(layer: np.ndarray) -> np.ndarray:
    """Leave the largest part of a mask, without its holes and what is one pixel thin."""
    labels, count = ndimage.label(ndimage.binary_opening(layer, np.ones((2, 2))))
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    sizes[0] = 0
    return ndimage.binary_fill_holes(labels == sizes.argmax())


def stack_of_maps(seed: int, kind: str, number: int, severity: float) -> list[SyntheticMap]:
    """Maps of a body's slices in order, all damaged in one way."""
    rng = np.random.default_rng([seed, 2, EVALUATED.index(kind), number])
    masks = body(rng)
    size = float(np.sqrt(masks.sum(axis=(1, 2)).mean()))
    tissue = int(rng.integers(2**32))  # the same tissues around every slice
    maps: list[SyntheticMap] = []
    for mask in masks:
        image = None
        if kind == "canny":
            image = draw_image(np.random.default_rng(tissue), mask, size)
            image += rng.normal(0, 0.03, mask.shape).astype(np.float32)
            observed = canny_map(rng, image, mask)
        else:
            observed = corrupt(rng, mask, kind, severity)
        contours = [contour.astype(np.int32) for contour in border_pixels(mask)]
        pixels = np.argwhere(observed).astype(np.int32)
        if len(pixels) and len(contours) == 1 and len(contours[0]) >= SHORTEST_PX:
            maps.append(SyntheticMap(pixels, contours, kind, mask.shape, image))
    return maps


class Way(NamedTuple):
    """How maps are read: the parts that a slice may have, as a stack, with alternatives."""

    parts: int | None = None
    together: bool = False
    rerank: bool = True


WAYS = {
    "alone": Way(),
    "alone, without alternatives": Way(rerank=False),
    "alone, parts 1": Way(1),
    "stack": Way(together=True),
    "stack, without alternatives": Way(together=True, rerank=False),
    "stack, parts 1": Way(1, True),
}
#: The graphs, decoded from the true labels.
DELAUNAY, GRID = "true labels, Delaunay", "true labels, grid"

#: What is compared with and without, and the modules that it consists of.
MECHANISMS = (
    ("alternatives and re-ranking", "alone", "alone, without alternatives", ("alternatives", "reranking")),
    ("alternatives and re-ranking", "stack", "stack, without alternatives", ("alternatives", "reranking")),
    ("parts", "alone, parts 1", "alone", ()),
    ("parts", "stack, parts 1", "stack", ()),
    ("neighbours", "stack", "alone", ("stacks",)),
    ("doubts", "alone, looked at", "alone", ("uncertainty",)),
    ("doubts", "stack, looked at", "stack", ("uncertainty",)),
    ("Delaunay graph and cut, against the grid", DELAUNAY, GRID, ("delaunay", "energy", "cut")),
)


def read_maps(maps: Sequence[SyntheticMap], model: Predictor) -> list[ReadSlice]:
    """What the network says of maps, batch by batch."""
    return read_slices([m.pixels for m in maps], [m.image for m in maps], model)


def scored(maps: Sequence[SyntheticMap], read: Sequence[ReadSlice], way: Way) -> list[dict[str, float]]:
    """Order maps and score them."""
    numbers = np.arange(len(maps)) * (1 if way.together else 1000)
    labelled = label_slices(read, numbers, way.parts, way.rerank)
    return [
        _row(score_labels(one.graph, found.inside, drawn.contours, way.parts), found.uncertainty)
        for one, drawn, found in zip(read, maps, labelled, strict=True)
    ]


def _row(score: SliceScore, uncertainty: float | None) -> dict[str, float]:
    doubtful = uncertainty is not None and uncertainty >= listed_from(DEFAULTS.unlisted_wrong)
    one_curve = (score.outer, score.holes) == (1, 0)
    row = {"correct": score.correct, "one_curve": one_curve, "dice": score.dice, "doubtful": doubtful}
    return {name: float(value) for name, value in row.items()}


def by_truth(maps: Sequence[SyntheticMap]) -> dict[str, list[dict[str, float]]]:
    """Decode the true labels of both graphs."""
    grids = [build_grid(one.pixels) for one in maps]
    true = [grid_labels(grid, one.contours).astype(float) for grid, one in zip(grids, maps, strict=True)]
    decoded = {DELAUNAY: by_true_labels(maps), GRID: list(map(find_chains, grids, true))}
    truth = [one.contours for one in maps]
    return {name: [_row(score, None) for score in map(score_slice, decoded[name], truth)] for name in decoded}


def measure(seed: int, count: int, stacks: int, severity: float, kinds: Sequence[str]) -> pd.DataFrame:
    """Score every map in every way: a row each."""
    model, rows = load_model(MODEL), []
    warm = single_maps(seed + 1, "mixed", 2, severity)  # compiles what it needs
    scored(warm, read_maps(warm, model), Way(1))
    for kind in kinds:
        groups = {"single": [single_maps(seed, kind, count, severity)] if count else []}
        groups["stacks"] = [stack_of_maps(seed, kind, number, severity) for number in range(stacks)]
        for name, sets in groups.items():
            for number, maps in enumerate(sets):
                began = time.process_time()
                read = read_maps(maps, model)
                reading = time.process_time() - began
                found = {way: (scores, np.nan) for way, scores in by_truth(maps).items()}
                for way in [way for way in WAYS if name == "stacks" or not WAYS[way].together]:
                    began = time.process_time()
                    scores = scored(maps, read, WAYS[way])
                    found[way] = scores, 1000 * (reading + time.process_time() - began) / len(maps)
                for way, (scores, spent) in found.items():
                    where = {"maps": name, "read": way, "kind": kind, "set": number}
                    rows += [{**where, "map": n, **score, "ms": spent} for n, score in enumerate(scores)]
            print(kind, name, len(rows), file=sys.stderr, flush=True)
    return pd.DataFrame(rows)


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Means of every kind, and over the ten."""
    kinds = pd.concat([rows, rows[rows["kind"].isin(TEN)].assign(kind="all ten")])
    kinds = kinds.assign(doubtful_wrong=(1 - kinds["correct"]) * kinds["doubtful"])
    grouped = kinds.drop(columns=["set", "map"]).groupby(["maps", "read", "kind"], sort=False)
    table = grouped.mean().assign(count=grouped.size()).reset_index()
    return table.assign(caught=table["doubtful_wrong"] / (1 - table["correct"]))


def ablation(rows: pd.DataFrame) -> pd.DataFrame:
    """Compare each of `MECHANISMS` with what is left without it, on the same maps."""
    looked = rows.assign(read=rows["read"] + ", looked at", correct=rows[["correct", "doubtful"]].max(axis=1))
    rows = pd.concat([rows, looked]).set_index(["read", "maps", "kind", "set", "map"])
    table = []
    for mechanism, with_it, without, modules in MECHANISMS:
        name = "stacks" if "stack" in with_it else "single"
        both = [rows.loc[way].loc[[name]] for way in (with_it, without)]
        entry = {"mechanism": mechanism, "maps": name, "count": len(both[0])}
        for score in ("correct", "dice"):
            gain = both[0][score] - both[1][score]
            sets = gain.groupby(["kind", "set"]).mean() if name == "stacks" else gain
            entry |= {f"{score}_without": both[1][score].mean(), score: both[0][score].mean()}
            entry |= {f"{score}_gain": gain.mean(), f"{score}_gain_se": sets.std() / len(sets) ** 0.5}
        paths = [ROOT / "scripts" / "cccd_junctions" / f"{one}.py" for one in modules]
        lines = sum(path.read_text(encoding="utf-8").count("\n") for path in paths)
        table.append(entry | {"ms": both[0]["ms"].mean() - both[1]["ms"].mean(), "lines": lines})
    return pd.DataFrame(table)


def main() -> None:
    """Read the command line, measure, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--maps", type=int, default=20, help="single maps of each kind")
    parser.add_argument("--stacks", type=int, default=1, help="stacks of each kind")
    parser.add_argument("--severity", type=float, default=1.0)
    parser.add_argument("--kinds", nargs="+", choices=EVALUATED, default=EVALUATED)
    parser.add_argument("--final", action="store_true", help="maps on which nothing is tried")
    parser.add_argument("--ablation", type=Path, help="CSV to write")
    given = parser.parse_args()
    seed = FINAL if given.final else DEVELOPMENT
    rows = measure(seed, given.maps, given.stacks, given.severity, given.kinds)
    print(summary(rows).round(4).to_string(index=False))
    if given.ablation:
        ablation(rows).to_csv(given.ablation, index=False, float_format="%.4g")


if __name__ == "__main__":
    main()
