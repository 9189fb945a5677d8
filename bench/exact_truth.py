"""Ours and other tools against surfaces that are known exactly, from data that every checkout has.

    python bench/exact_truth.py [--all]            the whole table: some 10 minutes of one core
    python bench/exact_truth.py ball "pial left" --slices 1 3
    python bench/exact_truth.py --folder MESHES [--pixel 0.5]
    python bench/exact_truth.py --thin             voxels on the wrong side, of thin masks

Bodies are sampled at voxel centres, with slices 1, 2, 3 and 5 pixels apart, and reconstructed from the
mask; the result is compared with the body itself, never with the voxels' steps. Bodies: analytic ones; the
cortical surfaces of nilearn's fsaverage5, two of the four without ``--all``; the meshes of
../shared/data/truth where they are; with ``--folder`` those of a folder alone. docs/exact_truth.md explains
the columns.

Windowed sinc has two rows for each of two isosurfaces: a fixed setting, and the one of a grid with the
smallest ASSD, which nobody can choose without the truth. ``assd_to_fixed`` divides by the fixed setting of
flying edges where voxels are cubes, and of linear distances otherwise; ``assd_to_best`` by the best of both
grids. niimath has a row where it is on the PATH. Seconds are the processor's, ours after a first call that
compiles.

The whole table goes to docs/measured/exact_truth.csv and into docs/exact_truth.md, a part of it to the file
that ``--table`` names.
"""

import argparse
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

for library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
os.environ.setdefault("VTK_SMP_MAX_THREADS", "1")

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "scripts"), str(ROOT / "tests"), str(Path(__file__).parent)]

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from scipy.spatial.transform import Rotation  # noqa: E402
from support.thin_masks import THIN_MASKS  # noqa: E402
from truth_bodies import (  # noqa: E402
    ANALYTIC,
    CORTICAL,
    TURN_DEG,
    Body,
    analytic_body,
    cortical_body,
    mesh_body,
    mesh_files,
    sample_stack,
)
from truth_measures import (  # noqa: E402
    Target,
    bending,
    compare,
    euler_number,
    mean_distance,
    open_edges,
    wrong_voxels,
)
from truth_rivals import (  # noqa: E402
    DISTANCES,
    EDGES,
    Made,
    by_niimath,
    by_slicer,
    by_windowed_sinc,
    has_niimath,
)
from truth_tables import (  # noqa: E402
    BEST,
    DEFAULT,
    FIXED,
    OURS,
    fill_page,
    line,
    page_tables,
    summary,
    thin_page,
)

import cccd  # noqa: E402
from cccd.errors import InputError  # noqa: E402
from cccd.geometry.mesh import Mesh  # noqa: E402

#: Distances between slices, in pixels.
RATIOS = (1, 2, 3, 5)

#: Closed meshes next to the checkout, sampled at pixels of 1 mm.
SHARED, SHARED_PIXEL = ROOT.parent / "shared/data/truth", 1.0

TABLE, THIN_TABLE = ROOT / "docs/measured/exact_truth.csv", ROOT / "docs/measured/thin_masks.csv"
PAGE = ROOT / "docs/exact_truth.md"

#: Points on each surface when the best of a grid is looked for.
_FEW_SAMPLES = 3000

#: Cortical surfaces that only ``--all``, or their names, bring: they are much like the other two.
_LEFT_OUT = {"pial right", "white left"}


class Source(NamedTuple):
    """A body that can be made.

    Attributes
    ----------
    group : str
        ``analytic``, ``cortical`` or ``meshes``.
    make : callable
        Makes it.
    """

    group: str
    make: Callable[[], Body]


def sources(turn: Rotation, folder: Path | None, pixel: float | None) -> dict[str, Source]:
    """Give all bodies by name; of a folder its meshes alone."""
    if folder is not None:
        return {p.stem: Source("meshes", lambda p=p: mesh_body(p, turn, pixel)) for p in mesh_files(folder)}
    found = {n: Source("analytic", lambda n=n: analytic_body(n, turn, pixel or 1.0)) for n in ANALYTIC}
    found |= {n: Source("cortical", lambda n=n: cortical_body(n, turn, pixel or 1.0)) for n in CORTICAL}
    return found | {
        p.stem: Source("meshes", lambda p=p: mesh_body(p, turn, pixel or SHARED_PIXEL))
        for p in mesh_files(SHARED)
    }


