"""Surfaces next to other methods: of whole structures, of thick slices, and of solids unseen before."""

from __future__ import annotations

import numpy as np
import pandas as pd

from cccd_paper.comparisons.cohort_tables import as_smooth, baseline_rows
from cccd_paper.comparisons.paper_k import AS_SMOOTH_SLACK, DISTANCES
from cccd_paper.measured.text import Tables, listed, markdown_table, place, written

__all__ = [
    "cost",
    "full_resolution",
    "full_resolution_shortfall",
    "handles",
    "method_table",
    "reference_of",
    "solids_verdict",
    "thick_slices",
    "unseen_solids",
]

#: What tells structures apart.
_STRUCTURE = ["case", "organ"]


def full_resolution(tables: Tables) -> str:
    """Show our surface of every structure, and every method on those that were compared."""
    structures = tables["structures"]
    lofted = _lofting_seconds(tables)
    rows = []
    for _, row in structures.iterrows():
        known = pd.notna(row["genus_true"])
        rows.append({
            "structure": place(row),
            "reference": "true surface" if known else "its own mask",
            "3D Dice": written(row["dice_3d"], ".4f"),
            "ASSD, mm": written(row["assd_mm"]),
            "HD95, mm": written(row["hd95_mm"]),
            "volume bias": written(100 * row["volume_bias"], "+z.2f") + " %",
            "normals off, median and 90 %": f"{written(row['normals_median_deg'], '.1f')}, "
            f"{written(row['normals_p90_deg'], '.1f')}°" if known else "–",
            "genus, true": f"{written(row['genus'], '.0f')}, {written(row['genus_true'], '.0f')}",
            "control points": written(row["control_points"], ",.0f"),
            "kB": written(row["control_bytes"] / 1000, ".0f"),
            "marching cubes' mesh by it": written(row["compactness"], ".0f"),
            "CPU s": written(float(lofted[place(row)]), ".0f") if place(row) in lofted else "–",
        })  # fmt: skip
    text = [
        "## Surfaces",
        "CCCD's surface of every structure. The surface is a spline; distances are measured on its "
        "tessellation, and bytes are those of the stored spline. CPU seconds are those of the whole job, "
        "with reading and writing, and with compiling in the first jobs of a cold run. "
        "`head/brain`, `phantom_scan/liver` (edges of images) and `damaged/kidney` (damaged maps) were "
        "reconstructed without their "
        "masks, which serve only as the reference.",
        markdown_table(rows),
        _soundness(structures),
        "### Next to other methods",
        "Baselines with windowed sinc have up to two rows, from a grid of settings: the smallest ASSD, and "
        f"the smallest ASSD among settings that bend at most {AS_SMOOTH_SLACK} times as much as ours. "
        "Curvature is the mean over the surface; less is smoother. Processor seconds count from the mask.",
    ]
    surfaces = tables["surfaces"]
    for (case, organ), rows_of in surfaces.groupby(["case", "organ"], sort=False):
        text += [f"**{case}/{organ}**, {reference_of(rows_of)}", method_table(rows_of), _nearer(rows_of)]
    return "\n\n".join(text)


def _lofting_seconds(tables: Tables) -> pd.Series:
    """Processor seconds of the lofting job of each structure."""
    return tables["run"].query("rule == 'loft_surface'").set_index("place")["value"]


