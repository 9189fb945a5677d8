"""Masks computed on coarse voxels and copied to a scan's fine ones: ours beside tuned isosurfaces.

    python bench/copied_masks.py [--table FILE]

Phantoms, whose surface is known, are cut at voxels of 1.5 and 3 mm and copied to .75 x .75 x 1 mm as
`scipy.ndimage.zoom` of order 0 does, and with it TotalSegmentator. The isosurfaces are those of the report,
each smoothed by windowed sinc at six settings; of all of them the closest counts. "as it is": ours without
looking for the coarse voxels.
"""

import argparse
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "scripts")]

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from scipy import ndimage  # noqa: E402

from cccd import reconstruct  # noqa: E402
from cccd.containers import Frame, Structure  # noqa: E402
from cccd.geometry.mesh import Mesh  # noqa: E402
from cccd.inputs.load import structure_of_array  # noqa: E402
from cccd.settings.imports import ImportSettings  # noqa: E402
from cccd_datasets.phantoms import make_phantom  # noqa: E402
from cccd_paper.comparisons.baselines.surfaces import FAMILIES  # noqa: E402
from cccd_paper.comparisons.volume_meshes import windowed_sinc  # noqa: E402
from cccd_workflow.surface_measures import Reference, measure_mesh  # noqa: E402

ORGANS, COARSE_MM, FINE_MM, CASES = ("liver", "kidney"), (1.5, 3.0), (0.75, 0.75, 1.0), range(1)
#: Families whose packages every environment has, and that need seconds.
TRIED = (
    "flying edges + windowed sinc",
    "signed distance + isosurface + windowed sinc",
    "signed distance + Gaussian + windowed sinc",
    "anti-aliased binary + windowed sinc",
)
FIGURES = ("assd_mm", "hd95_mm", "bending_per_area_mm2", "volume_bias")


def main() -> None:
    """Measure every phantom and write the means."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--table", type=Path, default=ROOT / "docs/copied_masks.csv")
    table = parser.parse_args().table
    rows: list[dict[str, Any]] = []
    for organ in ORGANS:
        for size in COARSE_MM:
            for case in CASES:
                phantom = make_phantom(
                    f"case{case}", organ, (size,) * 3, seed=case, margin_voxels=8, location="benchmark"
                )
                for method, figures in measured(*copied(phantom)):
                    rows.append({"organ": organ, "voxels_mm": size, "method": method, **figures})
            means = pd.DataFrame(rows).groupby(["organ", "voxels_mm", "method"], sort=False).mean()
            here = means.loc[(organ, size)]
            near = here[~here.index.str.startswith("CCCD")]["assd_mm"].idxmin()
            print(organ, size, here.loc[["CCCD", "CCCD, as it is", near]].round(3).to_string(), flush=True)
            means.reset_index().to_csv(table, index=False, float_format="%.4g")


def copied(phantom: Structure) -> tuple[Structure, Structure, Mesh]:
    """Copy a phantom's mask to fine voxels: as read, as it is, and the true surface."""
    mask, frame = phantom.mask, phantom.frame
    assert mask is not None
    assert phantom.truth is not None
    ratios = frame.spacing / FINE_MM
    fine = np.ascontiguousarray(ndimage.zoom(mask.astype(np.uint8), ratios, order=0) > 0)
    scale = (np.array(mask.shape) - 1) / (np.array(fine.shape) - 1)
    affine = frame.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ phantom.origin
    affine[:3, :3] *= scale
    read = structure_of_array(fine, affine, ImportSettings(), phantom.organ)
    as_it_is = Structure("copied", phantom.organ, Frame(affine, 2, fine.shape), np.zeros(3, int), mask=fine)
    return read, as_it_is, phantom.truth


def measured(read: Structure, as_it_is: Structure, truth: Mesh) -> list[tuple[str, dict[str, Any]]]:
    """Figures of ours and of the isosurfaces."""
    if read.frame.copied_to is None:
        raise SystemExit("the coarse voxels were not found")
    meshes = {
        "CCCD": reconstruct(read).lofted.mesh,
        "CCCD, as it is": reconstruct(as_it_is).lofted.mesh,
    }
    for name in TRIED:
        family = FAMILIES[name]
        for setting, shape, _ in family.meshes(as_it_is):
            for one in family.smoothings:
                mesh = shape if one is None else windowed_sinc(shape, one.rounds, one.pass_band)
                meshes[f"{name}, {setting}, {one}"] = mesh
    reference = Reference(truth, truth.volume)
    found = {method: measure_mesh(mesh, as_it_is, reference, 20_000) for method, mesh in meshes.items()}
    return [(method, {key: figures[key] for key in FIGURES}) for method, figures in found.items()]


if __name__ == "__main__":
    main()
