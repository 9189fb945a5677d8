"""What bands cover where the truth is known."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pandas as pd

from cccd.bands import REGIMES, SIGNS, Calibration
from cccd_calibration.factors import Thinned

#: Classes of thickness in pixels.
CLASSES = (0.0, 4.0, 7.0, 12.0, np.inf)


def coverage_figures(stack: Thinned, known: Calibration, share: float) -> dict[str, float]:
    """Find a stack's coverage, and the band's width by the narrowest constant one's that covers as much."""
    factor, volume, _, _ = known.factors(stack.ratio, share)
    scores, swept = stack.scores(known)
    held, half = scores <= factor, len(scores) // 2
    offset, kept = np.sort(stack.offset), max(int(held.sum()), 1)
    narrowest = (offset[kept - 1 :] - offset[: len(offset) - kept + 1]).min()
    found = {"ratio": stack.ratio, "covered": held.mean(), "ours": held[:half].mean()}
    found |= {"true": held[half:].mean(), "volume": float(swept <= volume)}
    found["width"] = 2 * factor * known.lengths(stack.signs)[:half].mean() / narrowest
    mean = known.lengths(stack.signs)[:half].mean()
    for name in ("area", "diameter"):
        low, high = known.span(name, share)
        found[name] = float(low * mean <= getattr(stack, name) <= high * mean)
    thick = np.exp(stack.signs[:, SIGNS.index("thick")])
    for low, high in itertools.pairwise(CLASSES):
        here = held[(thick >= low) & (thick < high)]
        found[f"held {low:g}"], found[f"of {low:g}"] = here.sum(), len(here)
    return found


def coverage_table(rows: Sequence[dict[str, float]]) -> str:
    """List means by slice distance in pixels, the least and most covered stack, classes of thickness."""
    frame = pd.DataFrame(rows)
    frame["slices"] = pd.cut(frame.pop("ratio"), REGIMES, right=False).astype(str)
    groups = pd.concat([frame, frame.assign(slices="all")]).groupby("slices")
    table = groups[["covered", "ours", "true", "volume", "area", "diameter", "width"]].mean()
    table.insert(0, "stacks", groups.size())
    table.insert(4, "least", groups["covered"].min())
    table.insert(5, "most", groups["covered"].max())
    for low in CLASSES[:-1]:
        table[f"{low:g} px thick"] = groups[f"held {low:g}"].sum() / groups[f"of {low:g}"].sum()
    return table.round(3).to_string()
