"""What the paper shows, table by table and figure by figure: the left half of "the paper beside ours"."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["EXHIBITS", "Exhibit"]


@dataclass(frozen=True)
class Exhibit:
    """A table or figure of the paper.

    Attributes
    ----------
    key : str
        Key of its remark in ``tables/remarks.json``; its anchor in the page.
    name, title : str
        As printed, and what it is about.
    paper : str
        What the paper shows there, with its numbers.
    table : str or None
        Stem of the CSV in ``tables/`` that holds ours.
    """

    key: str
    name: str
    title: str
    paper: str
    table: str | None = None


EXHIBITS = (
    Exhibit(
        "table1",
        "Table 1",
        "Corners that miss the boundary",
        "On one liver slice Harris finds 716 corners, 232 of them on the boundary (67.5 % false); "
        "Shi-Tomasi 53 and 11 (79.24 %); FAST 212, all on it.",
        "table1_corners",
    ),
    Exhibit(
        "figure9",
        "Figure 9",
        "Corner detectors fused with a B-spline",
        "FUSE1 (Harris) reaches a Dice score of 87.54 % and crosses itself, FUSE2 (Shi-Tomasi) 79.75 %, "
        "FUSE3 (FAST) 93.15 %.",
    ),
    Exhibit(
        "table2",
        "Table 2",
        "CCCD against the fused detectors",
        "FUSE1 95.4 % with 232 points, FUSE2 73 % with 11, FUSE3 88.4 % with 212; CCCD 96.00 % with 102 "
        "(k = 7) and 98.49 % with 156 (k = 3).",
        "table2_fuse",
    ),
    Exhibit(
        "figure10",
        "Figure 10",
        "CCCD for four values of k",
        "Dice falls as k grows: 98.49 % with 156 points (k = 3), 95.83 % with 121 (k = 5), 96.00 % with "
        "102 (k = 7), 88.75 % with 67 (k = 20).",
    ),
    Exhibit(
        "figure11",
        "Figure 11",
        "Ten rates of CCCD and the fused detectors",
        "CCCD at k = 3 has the highest true positive rate and the lowest misclassification; its rates of "
        "false positives and false negatives are 0.0029 and 0.00348.",
    ),
    Exhibit(
        "figure12",
        "Figure 12",
        "One k, two organs",
        "At k = 20 a brain boundary keeps 98.27 % Dice, a liver boundary 87.29 %.",
    ),
    Exhibit(
        "figure13",
        "Figure 13",
        "Accuracy, Dice and Jaccard against k",
        "All three fall as k grows; with minima of curvature as corners they drop suddenly near k = 20, "
        "with maxima they do not. At k = 3 Dice is 0.9849 on a liver and 0.9842 on a brain.",
    ),
    Exhibit(
        "table3",
        "Table 3",
        "CCCD against segmentation networks",
        "Polar U-Net 93.02 %, KiU-Net 3D 94.23 %, H-DenseUNet 96.5 % Dice from 483 boundary pixels (19.2 "
        "KB); CCCD 98.49 % from 189 (1.47 KB), 96.00 % from 217, 96.37 % from 133 (1.03 KB).",
        "table3_segmentation",
    ),
    Exhibit(
        "figure14",
        "Figure 14",
        "CCCD's outline for k = 3, 7 and 12",
        "Outlines from 189, 217 and 133 boundary pixels beside H-DenseUNet's.",
    ),
    Exhibit(
        "figure15",
        "Figure 15",
        "An active contour from a seed",
        "The B-spline snake of Marsousi et al. depends on the seed's radius and place; its best of five "
        "runs reaches 79.78 % Dice, and on a lung it leaves a large part outside.",
    ),
    Exhibit(
        "figure16",
        "Figure 16",
        "Curves reconstructed from corner points",
        "From Harris corners Connect2D, Crawl and NN-Crust leave gaps; CCCD closes the curve.",
    ),
    Exhibit(
        "table4",
        "Table 4",
        "Connected and disconnected segments",
        "Connect2D leaves 2 segments, Crawl 4, NN-Crust 12; CCCD one closed curve.",
        "table4_reconstruction",
    ),
    Exhibit(
        "table5",
        "Table 5",
        "Time to find corners and to connect them",
        "Corners: Harris 1.885 s, Shi-Tomasi 1.304 s, FAST 0.93 s, CCCD 2.889 s. Curves: Connect2D 3.44 "
        "s, Crawl 6.87 s, NN-Crust 5.34 s, CCCD 0.395 s.",
        "table5_times",
    ),
    Exhibit(
        "figure17",
        "Figure 17",
        "The surface",
        "Marching cubes leaves a grid-like roughness on a liver (a); the stacked splines do not (b); "
        "their control net encloses the surface (c). It took 4.287 s.",
    ),
)
