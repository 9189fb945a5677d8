"""Decoders of boundary maps: pixels (N, 2) and a point inside the organ in, a closed polygon (n, 2) out.

`cccd_paper.comparisons.decoders.decode` makes a strictly simple chain of any of these polygons.
"""

from __future__ import annotations

from cccd_paper.comparisons.baselines import Baseline
from cccd_paper.comparisons.decoders import (
    best_tree_cycle,
    circular_path,
    connected_complex,
    prize_tour,
    seeded_watershed,
)

#: By the names the tables use; those marked "seeded" get a point inside the organ.
DECODERS = {
    method.title: method
    for method in (
        Baseline("skeleton prune + tour + prizes", prize_tour, "ours, without learning"),
        Baseline("watershed (seeded)", seeded_watershed, "scikit-image, on the distance to the map"),
        Baseline("circular shortest path (seeded)", circular_path, "after Appleton and Sun (2003)"),
        Baseline("spanning tree, best cycle", best_tree_cycle, "ours, on SciPy's spanning tree"),
        Baseline("Connect2D", connected_complex, "written from the publication; its longest loop"),
    )
}