def ours(mask: np.ndarray, affine: np.ndarray) -> tuple[Made, tuple[str, ...]]:
    """Reconstruct a mask by the product's defaults; give the surface and its warnings."""
    began = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        surface = cccd.reconstruct(mask, affine)
    seconds = time.process_time() - began
    mesh = Mesh(np.asarray(surface.mesh.vertices, float), np.asarray(surface.mesh.faces, np.int64))
    return Made(OURS, "its defaults", mesh, seconds, True), tuple(surface.warnings)


def soundness(mesh: Mesh, mask: np.ndarray, affine: np.ndarray) -> dict[str, Any]:
    """Measure what needs no truth but the mask."""
    count, farthest = wrong_voxels(mesh, mask, affine)
    return {
        "euler": euler_number(mesh),
        "open_edges": open_edges(mesh),
        "wrong_voxels": count,
        "farthest_wrong_px": farthest,
        "triangles": len(mesh.faces),
    }


def chosen(mask: np.ndarray, affine: np.ndarray, truth: Target) -> Iterator[tuple[Made, str]]:
    """Make the surfaces that get a row, each with how its setting was chosen."""
    try:
        yield ours(mask, affine)[0], DEFAULT
    except InputError as error:
        print(f"No surface by {OURS}: {error}", file=sys.stderr)
    grids: dict[str, list[Made]] = {EDGES: [], DISTANCES: []}
    for made in by_windowed_sinc(mask, affine):
        grids[made.method].append(made)
    for grid in grids.values():
        yield next(made for made in grid if made.fixed), FIXED
        yield min(grid, key=lambda made: mean_distance(made.mesh, truth, _FEW_SAMPLES)), BEST
    for made in (*by_slicer(mask, affine), *by_niimath(mask, affine)):
        yield made, DEFAULT


def measure_stack(body: Body, truth: Target, ratio: float) -> list[dict[str, Any]]:
    """Measure every method on one stack of one body: a row each."""
    mask, affine = sample_stack(body, ratio)
    stack = {"body": body.name, "slices": ratio, "pixel_mm": body.pixel, "slice_mm": body.pixel * ratio}
    expected = euler_number(truth.mesh)
    rows = []
    for made, choice in chosen(mask, affine, truth):
        sound = soundness(made.mesh, mask, affine)
        figures = compare(made.mesh, truth) | {"bending_per_mm": bending(made.mesh)}
        figures |= {"euler": sound.pop("euler"), "euler_true": expected, **sound, "cpu_seconds": made.seconds}
        rows.append({**stack, "method": made.method, "setting": made.setting, "choice": choice, **figures})
    plain = EDGES if round(ratio) <= 1 else DISTANCES
    fixed = next(row["assd_mm"] for row in rows if (row["method"], row["choice"]) == (plain, FIXED))
    best = min(row["assd_mm"] for row in rows if row["choice"] == BEST)
    for row in rows:
        row |= {"assd_to_fixed": row["assd_mm"] / fixed, "assd_to_best": row["assd_mm"] / best}
    return rows


def thin_rows() -> Iterator[dict[str, Any]]:
    """Measure ours on every thin mask: voxels on the wrong side, soundness, time, warnings."""
    for name, make in THIN_MASKS.items():
        given = make()
        if given is None:
            print(f"No row of {name}: its file is not there", file=sys.stderr)
            continue
        mask, affine = given
        row: dict[str, Any] = {"mask": name, "voxels": int(mask.sum())}
        try:
            made, notes = ours(mask, affine)
        except InputError as error:
            yield row | {"wrong_voxels": row["voxels"], "warnings": f"no surface: {error}"}
            continue
        row |= soundness(made.mesh, mask, affine) | {
            "cpu_seconds": made.seconds,
            "warnings": " / ".join(notes),
        }
        yield row


