"""Algorithm 1 as a whole, curves from corner points, and snakes: Tables 3 and 4, Figures 15 and 16."""

from __future__ import annotations

from cccd_paper.comparisons.algorithm_1 import OURS, PAPER
from cccd_paper.comparisons.published import FIGURE_15, OTHER_DATA, TABLE_4
from cccd_paper.comparisons.reconstruction_comparison import HARRIS
from cccd_paper.measured.text import Tables, markdown_table, place, written

__all__ = ["algorithm_1", "point_meshes", "reconstructions", "snakes", "table_3"]


def algorithm_1(tables: Tables) -> str:
    """Show the printed chain from images and masks to the surface, next to ours."""
    rows = tables["algorithm_1"]
    shown = [
        {
            "structure": place(row),
            "method": row["method"],
            "slices closed": f"{row['closed']:.0f} of {row['slices']:.0f}",
            "share of the pixels, %": written(100 * row["share"], ".1f"),
            "2D Dice %": written(100 * row["dice_2d"]),
            "3D Dice": written(row["dice_3d"], ".4f"),
            "ASSD, mm": written(row["assd_mm"]),
            "HD95, mm": written(row["hd95_mm"]),
            "genus, true": f"{written(row['genus'], '.0f')}, {written(row['genus_true'], '.0f')}",
        }
        for _, row in rows.iterrows()
    ]
    both = rows.pivot_table(index=["case", "organ"], columns="method", values="assd_mm", sort=False)
    closer = both.dropna()
    closer = closer[closer[PAPER] < closer[OURS]]
    names = ", ".join("/".join(name) for name in closer.index)
    return "\n\n".join([
        "## Algorithm 1",
        "The whole printed chain in the default run: boundary pixels, chain codes, the paper's network where "
        "there are junctions, Definition 3's corners at k = 3, splines (eqs. 6 to 9), the surface of eq. "
        "(10). The reference is a phantom's true surface, and otherwise the mask. What eq. (10) leaves open "
        "was tuned on other phantoms ([the paper](paper.md)).",
        markdown_table(shown),
        f"The paper's surface is closer than ours on {len(closer)} of {len(both.dropna())}"
        f"{f' ({names})' if len(closer) else ''}.",
    ])  # fmt: skip


def table_3(tables: Tables) -> str:
    """Show Table 3: CCCD's Dice, points and bytes next to the paper's, and the figures that it quotes."""
    rows = tables["table3_segmentation"]
    shown = []
    for row in rows.to_dict("records"):
        quoted = row["note"] == OTHER_DATA
        name = row["method"] if quoted else f"{row['organ']}, {row['parameters']}"
        shown.append({
            "row": name,
            "points": written(row["boundary_pixels_used"], ".0f"),
            "of": written(row["of_boundary_pixels"], ".0f"),
            "Dice %": written(row["dice_percent"]),
            "KB": written(row["memory_kb"]),
            "the paper: points, Dice %, KB": ", ".join((
                written(row["paper_boundary_pixels_used"], ".0f"),
                written(row["paper_dice_percent"]),
                written(row["paper_memory_kb"]),
            )),
        })  # fmt: skip
    return "\n\n".join([
        "## Table 3 as printed",
        "CCCD starts from the true boundary, the networks from grey images of other data: the two kinds of "
        "row do not compare. The next section has networks and CCCD on the same scans.",
        markdown_table(shown),
    ])  # fmt: skip


def reconstructions(tables: Tables) -> str:
    """Show Table 4 and Figure 16: segments that each method leaves of Harris corners."""
    rows = tables["table4_reconstruction"].query(f"points == '{HARRIS}'")
    grouped = rows.groupby(["method", "given"], sort=False)
    medians = grouped[["connected", "disconnected", "closed_percent", "dice_percent"]].median()
    paper = TABLE_4.set_index("method")
    shown = []
    for row in medians.reset_index().to_dict("records"):
        method = row["method"]
        printed = paper.loc[method].tolist() if method in paper.index else None
        shown.append({
            "method": f"{method}, given {row['given']}",
            "connected, disconnected": f"{row['connected']:.0f}, {row['disconnected']:.0f}",
            "the paper": "–" if printed is None else f"{printed[0]:.0f}, {printed[1]:.0f}",
            "closed curves, %": written(row["closed_percent"], ".0f"),
            "Dice %": written(row["dice_percent"], ".1f"),
        })  # fmt: skip
    return "\n\n".join([
        "## Curves from corner points",
        "Table 4 and Figure 16: Harris corners linked to a curve; medians over organs. The paper does not "
        "say whether CCCD gets the corners' order, so it has a row for each reading "
        "([every row](measured/table4_reconstruction.csv), with links of all boundary pixels as well).",
        markdown_table(shown),
    ])  # fmt: skip


def snakes(tables: Tables) -> str:
    """Show Figure 15: the snakes' Dice for the figure's five seeds and over the grid of seeds."""
    rows = tables["figure15_snakes"]
    named = rows[rows["setting"] != "grid"]
    dice = named.groupby(["method", "setting"], sort=False)["dice_percent"].median().unstack("setting")
    ranges = rows.groupby("method")["dice_percent"].agg(["min", "max"])
    shown = [
        {"Dice %": row["method"]}
        | {f"seed {letter}": written(row[letter], ".1f") for letter in dice.columns}
        | {"all seeds": f"{row['min']:.1f} to {row['max']:.1f}"}
        for row in dice.join(ranges).reset_index().to_dict("records")
    ]
    return "\n\n".join([
        "## Snakes from a seed",
        f"Figure 15 and section 6.4, where the best of five seeds has {FIGURE_15} %. The paper prints "
        "neither the radius nor the place of its seeds, so these are ours, and so is what the snake's "
        "publication leaves open. Medians over organs "
        "([every seed](measured/figure15_snakes.csv)).",
        markdown_table(shown),
    ])  # fmt: skip


def point_meshes(tables: Tables) -> str:
    """Show the surfaces that the paper's references [3] to [5] make of the outlines' pixels."""
    shown = [
        {
            "structure": row["structure"],
            "method": row["method"],
            "closed": "yes" if row["closed_manifold"] else "no",
            "3D Dice": written(row["dice_3d"], ".4f"),
            "ASSD, mm": written(row["assd_mm"]),
            "HD95, mm": written(row["hd95_mm"]),
            "CPU s": written(row["seconds"], ".1f"),
        }
        for _, row in tables["point_meshes"].iterrows()
    ]
    return "\n\n".join([
        "## Surfaces from points alone",
        "Ball pivoting, alpha shapes and Poisson reconstruction, the paper's references [3] to [5], get the "
        "pixels of the outlines, as the paper's loft does (the brain and the liver; Open3D 0.20.0, which CI "
        "leaves out for its 900 MB; `python tests/benchmarks/point_meshes.py`, not in the run above). Of a "
        "surface that is not closed there is no Dice. The brain's reference is its own mask.",
        markdown_table(shown),
    ])  # fmt: skip
