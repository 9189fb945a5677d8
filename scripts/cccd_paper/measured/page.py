"""The page: its introduction, its sections in order, and where the program falls short."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from cccd_paper.measured.chains import algorithm_1, point_meshes, reconstructions, snakes, table_3
from cccd_paper.measured.kept import BENCHMARKS, SCRIPTS, TABLES
from cccd_paper.measured.maps import (
    boundary_maps,
    equal_maps,
    image_alone,
    segmentation_networks,
    unseen_damage,
    unseen_verdict,
)
from cccd_paper.measured.planar import (
    chain_corners,
    chain_margin,
    compactness,
    corner_surfaces,
    figure_9,
    pixel_corners,
    planar_times,
    slabs,
)
from cccd_paper.measured.programs import programs, programs_verdict
from cccd_paper.measured.surfaces import (
    cost,
    full_resolution,
    full_resolution_shortfall,
    handles,
    solids_verdict,
    thick_slices,
    unseen_solids,
)
from cccd_paper.measured.text import Tables, markdown_table, written

__all__ = ["write_page"]


def write_page(docs: Path) -> str:
    """Write the page from the tables in ``docs``.

    Parameters
    ----------
    docs : path
        ``measured/`` has what `keep_tables` left of a run; the other tables are `BENCHMARKS`.
    """
    tables = {name: pd.read_csv(docs / "measured" / f"{name}.csv") for name in [*TABLES, *SCRIPTS, "run"]}
    tables |= {name: pd.read_csv(docs / f"{name}.csv") for name in BENCHMARKS}
    parts = [
        _introduction(tables),
        full_resolution(tables),
        thick_slices(tables),
        programs(tables),
        algorithm_1(tables),
        pixel_corners(tables),
        chain_corners(tables),
        reconstructions(tables),
        snakes(tables),
        point_meshes(tables),
        corner_surfaces(tables),
        planar_times(tables),
        boundary_maps(tables),
        unseen_damage(tables),
        equal_maps(tables),
        table_3(tables),
        segmentation_networks(tables),
        unseen_solids(tables),
        _time_and_memory(tables["benchmarks"]),
        _falls_short(tables),
    ]
    return "\n\n".join(parts) + "\n"


def _introduction(tables: Tables) -> str:
    run = tables["run"].set_index("fact")["value"]
    jobs = tables["run"][tables["run"]["fact"] == "cpu_s"]
    seconds = pd.to_numeric(jobs["value"]).sum()
    later = tables["run"][tables["run"]["fact"] == "later"]
    of_later = "".join(
        f" {row['place']} are of a later run, at commit {row['value']}." for _, row in later.iterrows()
    )
    return (
        "# Measured\n\n`docs/write_measured.py` writes this page from the tables of one run "
        "(`snakemake --cores 2 evidence`, then `snakemake --cores 2`; program at commit "
        f"{run['commit']}, {run['machine']}, Python {run['python']}). "
        "No figure is typed by hand, and a test compares the page with "
        f"`docs/measured/*.csv`. The run's {len(jobs)} jobs took {seconds:.0f} s of processor time, "
        f"the training of networks included.{of_later} The run's report has every method of these "
        "tables, and more.\n\n**References.** The phantoms are digitised from known surfaces. Their "
        "distances, volumes, normals and genus are compared with the *true surface*. The MNI brain "
        "(nilearn's ICBM152 template, 1 mm, skull-stripped: an average of 152 people, not a scan) has no "
        "true surface. Its distances are measured to the isosurface of *its own mask*, "
        "which has the voxels' steps. This favours methods that keep the steps: marching cubes has "
        "an ASSD of zero there by construction, and the smoother a method is, the further away it is. Only "
        "the phantoms show which surface is better. [Exact truth](exact_truth.md) comes first: it has more "
        "bodies whose surface is known."
    )


def _time_and_memory(benchmarks: pd.DataFrame) -> str:
    most = benchmarks["slices"].max()
    rows = benchmarks[benchmarks["slices"] == most]
    shown = [
        {
            "benchmark": row["benchmark"],
            "method": row["method"],
            "CPU s": written(row["seconds"], ".3g"),
            "MB": written(row["peak_mb"], ".3g"),
            "growth": written(row["slope"]),
        }
        for _, row in rows.iterrows()
    ]
    return "\n\n".join([
        "## Time and memory",
        f"Processor time and peak memory of {most} slices, one thread ({benchmarks['machine'].iloc[0]}, "
        "with other work running), measured by `python tests/benchmarks/run.py` ([all "
        "figures](benchmarks.csv)), not in the run above. Growth is the slope of log time over log slices.",
        markdown_table(shown),
        "![Time and memory by number of slices](benchmarks.png)",
    ])  # fmt: skip


def _falls_short(tables: Tables) -> str:
    both = figure_9(tables)
    ahead = int((both["dice_percent_fuse"] > both["dice_percent"]).sum())
    items = [
        "**The paper's claim.** At Figure 9's parameters FUSE2's corners describe the slices better than "
        f"CCCD's at k = 3 on {ahead} of {len(both)} organs ([corners](#corners-on-pixels)). "
        f"{chain_margin(tables)}",
        f"**From an image alone.** {image_alone(tables)}",
        *full_resolution_shortfall(tables),
        f"**Programs that people use.** {programs_verdict(tables)}",
        *handles(tables),
        *slabs(tables),
        f"**Few planes far apart.** {solids_verdict(tables['orex'])} "
        "([solids](#solids-that-nothing-was-tuned-on)).",
        cost(tables),
        f"**Unseen damage.** {unseen_verdict(tables)} The run's own tables of damaged maps are in "
        f"distribution ([both tables](#boundary-maps-without-a-mask)).",
        compactness(tables),
        "**No data of the paper.** Its three data sets could not be downloaded ([the paper](paper.md)).",
        "**Between the slices.** Ends of parts, and branches that move far between thick slices: see "
        "[its limits](filling.md#limits) and [exact truth](exact_truth.md). If only a few slices are "
        "annotated: see [sparse annotation](sparse_annotation.md).",
    ]
    return "\n\n".join(["## Where it falls short", "\n".join(f"- {item}" for item in items)])
