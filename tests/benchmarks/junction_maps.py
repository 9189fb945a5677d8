"""How many boundary maps the shipped network and its decoder order as they should: alone, and in stacks.

    python tests/benchmarks/junction_maps.py [--maps 20] [--stacks 1] [--severity 1] [--kinds mixed ...]
                                             [--final] [--table FILE]

Every map is of one organ without holes, whose outline is `SHORTEST_PX` long at least. Single maps are of
random organs (`cccd_training.junctions.random_masks`); stacks are of random bodies, `SLICES` slices in
order, all damaged in the same way. Edge maps (``canny``) come with their grey slices; those of a stack have
the same tissues around the organ, and so the same reasons to fail. Maps are ordered in up to four ways
(`WAYS`). ``doubtful`` is the share that the uncertainty tells to look at, ``caught`` the share of the wrong
ones that are among these; ``ms`` is processor time per map, from pixels to scored curves. What is tried is
tried on the development maps; the final ones have a seed of their own, for figures that are written down in
the end.
"""

import argparse
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

for library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts")]

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from scipy import ndimage  # noqa: E402

from cccd.geometry.arrays import ByteArray  # noqa: E402
from cccd.geometry.opencv import border_pixels  # noqa: E402
from cccd.inputs.corruptions import KINDS, corrupt  # noqa: E402
from cccd_junctions.checkpoint import load_model  # noqa: E402
from cccd_junctions.inference import SLICES_PER_BATCH, Predictor, read_slices  # noqa: E402
from cccd_junctions.observation import observe  # noqa: E402
from cccd_junctions.ordering import DEFAULTS  # noqa: E402
from cccd_junctions.stacks import ReadSlice, label_slices  # noqa: E402
from cccd_junctions.uncertainty import listed_from  # noqa: E402
from cccd_training.junctions.scoring import SliceScore, score_labels  # noqa: E402
from cccd_training.junctions.synthetic_images import canny_map, draw_image  # noqa: E402
from cccd_training.junctions.synthetic_maps import SyntheticMap, draw_map  # noqa: E402

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


# Maps ---------------------------------------------------------------------------------------------------


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


# Scores -------------------------------------------------------------------------------------------------

#: A map's score, and whether it is doubtful.
Scored = tuple[SliceScore, bool]

#: What may be known besides the map: the number of parts, and that maps are the slices of a stack.
WAYS = {
    "alone": (None, False),
    "alone, parts 1": (1, False),
    "stack": (None, True),
    "stack, parts 1": (1, True),
}


def read_maps(maps: Sequence[SyntheticMap], model: Predictor) -> list[ReadSlice]:
    """What the network says of maps, batch by batch."""
    read: list[ReadSlice] = []
    for begin in range(0, len(maps), SLICES_PER_BATCH):
        batch = maps[begin : begin + SLICES_PER_BATCH]
        read += read_slices([observe(m.pixels, m.image) for m in batch], model)
    return read


def scored(
    maps: Sequence[SyntheticMap], read: Sequence[ReadSlice], parts: int | None, together: bool
) -> list[Scored]:
    """Order maps and score them; ``together`` as the slices of a stack, else as strangers."""
    numbers = np.arange(len(maps)) * (1 if together else 1000)
    scores: list[Scored] = []
    for one, drawn, found in zip(read, maps, label_slices(read, numbers, parts), strict=True):
        score = score_labels(one.graph, found.inside, drawn.contours, parts)
        scores.append((score, found.uncertainty >= listed_from(DEFAULTS.unlisted_wrong)))
    return scores


def row(way: str, maps: str, kind: str, scores: Sequence[Scored], milliseconds: float) -> dict[str, object]:
    """One line of the table."""
    wrong = np.array([not one.correct for one, _ in scores])
    doubtful = np.array([flag for _, flag in scores])
    return {
        "maps": maps,
        "read": way,
        "kind": kind,
        "count": len(scores),
        "correct": 1 - wrong.mean(),
        "one_curve": np.mean([(one.outer, one.holes) == (1, 0) for one, _ in scores]),
        "dice": np.mean([one.dice for one, _ in scores]),
        "doubtful": doubtful.mean(),
        "doubtful_wrong": (wrong & doubtful).mean(),
        "ms": milliseconds / len(scores),
    }


def measure(seed: int, count: int, stacks: int, severity: float, kinds: Sequence[str]) -> pd.DataFrame:
    """Table of all kinds, and their means over the ten."""
    model, rows = load_model(MODEL), []
    read_maps(single_maps(seed + 1, "mixed", 2, severity), model)  # compiles what it needs
    for kind in kinds:
        groups = {"single": [single_maps(seed, kind, count, severity)] if count else []}
        groups["stacks"] = [stack_of_maps(seed, kind, number, severity) for number in range(stacks)]
        for name, sets in groups.items():
            began = time.process_time()
            read = [read_maps(maps, model) for maps in sets]
            reading = time.process_time() - began
            for way, (parts, together) in WAYS.items() if sets else ():
                if together and name == "single":
                    continue
                began = time.process_time()
                pairs = zip(sets, read, strict=True)
                scores = [score for maps, seen in pairs for score in scored(maps, seen, parts, together)]
                spent = reading + time.process_time() - began
                rows.append(row(way, name, kind, scores, 1000 * spent))
                print(rows[-1], file=sys.stderr, flush=True)
    table = pd.DataFrame(rows)
    ten = table[table["kind"].isin(TEN)].drop(columns="kind")
    means = ten.groupby(["maps", "read"], sort=False).mean().reset_index()
    table = pd.concat([table, means.assign(kind="all ten")], ignore_index=True)[list(table.columns)]
    return table.assign(caught=table["doubtful_wrong"] / (1 - table["correct"]))


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
    parser.add_argument("--table", type=Path, help="CSV to write")
    given = parser.parse_args()
    table = measure(
        FINAL if given.final else DEVELOPMENT, given.maps, given.stacks, given.severity, given.kinds
    )
    print(table.round(4).to_string(index=False))
    if given.table:
        table.to_csv(given.table, index=False, float_format="%.4f")


if __name__ == "__main__":
    main()
