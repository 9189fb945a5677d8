"""How much results depend on a number that a user may set: at half, once and twice its value.

    python bench/sensitivity.py [--only curves ...] [--table FILE] [--fresh]

Keys of the curves are tried on outlines of phantoms. One key at a time, all others at their defaults.
A value that its range does not allow becomes the nearest that it does (halfway to a bound that it must not
reach). Rows are written as they come, and a run goes on where the last one stopped, unless the defaults' own
figures have changed since. `python docs/settings_pages.py` then takes the table into
docs/configuration.md.
"""

from one_core import ROOT  # isort: skip

import argparse
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from settings_pages import Key, keys

from cccd.containers import Curves
from cccd.contours import trace_contours
from cccd.curves.fitting import fit_splines
from cccd.errors import InputError
from cccd.settings.root import Settings, validate_config
from cccd_datasets.phantoms import make_phantom
from cccd_workflow.curve_measures import area_scores, distances

#: Phantoms and their voxel sizes in mm: large and small, branching, with a hole, with a cavity; and with
#: slices that lie five and eight pixels apart, between which thin parts move by more than their width.
PHANTOMS = (
    ("liver", (2.5, 2.5, 6.0)),
    ("kidney", (2.0, 2.0, 5.0)),
    ("lungs", (4.0, 4.0, 8.0)),
    ("torus", (1.5, 1.5, 3.0)),
    ("shell", (2.0, 2.0, 3.0)),
    ("kidney", (1.0, 1.0, 8.0)),
    ("torus", (1.0, 1.0, 5.0)),
    ("bronchi", (1.0, 1.0, 2.0)),
    ("bronchi", (1.0, 1.0, 5.0)),
    ("X", (1.0, 1.0, 8.0)),
)
FACTORS = (0.5, 1, 2)

Figures = dict[str, float]


@cache
def phantoms() -> list[Curves]:
    """Traced outlines of the phantoms' masks."""
    made = [
        make_phantom("case", organ, spacing, seed=1, margin_voxels=3, location=organ)
        for organ, spacing in PHANTOMS
    ]
    return [trace_contours(structure) for structure in made]


def curve_figures(settings: Settings) -> Figures:
    """Closeness and number of control points of the splines."""
    rows = []
    for curves in phantoms():
        splines = fit_splines(curves, settings.curves)
        drawn = splines.sample(4)
        rows.append(
            {
                "curve_dice": float(area_scores(curves, drawn)[0].mean()),
                "curve_distance_px": float(distances(curves.points, curves.offsets, drawn).mean()),
                "curve_control_points": len(splines.control_points),
            }
        )
    return means(rows)


def means(rows: list[Figures]) -> Figures:
    """Geometric means over the phantoms, so that each counts alike."""
    return {name: float(np.exp(np.mean([np.log(row[name]) for row in rows]))) for name in rows[0]}


@dataclass(frozen=True)
class Chain:
    """Figures that depend on some keys."""

    keys: tuple[str, ...]
    figures: tuple[Callable[[Settings], Figures], ...]


CHAINS = (Chain(("curves.tolerance_px",), (curve_figures,)),)


def measure(chain: Chain, settings: Settings) -> Figures:
    """All figures of a chain; none where the settings make it fail."""
    try:
        return {name: value for figure in chain.figures for name, value in figure(settings).items()}
    except InputError as error:
        print(f"  failed: {error}", flush=True)
        return {}


def scaled(key: Key, factor: float) -> float:
    """The key's value times a factor, brought into its range."""
    return _in_range(factor * key.default, key.default, key.schema)


def _in_range(value: float, default: float, schema: dict[str, Any]) -> float:
    value = min(max(value, schema.get("minimum", -np.inf)), schema.get("maximum", np.inf))
    if value <= (low := schema.get("exclusiveMinimum", -np.inf)):
        value = (low + default) / 2
    if value >= (high := schema.get("exclusiveMaximum", np.inf)):
        value = (high + default) / 2
    return round(value) if schema["type"] == "integer" else float(value)


def with_value(key: Key, value: float) -> Settings:
    """Defaults of every key but one."""
    config: Any = value
    for name in reversed(key.path):
        config = {name: config}
    return validate_config(config)


def rows_of(chain: Chain, chosen: list[Key], known: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """Measure the keys one after the other; rows that are known and still hold are taken as they are."""
    base = measure(chain, Settings())
    for key in chosen:
        old = known[known["key"] == key.dotted]
        own = old[(old["factor"] == 1) & (old["value"] == json.dumps(key.default))]
        holds = len(own) == 1 and all(
            np.isclose(own.iloc[0].get(name, np.nan), value, rtol=1e-5) for name, value in base.items()
        )
        for factor in FACTORS:
            value = scaled(key, factor)
            same = old[(old["factor"] == factor) & (old["value"] == json.dumps(value))]
            if holds and len(same) == 1:
                yield same.iloc[0].dropna().to_dict()
                continue
            print(f"{key.dotted} = {value}", flush=True)
            figures = base if value == key.default else measure(chain, with_value(key, value))
            yield {
                "key": key.dotted,
                "unit": key.unit,
                "factor": factor,
                "value": json.dumps(value),
                **figures,
            }


def write(rows: list[dict[str, Any]], kept: pd.DataFrame, path: Path) -> None:
    """Write the measured rows and those of the keys that were not asked for, in the settings' order."""
    table = pd.concat([kept, pd.DataFrame(rows)], ignore_index=True)
    order = {key.dotted: number for number, key in enumerate(keys())}
    table = table[table["key"].isin(order)].drop_duplicates(["key", "factor"], keep="last")
    table = table.sort_values("factor").sort_values("key", key=lambda names: names.map(order), kind="stable")
    table = table.apply(
        lambda column: column if column.name in ("key", "unit", "value") else column.astype(float)
    )
    beside = path.with_name(path.name + ".part")
    table.to_csv(beside, index=False, float_format="%.6g")
    beside.replace(path)


def main() -> None:
    """Read the command line, measure, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", default=[""], metavar="PREFIX", help="keys that begin so")
    parser.add_argument("--table", type=Path, default=ROOT / "docs" / "sensitivity.csv")
    parser.add_argument("--fresh", action="store_true", help="measure everything again")
    arguments = parser.parse_args()
    empty = pd.DataFrame(columns=["key", "unit", "factor", "value"])
    before = pd.read_csv(arguments.table, dtype={"value": str}) if arguments.table.is_file() else empty
    rows: list[dict[str, Any]] = []
    for chain in CHAINS:
        named = [name for name in chain.keys if name.startswith(tuple(arguments.only))]
        chosen = [key for key in keys() if key.dotted in named]
        for row in rows_of(chain, chosen, empty if arguments.fresh else before) if chosen else ():
            rows.append(row)
            write(rows, before, arguments.table)


if __name__ == "__main__":
    main()
