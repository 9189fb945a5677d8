"""Masks of which every 5th, 10th or 20th slice was kept, filled again, beside ITK's and signed distances.

    python bench/sparse_annotation.py [--gaps N ...] [--only NAME ...] [--csv FILE] [MASK ...]

Masks are files that ``cccd surface`` reads; without any it takes those of ``../shared/data`` that are there,
and phantoms. The first slice that is kept lies half a gap within the organ. Three ways fill the rest: the
label map of ``cccd surface --annotated nonempty``, ITK's morphological contour interpolation (Zukić 2016;
needs ``itk-morphologicalcontourinterpolation``), and linear interpolation of signed distances (Raya and Udupa
1990); the last two say nothing beyond the last drawn slice.

Dice, and the mean distance (ASSD, mm) between voxels of the borders, both ways: on all slices, and of those
alone that lie beyond the drawn ones (``end``). Where a way leaves those empty the truth's voxels alone count.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

for library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "scripts"), str(Path(__file__).parent)]

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from run import machine  # noqa: E402
from scipy import ndimage  # noqa: E402
from scipy.spatial import cKDTree  # noqa: E402

import cccd  # noqa: E402
from cccd.containers import Structure  # noqa: E402
from cccd.geometry.distance import to_mask  # noqa: E402
from cccd.inputs import Request, read_request  # noqa: E402
from cccd.inputs.annotation import fill_mask  # noqa: E402
from cccd.settings.imports import ImportSettings  # noqa: E402
from cccd_paper.comparisons import interpolate_contours  # noqa: E402

DATA = ROOT.parent / "shared" / "data"
#: Masks of real scans, by their names in the table.
SHARED = {
    "liver, 3 mm": "liver_totalseg_ct3mm/mask_liver.nii.gz",
    "colon, 3 mm": "liver_totalseg_ct3mm/mask_colon.nii.gz",
    "kidneys, 3 mm": "liver_totalseg_ct3mm/mask_kidneys.nii.gz",
    "spleen, 3 mm": "liver_totalseg_ct3mm/mask_spleen.nii.gz",
    "brain, 1 mm": "brain_tcga_du7294/mask_brain.nii.gz",
    "airway, 1 mm": "airway_lidc_1mm/mask_airway.nii.gz",
    "lungs, 1 mm": "airway_lidc_1mm/mask_lungs.nii.gz",
}
#: Phantoms, and their voxels' edge in mm.
PHANTOMS = {"liver": 2.0, "kidney": 1.0, "lungs": 2.0}
FEWEST = 3


def structures(files: list[Path]) -> Iterator[tuple[str, Structure]]:
    """Whole masks, by name."""
    if files:
        yield from ((path.name, cccd.read(path, annotated="every slice")) for path in files)
        return
    for name, path in SHARED.items():
        if (DATA / path).exists():
            yield name, cccd.read(DATA / path, annotated="every slice")
    for organ, edge in PHANTOMS.items():
        settings = ImportSettings.model_validate({"phantom": {"spacing_mm": (edge, edge, edge)}})
        row = dict.fromkeys(("image", "mask", "boundary", "label"), "")
        row |= {"case": "bench", "organ": organ, "source": "phantom", "location": organ}
        yield f"phantom {organ}", read_request(Request.of_row(row, Path()), settings, seed=0)


def thinned(stack: np.ndarray, gap: int) -> tuple[np.ndarray, np.ndarray]:
    """Every so many-th slice of a stack, from half a gap within it; and which those are."""
    first, last = np.flatnonzero(stack.any(axis=(1, 2)))[[0, -1]]
    kept = np.arange(first + gap // 2, last + 1, gap)
    kept = kept[stack[kept].any(axis=(1, 2))]
    thin = np.zeros_like(stack)
    thin[kept] = stack[kept]
    return thin, kept


def ours(thin: np.ndarray, kept: np.ndarray, structure: Structure) -> np.ndarray:
    """The label map of ``cccd surface --annotated nonempty``."""
    frame = structure.frame
    origin = np.array(structure.origin)
    origin[frame.slice_axis] = 0
    affine = frame.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ origin
    surface = cccd.reconstruct(np.moveaxis(thin, 0, frame.slice_axis), affine, annotated="nonempty")
    filled = fill_mask(surface.drawn, surface.lofted.mesh, whole=True)
    return np.moveaxis(filled, frame.slice_axis, 0)


def signed_distances(thin: np.ndarray, kept: np.ndarray, structure: Structure) -> np.ndarray:
    """Signed distances of the drawn slices, linear between them."""
    filled = thin.copy()
    planes = [to_mask(thin[k], structure.frame.pixel_spacing) for k in kept]
    for low, below, high, above in zip(kept, planes, kept[1:], planes[1:], strict=False):
        for k in range(low + 1, high):
            share = (k - low) / (high - low)
            filled[k] = (1 - share) * below + share * above < 0
    return filled


def morphological(stacks: list[np.ndarray]) -> list[np.ndarray | None]:
    """ITK's morphological contour interpolation of some stacks; None where it is not installed or fails."""
    with tempfile.TemporaryDirectory() as folder:
        files = [(Path(folder) / f"{n}.npy", Path(folder) / f"{n}_filled.npy") for n in range(len(stacks))]
        for (given, _), stack in zip(files, stacks, strict=True):
            np.save(given, stack.astype(np.uint8))
        names = [str(path) for pair in files for path in pair]
        subprocess.run(
            [sys.executable, interpolate_contours.__file__, *names], capture_output=True, check=False
        )
        return [np.load(filled) > 0 if filled.exists() else None for _, filled in files]