def write(table: pd.DataFrame, path: Path | None, block: str, text: Callable[[pd.DataFrame], str]) -> None:
    """Write a table, and the page's block when the table is the project's own."""
    if path is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    table.to_csv(path, index=False, float_format="%.4g")
    if path in (TABLE, THIN_TABLE):
        page = fill_page(PAGE.read_text(encoding="utf-8"), block, text(table))
        PAGE.write_text(page, encoding="utf-8")


def compile_first() -> None:
    """Reconstruct a small ball, so that no stack's seconds hold compiling and imports."""
    for ratio in (1.0, 3.0):
        away = (np.indices((26, 26, 26)).T - (13, 13, 13)).T * np.reshape((1, 1, ratio), (3, 1, 1, 1))
        ours(np.linalg.norm(away, axis=0) < 9, np.diag([1, 1, ratio, 1.0]))


def measure_all(bodies: dict[str, Source], ratios: list[float], keep: Callable[[list], None]) -> list:
    """Measure every body at every distance of slices; ``keep`` gets all rows after each stack."""
    rows: list[dict[str, Any]] = []
    for source in bodies.values():
        try:
            body = source.make()
        except ValueError as error:
            print(f"Left out: {error}", file=sys.stderr)
            continue
        truth = Target(body.truth)
        for ratio in ratios:
            stack = measure_stack(body, truth, ratio)
            rows += [{"group": source.group, **row} for row in stack]
            print(line(stack), flush=True)
            keep(rows)
    return rows


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bodies", nargs="*", metavar="BODY", help="only these; see the table for the names")
    parser.add_argument("--all", action="store_true", help="all four cortical surfaces, not two")
    parser.add_argument("--slices", nargs="+", type=float, default=list(RATIOS), metavar="PIXELS")
    parser.add_argument("--folder", type=Path, help="closed meshes instead: PLY, STL, OBJ, OFF")
    parser.add_argument("--pixel", type=float, metavar="MM", help="in-plane pixel size")
    parser.add_argument(
        "--turn", nargs=3, type=float, default=TURN_DEG, metavar="DEGREES", help="angles about x, y, z"
    )
    parser.add_argument("--thin", action="store_true", help="thin masks instead of the bodies")
    parser.add_argument("--table", type=Path, help="where the table goes")
    return parser.parse_args()


def main() -> None:
    """Measure, print, write."""
    given = parse()
    whole = [given.slices, given.folder, given.pixel, tuple(given.turn)] == [
        list(RATIOS),
        None,
        None,
        TURN_DEG,
    ]
    if not has_niimath() and not given.thin:
        print("No row of niimath: it is not on the PATH (pip install niimath)", file=sys.stderr)
    compile_first()
    if given.thin:
        table = pd.DataFrame(thin_rows())
        print(table.drop(columns="warnings").round(3).to_string(index=False))
        print(*(f"{name}: {note}" for name, note in table[["mask", "warnings"]].values if note), sep="\n")
        write(table, given.table.resolve() if given.table else THIN_TABLE, "thin masks", thin_page)
        return
    bodies = sources(Rotation.from_euler("xyz", given.turn, degrees=True), given.folder, given.pixel)
    if unknown := set(given.bodies) - set(bodies):
        sys.exit(f"no body {', '.join(sorted(unknown))}; there are {', '.join(bodies)}")
    if given.bodies:
        bodies, whole = {name: bodies[name] for name in given.bodies}, False
    elif not given.all:
        bodies = {name: source for name, source in bodies.items() if name not in _LEFT_OUT}
    path = given.table.resolve() if given.table else TABLE if whole else None

    def keep(rows: list[dict[str, Any]]) -> None:
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            pd.DataFrame(rows).to_csv(path, index=False, float_format="%.4g")

    table = pd.DataFrame(measure_all(bodies, given.slices, keep))
    if len(table):
        print(summary(table).round(3).to_string(index=False))
        write(table, path, "bodies", page_tables)


if __name__ == "__main__":
    main()
