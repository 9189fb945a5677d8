"""The paper's graphs read as graphs of corners: what the network learns on them, and what they take.

    nice -n 15 python bench/corner_graphs.py

Section 4.3 has 290 graphs of liver contours, whose corners number 1,917 over the data set
(`corner_graph_data`). Here they come from one liver of another phantom than the reported
one, 66 slices 2.5 mm apart, and k = 12 of Definition 3, at which its different corner points are nearest to
1,917. The network is trained twice, with features +1 and -1 as printed and with the corners' places as
well, and scored on the 50 test graphs, whose slices it has not seen. "no network" gives links random
scores. Then 209 of the graphs are held in memory, as section 8 counts them, once as two dense float32
matrices each and once as lists of links in PyTorch Geometric, each in a process of its own whose peak is
measured. The committed table is docs/measured/corner_graphs.csv.
"""

from one_core import ROOT  # isort: skip

import argparse
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from corner_graph_data import (
    corner_data,
    dense_matrices,
    draw_splits,
    is_right,
    number_corners,
)

from cccd.contours import trace_contours
from cccd.settings.root import Settings
from cccd_datasets.phantoms import make_phantom
from cccd_networks.settings import NetworkSettings
from cccd_paper.junctions.training import LinkTask
from cccd_training.junctions.frozen_graphs import PAPER_GRAPHS
from cccd_training.junctions.loop import train_task
from cccd_training.junctions.tasks import link_scores

SPACING_MM, K, EPOCHS = (0.8, 0.8, 2.5), 12, 8


def drawn_graphs():
    """Points of the data set, and its graphs by split."""
    liver = make_phantom("training", "liver", SPACING_MM, seed=Settings().seed, margin_voxels=3, location="")
    points, rings = number_corners(trace_contours(liver), K)
    counts = NetworkSettings().graphs
    graphs = {split: getattr(counts, split) for split in ("training", "validation", "test")}
    return points, draw_splits(rings, len(points), graphs, Settings().seed)


def labelled(graphs, points):
    """Graphs for PyTorch Geometric, with labels."""
    made = []
    for graph in graphs:
        data = corner_data(graph, points)
        data.edge_label = torch.as_tensor(np.where(graph.true, 1, -1), dtype=torch.float32)
        made.append(data)
    return made


def scored(graphs, values):
    """F1 of the links, and the share of graphs whose outlines come out right."""
    right = [is_right(graph, value) for graph, value in zip(graphs, values, strict=True)]
    links = link_scores([value > 0 for value in values], [graph.true for graph in graphs])
    return links | {"right": float(np.mean(right))}


def held(way: str) -> int:
    """Bytes by which the peak of this process rises when it holds 209 graphs one way."""
    splits = drawn_graphs()[1]
    graphs = [graph for split in splits.values() for graph in split][:PAPER_GRAPHS]
    Path("/proc/self/clear_refs").write_text("5")  # the peak starts from what is held now
    before = peak_bytes()
    if way == "dense":  # copies, because zeros that nobody has written take no memory
        kept = [[matrix.copy() for matrix in dense_matrices(graph)] for graph in graphs]
    else:
        kept = labelled(graphs, None)
    assert len(kept) == PAPER_GRAPHS
    return peak_bytes() - before


def peak_bytes() -> int:
    """Largest resident memory of this process so far (Linux)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * int(next(line for line in lines if line.startswith("VmHWM")).split()[1])


def main() -> None:
    """Train, score and weigh; write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path, default=ROOT / "docs" / "measured" / "corner_graphs.csv")
    parser.add_argument("--held", choices=("dense", "sparse"), help="print what one way of holding takes")
    arguments = parser.parse_args()
    if arguments.held:
        print(held(arguments.held))
        return
    points, splits = drawn_graphs()
    links = int(sum(len(graph.links) for graph in splits["training"]))
    rng, test = np.random.default_rng(Settings().seed), splits["test"]
    rows = [{"features": "no network", **scored(test, [rng.normal(size=len(graph.links)) for graph in test])}]
    for name, places in (("+1 and -1", None), ("+1 and -1, places", points)):
        settings = NetworkSettings(network="paper")
        settings = settings.model_copy(update={"paper": settings.paper.model_copy(update={"epochs": EPOCHS})})
        task = LinkTask(labelled(splits["training"], places), settings, Settings().seed)
        started = time.process_time()
        model = train_task(task, Settings().seed)
        seconds = time.process_time() - started
        values = model.values(labelled(test, places))
        rows.append({"features": name, **scored(test, values), "train_s": seconds})
    for way in ("dense", "sparse"):
        command = [sys.executable, __file__, "--held", way]
        told = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        rows.append({"features": f"{way}, {PAPER_GRAPHS} graphs", "peak_bytes": int(told)})
    table = pd.DataFrame(rows).assign(
        corner_points=len(points), graphs=sum(map(len, splits.values())), training_links=links
    )
    table.to_csv(arguments.table, index=False, float_format="%.4g")
    print(table.to_string())


if __name__ == "__main__":
    main()
