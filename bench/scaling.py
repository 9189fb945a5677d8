"""Whether more maps or a wider network would help: scores by maps seen and by parameters.

    python bench/scaling.py [--maps N ...] [--widths N ...] [--table FILE]

The junction network is trained from scratch on fresh maps, in one cycle of the learning rate each time, and
scored on 300 maps that no training sees. The table that is committed is docs/scaling.csv; it took some half
hour of one core.
"""

from one_core import ROOT  # isort: skip

import argparse
import sys
from pathlib import Path

import pandas as pd
from training_graphs import trained_scores

from cccd_networks.settings import NetworkSettings
from cccd_training.junctions.tasks import OurTask

MAPS, WIDTHS = (1000, 4000, 16000), (16, 32, 64)
#: Maps that score, and frozen ones that are trained on in every epoch and that choose among the last epochs.
TEST, FROZEN = 300, 10
#: Maps of an epoch: the same whatever their number, so that every training draws the same first ones.
EPOCH = 500


def settings_of(width: int, maps: int) -> NetworkSettings:
    """Return the default network made wider or narrower, to be trained on so many maps."""
    plain = NetworkSettings()
    epochs = maps // EPOCH
    return plain.model_copy(
        update={
            "graphs": plain.graphs.model_copy(
                update={"training": FROZEN, "validation": FROZEN, "test": TEST}
            ),
            "fresh_maps": EPOCH - FROZEN,
            "epochs": epochs,
            "patience": epochs,
            "width": width,
        }
    )


def main() -> None:
    """Train every size on every number of maps; rows are written as they come."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--maps", type=int, nargs="+", default=MAPS)
    parser.add_argument("--widths", type=int, nargs="+", default=WIDTHS)
    parser.add_argument("--table", type=Path, default=ROOT / "docs" / "scaling.csv")
    given, rows = parser.parse_args(), []
    for maps in given.maps:
        for width in given.widths:
            settings = settings_of(width, maps)
            size = sum(weight.numel() for weight in OurTask([], settings, 0).network().parameters())
            rows.append({"maps": maps, "width": width, "parameters": size, **trained_scores(settings)})
            print(rows[-1], file=sys.stderr)
            pd.DataFrame(rows).to_csv(given.table, index=False, float_format="%.4f")


if __name__ == "__main__":
    main()