def score(filled: np.ndarray, truth: np.ndarray, kept: np.ndarray, spacing: np.ndarray) -> dict[str, float]:
    """Dice and ASSD in mm of stacks (S, I, J), on all slices and beyond the drawn ones."""
    layers = np.arange(len(truth))
    end = (layers < kept[0]) | (layers > kept[-1])
    borders = [np.argwhere(mask & ~ndimage.binary_erosion(mask)) for mask in (filled, truth)]
    trees = [cKDTree(border * spacing) for border in borders]
    away = [trees[1 - n].query(border * spacing)[0] for n, border in enumerate(borders)]
    figures: dict[str, float] = {}
    for name, here in (("", np.ones(len(truth), bool)), ("end_", end)):
        both = np.count_nonzero(filled[here] & truth[here])
        total = np.count_nonzero(filled[here]) + np.count_nonzero(truth[here])
        parts = [distance[here[border[:, 0]]] for border, distance in zip(borders, away, strict=True)]
        figures[f"{name}dice"] = 2 * both / total if total else np.nan
        figures[f"{name}assd_mm"] = float(np.mean([part.mean() for part in parts if len(part)] or [np.nan]))
    return figures


def whole_stack(structure: Structure) -> np.ndarray:
    """The mask (S, I, J) on all slices of the scan, which say where the organ cannot go on."""
    mask, first = structure.required_stack("mask"), int(structure.stack_origin[0])
    count = structure.frame.shape[structure.frame.slice_axis]
    slices = np.arange(len(mask)) + first
    inside = (slices >= 0) & (slices < count)
    stack = np.zeros((count, *mask.shape[1:]), bool)
    stack[slices[inside]] = mask[inside]
    return stack


def compare(name: str, structure: Structure, gaps: list[int]) -> Iterator[dict]:
    """Fill one thinned mask in every way."""
    truth = whole_stack(structure)
    spacing = np.array([structure.frame.slice_spacing, *structure.frame.pixel_spacing])
    stacks = {gap: thinned(truth, gap) for gap in gaps}
    stacks = {gap: stack for gap, stack in stacks.items() if len(stack[1]) >= FEWEST}
    by_itk = morphological([thin for thin, _ in stacks.values()])
    for (gap, (thin, kept)), itk in zip(stacks.items(), by_itk, strict=True):
        ways = {"CCCD": ours(thin, kept, structure), "ITK morphological": itk}
        ways |= {"signed distance": signed_distances(thin, kept, structure)}
        for way, filled in ways.items():
            if filled is not None:
                row = {"structure": name, "gap": gap, "drawn": len(kept), "way": way}
                yield row | score(filled, truth, kept, spacing)


def main() -> None:
    """Read the command line, run, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("masks", nargs="*", type=Path, metavar="MASK")
    parser.add_argument("--gaps", nargs="+", type=int, default=[5, 10, 20], metavar="N")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="structures whose names begin so")
    parser.add_argument("--csv", type=Path, metavar="FILE")
    given = parser.parse_args()
    rows: list[dict] = []
    for name, structure in structures(given.masks):
        if given.only and not name.startswith(tuple(given.only)):
            continue
        rows += compare(name, structure, given.gaps)
        print(name, file=sys.stderr, flush=True)
        if given.csv:
            pd.DataFrame(rows).to_csv(given.csv, index=False)
    table = pd.DataFrame(rows)
    print(machine())
    print(table.to_string(index=False, float_format="%.3f"))
    means = table.groupby(["gap", "way"])[["dice", "assd_mm", "end_dice", "end_assd_mm"]].mean()
    print(means.to_string(float_format="%.3f"))


if __name__ == "__main__":
    main()