def _of_known_genus(structures: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Structures whose true genus is known, and those of them whose surface has another."""
    known = structures.dropna(subset=["genus_true"])
    return known, known[known["genus"] != known["genus_true"]]


def _soundness(structures: pd.DataFrame) -> str:
    sound = structures["closed_manifold"].astype(bool) & (structures["self_intersections"] == 0)
    known, wrong = _of_known_genus(structures)
    text = f"{sound.sum()} of {len(structures)} meshes are closed, manifold and free of self-intersections. "
    text += f"The genus is the true one for {len(known) - len(wrong)} of {len(known)}"
    if wrong.empty:
        return f"{text}."
    parts = [
        f"{place(row)} has {row['genus']:.0f}, and should have {row['genus_true']:.0f}"
        for _, row in wrong.iterrows()
    ]
    return (
        f"{text}: {listed(parts)}. The genus is decided between the slices: a fissure that moves by more "
        "than its width from slice to slice is closed for part of the gap, and every such bridge is a handle."
    )


def reference_of(rows: pd.DataFrame) -> str:
    """Say what the rows of one structure were measured against."""
    if rows["genus_true"].notna().any():
        return "against the true surface"
    return "against the isosurface of its own mask, which keeps the steps that others smooth away"


def method_table(rows: pd.DataFrame, meshes: bool = False) -> str:
    """Write the rows of one structure, ours in bold; of ``meshes`` volume and triangles, not bytes."""
    known = rows["genus_true"].notna().any()
    return markdown_table([
        {
            "method": _method(row),
            "ASSD, mm": written(row["assd_mm"], ".3f"),
            "HD95, mm": written(row["hd95_mm"]),
            "curvature, 1/mm": written(row["curvature_per_area_mm"], ".3f"),
            **({"normals off, median": written(row["normals_median_deg"], ".1f") + "°"} if known else {}),
            "genus" + (f" (true {rows['genus_true'].max():.0f})" if known else ""): _genus(row),
            **(_volume_and_triangles(row) if meshes else {"kB": written(row["bytes"] / 1000, ",.0f")}),
            "s": written(row["seconds"], ".1f"),
        }
        for _, row in rows.iterrows()
    ])  # fmt: skip


def _volume_and_triangles(row: pd.Series) -> dict[str, str]:
    return {
        "volume": written(100 * row["volume_bias"], "+z.2f") + " %",
        "triangles": written(row["triangles"], ",.0f"),
    }


def _method(row: pd.Series) -> str:
    if row["method"] == "CCCD":
        return "**ours**"
    setting = f", {row['setting']}" if pd.notna(row["setting"]) else ""
    return f"{row['method']}{setting}"


def _genus(row: pd.Series) -> str:
    return written(row["genus"], ".0f", "not closed" if not row["closed_manifold"] else "–")


def _nearer_rows(rows: pd.DataFrame) -> tuple[pd.Series, pd.DataFrame]:
    """Our row, and those of baselines that are nearer to the reference, the nearest first."""
    ours, rivals = rows[rows["method"] == "CCCD"].iloc[0], baseline_rows(rows)
    return ours, rivals[rivals["assd_mm"] < ours["assd_mm"]].sort_values("assd_mm")


def _smooth_rows(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of baselines that bend as little as ours."""
    rivals = baseline_rows(rows)
    return rivals[as_smooth(rows, _STRUCTURE)[rivals.index]]


def _nearer(rows: pd.DataFrame) -> str:
    """Say which baselines are nearer to the reference than ours, and which of these are as smooth."""
    ours, nearer = _nearer_rows(rows)
    smooth = _smooth_rows(rows)
    if nearer.empty:
        text = "No baseline is closer than ours."
    else:
        named = listed(list(dict.fromkeys(nearer["method"])))
        both = len(nearer.index.intersection(smooth.index))
        verb = "is" if len(nearer) == 1 else "are"
        text = f"Closer than ours {verb} {named}; {both} of these {len(nearer)} rows bend as little as ours."
    if smooth.empty:
        return f"{text} No baseline is as smooth as ours."
    best = smooth.sort_values("assd_mm").iloc[0]
    ratio = best["assd_mm"] / ours["assd_mm"]
    return f"{text} Of those as smooth as ours, {_method(best)} is closest, with {ratio:.2f} times our ASSD."


def thick_slices(tables: Tables) -> str:
    """Show ours from every n-th slice next to the closest baselines."""
    rows = tables["thick_slices"]
    parts = [
        "## Thick slices",
        "Every n-th slice is kept, and the surface of these is compared at full resolution: the brain with "
        "the isosurface of its whole mask, phantoms with the true surface. Processor seconds "
        "count from the mask on. Each row names the closest baseline, and the "
        "closest of those as smooth as ours:",
    ]
    shown = []
    for keys, group in rows.groupby(["case", "organ", "slice_distance_mm"], sort=False):
        ours, rivals = group[group["method"] == "CCCD"].iloc[0], baseline_rows(group)
        smooth = rivals[as_smooth(group, _STRUCTURE)[rivals.index]]
        shown.append({
            "structure": f"{keys[0]}/{keys[1]}, {keys[2]:g} mm",
            "reference": "true surface" if pd.notna(ours["genus_true"]) else "its own mask",
            "ours: ASSD mm, curvature, genus, s": f"{_brief(ours)}, {_genus(ours)}, {ours['seconds']:.1f}",
            "closest baseline: ASSD mm, curvature": _named(rivals),
            "closest as smooth": _named(smooth) if len(smooth) else "none is as smooth",
        })  # fmt: skip
    return "\n\n".join([*parts, markdown_table(shown)])


def _brief(row: pd.Series) -> str:
    return f"{row['assd_mm']:.2f}, {row['curvature_per_area_mm']:.3f}"


def _named(rows: pd.DataFrame) -> str:
    best = rows.sort_values("assd_mm").iloc[0]
    return f"{_brief(best)}: {_method(best)}"


def unseen_solids(tables: Tables) -> str:
    """Show every method on solids that nothing was tuned on."""
    rows = tables["orex"]
    parts = [
        "## Solids that nothing was tuned on",
        "Contours on a few planes that lie far apart: the solids of OReX (Sawdayee et al. 2023). Surfaces "
        "are compared with the solids that the contours were cut from (`python tests/benchmarks/orex.py`, "
        "not in the run above). Ours has two rows: from the contours, and from the mask that they fill. The "
        "baselines get only the mask, and have the settings that suit these solids. One unit is 100 mm.",
    ]
    for solid, group in rows.groupby("solid", sort=False):
        first = group.iloc[0]
        ours = group["method"] == "CCCD"
        named = group.assign(method=group["method"].mask(ours, "ours, " + group["setting"].astype(object)))
        kept = named.assign(setting=named["setting"].mask(ours), seconds=np.nan)
        parts += [
            f"**{solid}**, {first['slices']:.0f} planes {first['slice_distance_mm']:.1f} mm apart",
            method_table(kept),
        ]
    return "\n\n".join([*parts, solids_verdict(rows)])


def solids_verdict(rows: pd.DataFrame) -> str:
    """Say on how many solids ours, from the mask, is ahead of every baseline, and of its own distances."""
    solids = rows["solid"].nunique()
    own = (rows["method"] == "CCCD") & (rows["setting"] == "from the mask")
    ours = rows[own].set_index("solid")
    rivals = rows[~rows["method"].isin(["CCCD", DISTANCES])].groupby("solid")
    distances = rows[rows["method"] == DISTANCES].groupby("solid")["assd_mm"].min()
    ahead = {
        name: int((ours[name] < rivals[name].min().loc[ours.index]).sum()) for name in ("assd_mm", "hd95_mm")
    }
    nearer = int((distances < ours["assd_mm"]).sum())
    right = int((ours["genus"] == ours["genus_true"]).sum())
    return (
        f"From the mask, ours has a smaller ASSD than every baseline on {ahead['assd_mm']} of {solids} "
        f"solids, a smaller HD95 on {ahead['hd95_mm']}, and the true genus on {right}. The isosurface of "
        f"the distances to which our spline is fitted is closer than the spline on {nearer}."
    )


def full_resolution_shortfall(tables: Tables) -> list[str]:
    """Name the structures to whose reference a baseline is nearer than our surface."""
    found = []
    for (case, organ), rows in tables["surfaces"].groupby(["case", "organ"], sort=False):
        ours, nearer = _nearer_rows(rows)
        if len(nearer):
            rougher = len(nearer) - len(nearer.index.intersection(_smooth_rows(rows).index))
            kept = " (it has the voxels' steps)" if rows["genus_true"].isna().all() else ""
            reference = "its mask's isosurface" if kept else "the true surface"
            found.append(
                f"**Full resolution, {case}/{organ}.** {len(nearer)} rows of baselines are closer to "
                f"{reference}{kept} than ours ({nearer['assd_mm'].min():.3f} to "
                f"{nearer['assd_mm'].max():.3f} against {ours['assd_mm']:.3f} mm); {rougher} of "
                f"these {len(nearer)} bend more than ours."
            )
    return found


def handles(tables: Tables) -> list[str]:
    """Name the structures whose surface has another genus than the true one."""
    _, wrong = _of_known_genus(tables["structures"])
    return [
        f"**Handles.** {place(row)} has genus {row['genus']:.0f}, the true surface {row['genus_true']:.0f}: "
        "fissures are closed for part of the gap between slices."
        for _, row in wrong.iterrows()
    ]


def cost(tables: Tables) -> str:
    """Say what a surface costs in processor time."""
    lofted = _lofting_seconds(tables)
    seconds = [
        f"{place(row)} {float(lofted[place(row)]):.0f} s"
        for _, row in tables["structures"].iterrows()
        if place(row) in lofted
    ]
    slowest = tables["surfaces"].query("method == 'marching cubes'")["seconds"].max()
    return (
        f"**Time.** A surface costs {listed(seconds)} of processor time, marching cubes at most "
        f"{slowest:.1f} s."
    )
