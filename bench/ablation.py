"""What each mechanism of the surface gives: every stack is lofted without it, beside the whole.

    python bench/ablation.py [--table FILE] [--mechanisms NAME ...]      some minutes of one core

Stacks are sampled from surfaces that are known exactly: bodies of exact_truth.py, and trees of thin tubes.
The table goes to docs/measured/ablation.csv; its means go into docs/research/ablation.md.
"""

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import patch

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "scripts"), str(ROOT / "tests"), str(Path(__file__).parent)]

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from exact_truth import TURN_DEG, compile_first, ours, sources  # noqa: E402
from scipy.spatial.transform import Rotation  # noqa: E402
from support.thin_masks import THIN_MASKS  # noqa: E402
from thin_trees import tree  # noqa: E402
from truth_bodies import sample_stack  # noqa: E402
from truth_measures import Target, bending, mean_distance, wrong_voxels  # noqa: E402
from truth_tables import fill_page  # noqa: E402

from cccd.geometry.mesh import Mesh  # noqa: E402

TABLE, PAGE = ROOT / "docs/measured/ablation.csv", ROOT / "docs/research/ablation.md"

#: Bodies of exact_truth.py, where the data is; slices' distances in pixels; trees, by their trunk in mm.
BODIES = ("ellipsoid", "curved sheet", "hollow ball", "atrium_02", "atrium_04")
RATIOS, TRUNKS, SEEDS = (1.0, 3.0, 5.0), (2.0, 3.0), (0, 1)
#: Masks of one voxel, whose truth is not known: here voxels are counted that lie on the wrong side.
THIN = ("shell", "ribs of one voxel", "iliac wing")


def _first(value: Any, *_: Any) -> Any:
    return value


def _second(_: Any, value: Any, *__: Any) -> Any:
    return value


def _uncorrected(_: Any, around: Any, *__: Any) -> Any:
    return around.base * around.sign


def _nothing(*_: Any) -> None:
    return None


def _no_wave(*_: Any) -> float:
    return 1e-6


#: What is replaced where a mechanism is left out.
WITHOUT: dict[str, tuple[str, Callable[..., Any]] | None] = {
    "nothing": None,
    "learned distance": ("cccd.surface.learned_distance.DistanceNetwork.estimate", _uncorrected),
    "three stacks of cubes": ("cccd.surface.levels._of_cubes", _first),
    "one change of sign between slices": ("cccd.surface.levels._change_sign_once", _nothing),
    "branches that are followed": ("cccd.surface.stack.move_branches", _second),
    "low-pass filter": ("cccd.surface.smooth_mesh.default_wave", _no_wave),
    "volume of the slices": ("cccd.surface.smooth_mesh._of_volume", _first),
    "less filter where it shrinks": ("cccd.surface.smooth_mesh._kept_where_shrunk", _first),
    "less filter at lost voxels": ("cccd.surface.smooth_mesh._mended", _first),
}


def main() -> None:
    """Loft every stack with and without, and write the table and the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path, default=TABLE)
    parser.add_argument("--mechanisms", nargs="+", choices=list(WITHOUT), default=list(WITHOUT))
    options = parser.parse_args()
    compile_first()
    rows: list[dict[str, Any]] = []
    for kind, name, mask, affine, truth in stacks():
        for mechanism in dict.fromkeys(["nothing", *options.mechanisms]):
            rows.append(
                {"kind": kind, "stack": name, "without": mechanism, **lofted(mask, affine, truth, mechanism)}
            )
            print(*rows[-1].values(), flush=True)
    table = pd.DataFrame(rows)
    table.to_csv(options.table, index=False, float_format="%.4g")
    print(means(table))
    if options.table == TABLE:
        PAGE.write_text(fill_page(PAGE.read_text(encoding="utf-8"), "ablation", means(table)), "utf-8")


def stacks() -> Iterator[tuple[str, str, np.ndarray, np.ndarray, Target | None]]:
    """Give kind, name, mask, affine and true surface of every stack."""
    known = sources(Rotation.from_euler("xyz", TURN_DEG, degrees=True), None, None)
    for name in BODIES:
        if name in known:
            body = known[name].make()
            truth = Target(body.truth)
            for ratio in RATIOS:
                yield f"1:{ratio:g}", f"{name} 1:{ratio:g}", *sample_stack(body, ratio), truth
    for trunk in TRUNKS:
        for ratio in RATIOS[:2]:
            for seed in SEEDS:
                structure, truth = tree(seed, trunk, ratio)
                assert structure.mask is not None
                name = f"tree {seed} of {trunk:g} mm 1:{ratio:g}"
                yield "thin trees", name, structure.mask, structure.frame.affine, Target(truth)
    for name in THIN:
        if (made := THIN_MASKS[name]()) is not None:
            yield "thin masks", name, *made, None


def lofted(mask: np.ndarray, affine: np.ndarray, truth: Target | None, mechanism: str) -> dict[str, Any]:
    """Loft without a mechanism, and measure."""
    replaced, began = WITHOUT[mechanism], time.process_time()
    with patch(*replaced) if replaced else nullcontext():
        mesh: Mesh = ours(mask, affine)[0].mesh
    count, farthest = wrong_voxels(mesh, mask, affine)
    return {
        "assd_mm": np.nan if truth is None else mean_distance(mesh, truth),
        "bending_per_mm": bending(mesh),
        "volume_share": mesh.volume / (mask.sum() * abs(np.linalg.det(affine[:3, :3]))),
        "wrong_voxels": count,
        "farthest_wrong_px": farthest,
        "cpu_seconds": time.process_time() - began,
    }


def means(table: pd.DataFrame) -> str:
    """Make a Markdown table: a row for each mechanism, ASSD without it as a share of that of the whole."""
    whole = table[table["without"] == "nothing"].set_index("stack")
    ratio = np.log(table["assd_mm"] / table["stack"].map(whole["assd_mm"]))
    kinds = [kind for kind in dict.fromkeys(table["kind"]) if kind != "thin masks"]
    lines = ["| without | " + " | ".join(f"ASSD, {kind}" for kind in kinds) + " | worst | wrong voxels |"]
    lines.append("| --- " * (len(kinds) + 3) + "|")
    for mechanism, rows in table.groupby("without", sort=False):
        cells = [f"{np.exp(ratio[rows.index][rows['kind'] == kind].mean()):.3f}" for kind in kinds]
        cells += [f"{np.exp(ratio[rows.index].max()):.2f}", f"{rows['wrong_voxels'].sum():,}"]
        lines.append(f"| {mechanism} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
