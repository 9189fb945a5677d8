"""From which doubt on slices are listed: ``python -m cccd_calibration.doubts TABLE``.

The shipped network orders maps of `cccd_training.junctions.damages` and edges of slices of an MR template,
which its training never saw. A kind is one sample of conformal risk control, so that the guarantee is for a
further kind. Training's own kinds are easier; they are measured, and decide nothing. Prints
`cccd_junctions.uncertainty.LISTED_FROM`, and writes a table of what each kind has among its unlisted slices
when the other kinds decide.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd
from scipy import ndimage
from tqdm import tqdm

from cccd.geometry.arrays import AnyArray, BoolArray, FloatArray
from cccd.geometry.opencv import border_pixels
from cccd.inputs import Request, read_request
from cccd.settings.imports import ImportSettings
from cccd.settings.junctions import BoundarySettings
from cccd_calibration.conformal import first_enough
from cccd_junctions.boundary import edge_map
from cccd_junctions.checkpoint import load_model
from cccd_junctions.inference import Predictor, read_slices
from cccd_junctions.stacks import label_slices
from cccd_training.junctions.damages import DAMAGES
from cccd_training.junctions.random_masks import draw_mask
from cccd_training.junctions.reranker import SHORTEST_PX
from cccd_training.junctions.scoring import score_labels
from cccd_training.junctions.synthetic_images import draw_image
from cccd_training.junctions.synthetic_maps import ALL_KINDS, SyntheticMap, draw_map

#: Doubts from which slices may be listed.
LEVELS = 1 / (1 + np.exp(-np.arange(-8, 4, 0.02)))
#: Where fewer slices than this share stay unlisted, the wrong ones count as if it were this many.
LEAST_UNLISTED = 0.1
#: Shares that levels are kept for.
SHARES = (0.075, 0.1, 0.15, 0.2, 0.3)
#: Severities of training's kinds, and maps with more pixels, which cost much.
SEVERITIES, MOST_PIXELS = (0.5, 2.5), 2500
#: Real slices: their noise as a share of the organ's range, and pixels of margin.
NOISE, MARGIN_PX = (0.02, 0.2), 24
SHIPPED = Path(__file__).parents[2] / "workflow" / "models" / "junctions.pt"


#: Doubts (M,) of a kind's slices and whether they are wrong (M,), by the kind's name.
Doubts = dict[str, tuple[FloatArray, BoolArray]]


def wrong_unlisted(doubt: FloatArray, wrong: BoolArray) -> FloatArray:
    """Return the share (L,) of wrong slices among those less doubtful than `LEVELS`.

    It is the largest of this and lower levels, so that it rises with the level, as risk control needs.

    Examples
    --------
    >>> share = wrong_unlisted(np.array([0.01, 0.2, 0.3, 0.6]), np.array([False, False, True, True]))
    >>> [round(float(share[np.searchsorted(LEVELS, level)]), 2) for level in (0.25, 0.35, 0.7)]
    [0.0, 0.33, 0.5]
    """
    below, wrong_below = (
        np.searchsorted(np.sort(values), LEVELS) / len(doubt) for values in (doubt, doubt[wrong])
    )
    return np.maximum.accumulate(wrong_below / np.maximum(below, LEAST_UNLISTED))


def levels_of_shares(doubts: Doubts) -> dict[float, float]:
    """Find the highest of `LEVELS` for each of `SHARES` that the kinds guarantee."""
    # the strictest level comes last among LEVELS and first here: a lower level lists more, and misses less
    right = np.array([1 - wrong_unlisted(*found)[::-1] for found in doubts.values()])
    found = {share: first_enough(right, 1 - share) for share in SHARES}
    return {share: float(LEVELS[::-1][first]) for share, first in found.items() if first is not None}


def _maps(kind: str, count: int, rng: np.random.Generator) -> Iterator[SyntheticMap]:
    drawn = 0
    while drawn < count:
        one = _damaged(rng, kind) if kind in DAMAGES else draw_map(rng, kind, rng.uniform(*SEVERITIES))
        if sum(map(len, one.contours)) >= SHORTEST_PX and 0 < len(one.pixels) <= MOST_PIXELS:
            drawn += 1
            yield one


def _damaged(rng: np.random.Generator, kind: str) -> SyntheticMap:
    """Draw a map of a kind of damage that training does not use; three in ten have an image, as there."""
    mask = draw_mask(rng)
    contours = [contour.astype(np.int32) for contour in border_pixels(mask)]
    outline = np.zeros(mask.shape, bool)
    for contour in contours:
        outline[tuple(contour.T)] = True
    pixels = np.argwhere(DAMAGES[kind](rng, mask > 0, outline)).astype(np.int32)
    image = draw_image(rng, mask) if rng.random() < 0.3 else None
    return SyntheticMap(pixels, contours, kind, (mask.shape[0], mask.shape[1]), image)


def edges_of_slices(
    mask: AnyArray, image: AnyArray, count: int, rng: np.random.Generator
) -> Iterator[SyntheticMap]:
    """Edges of noisy slices of a scan (I, J, K), along any axis (`cccd_junctions.boundary.edge_map`)."""
    drawn = 0
    while drawn < count:
        axis = int(rng.integers(3))
        inside = np.moveaxis(mask > 0, axis, 0)
        used = np.flatnonzero(inside.any(axis=(1, 2)))
        k = used[int(rng.uniform(0.1, 0.9) * (len(used) - 1))]
        numbers, _ = cast("tuple[AnyArray, int]", ndimage.label(inside[k]))
        largest = numbers == 1 + np.bincount(numbers.ravel())[1:].argmax()
        organ = np.pad(ndimage.binary_fill_holes(largest), MARGIN_PX)
        organ = ndimage.binary_opening(organ, np.ones((2, 2), bool))
        contours = [contour.astype(np.int32) for contour in border_pixels(organ.astype(np.uint8))]
        if len(contours) != 1 or len(contours[0]) < SHORTEST_PX:
            continue
        grey = np.pad(np.moveaxis(image, axis, 0)[k].astype(np.float32), MARGIN_PX, mode="edge")
        noise = rng.uniform(*NOISE) * np.ptp(np.percentile(grey[organ], (5, 95)))
        grey += rng.normal(0, noise, grey.shape).astype(np.float32)
        found = edge_map(grey[None], organ[None], BoundarySettings())[0]
        drawn += 1
        pixels = np.argwhere(found).astype(np.int32)
        yield SyntheticMap(pixels, contours, "edges", (organ.shape[0], organ.shape[1]), grey)


def _brain() -> tuple[AnyArray, AnyArray]:
    row = dict.fromkeys(("image", "mask", "boundary", "label", "location"), "")
    brain = row | {"case": "mni152", "organ": "brain", "source": "mni152"}
    structure = read_request(Request.of_row(brain, Path()), ImportSettings(), seed=0)
    return structure.required_stack("mask"), structure.required_stack("image")


def measure_doubts(
    maps: Iterable[SyntheticMap], model: Predictor, together: bool = False
) -> tuple[FloatArray, BoolArray]:
    """Order maps, and return the doubts (M,) and errors (M,) of those that are no outlines already.

    Parameters
    ----------
    maps : iterable of SyntheticMap
    model : Predictor
    together : bool
        Whether they are a stack's neighbouring slices.
    """
    drawn = list(maps)
    read = read_slices([one.pixels for one in drawn], [one.image for one in drawn], model)
    numbers = np.arange(len(read)) * (1 if together else 2)
    found = [
        (
            float(labelled.uncertainty or 0),
            not score_labels(one.graph, labelled.inside, true.contours).correct,
        )
        for one, labelled, true in zip(read, label_slices(read, numbers), drawn, strict=True)
        if one.logits is not None
    ]
    return np.array([doubt for doubt, _ in found]), np.array([wrong for _, wrong in found], bool)


def by_other_kinds(unseen: Doubts, trained: Doubts) -> pd.DataFrame:
    """Count what each kind has among its unlisted slices, by levels that other unseen kinds decide."""
    rows: list[dict[str, object]] = []
    for kind, (doubt, wrong) in {**unseen, **trained}.items():
        others = {name: found for name, found in unseen.items() if name != kind}
        for share, level in levels_of_shares(others).items():
            unlisted = doubt < level
            rows.append({
                "kind": kind, "trained_on": kind in trained, "slices": len(doubt), "wrong": wrong.mean(),
                "share": share, "unlisted": unlisted.sum(), "wrong_unlisted": (wrong & unlisted).sum(),
                "counts": (wrong & unlisted).mean() / max(unlisted.mean(), LEAST_UNLISTED),
            })  # fmt: skip
    return pd.DataFrame(rows)


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw maps of all kinds, print the levels, write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", type=Path, help="CSV to write")
    parser.add_argument("--maps", type=int, default=300, help="of each kind")
    parser.add_argument("--seed", type=int, default=411)
    asked = parser.parse_args(arguments)
    model = cast(Predictor, load_model(SHIPPED))

    def measured(kinds: Sequence[str], stream: int) -> Doubts:
        found: Doubts = {}
        for number, kind in enumerate(tqdm(kinds, "kinds")):
            rng = np.random.default_rng([asked.seed, stream, number])
            found[kind] = measure_doubts(_maps(kind, asked.maps, rng), model)
        return found

    unseen = measured([*DAMAGES], 1)
    edges = edges_of_slices(*_brain(), asked.maps, np.random.default_rng([asked.seed, 2]))
    unseen["edges of MR slices"] = measure_doubts(edges, model)
    # clean maps are outlines already
    trained = measured([kind for kind in ALL_KINDS if kind != "clean"], 3)
    table = by_other_kinds(unseen, trained)
    table.to_csv(asked.table, index=False, float_format="%.4g")
    table["unlisted"] /= table["slices"]
    print(table.groupby(["trained_on", "share"])[["wrong", "unlisted", "counts"]].mean().round(4).to_string())
    # rounded down: that lists more
    print({share: float(np.floor(1e4 * level)) / 1e4 for share, level in levels_of_shares(unseen).items()})


if __name__ == "__main__":
    main()
