"""What each mechanism of the surface gives: every stack is lofted without it, beside the whole.

    python tests/benchmarks/ablation.py [--scans FOLDER] [--table FILE] [NAME ...]

Stacks are thinned or coarse copies of the shared scans, where those are, and the phantoms. Distances are to
the complete mask or the phantom's own surface.
"""

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any
from unittest.mock import patch

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts"), str(Path(__file__).parent)]

import pandas as pd  # noqa: E402
from rate_distortion import structures as structures_of_rates  # noqa: E402

import cccd  # noqa: E402
from cccd.containers import Structure  # noqa: E402
from cccd.geometry.mesh import Mesh  # noqa: E402
from cccd.inputs.annotation import EVERY_SLICE  # noqa: E402
from cccd.inputs.load import structure_of_array  # noqa: E402
from cccd.reconstruction import reconstruct_mask  # noqa: E402
from cccd.settings.imports import ImportSettings  # noqa: E402
from cccd.settings.surface import LoftSettings  # noqa: E402
from cccd.surface.measure import Reference, measure_mesh  # noqa: E402
from cccd.thinning import Thinning  # noqa: E402

#: Shared scans: file, every how many slices are kept, and the edge in voxels of the blocks that are averaged.
SCANS = {
    "brain (TCGA), every 5th": ("brain_tcga_du7294/mask_brain.nii.gz", 5, 1),
    "brain (TCGA), every 8th": ("brain_tcga_du7294/mask_brain.nii.gz", 8, 1),
    "airway, every 2nd": ("airway_lidc_1mm/mask_airway.nii.gz", 2, 1),
    "airway, every 4th": ("airway_lidc_1mm/mask_airway.nii.gz", 4, 1),
    "lungs, every 5th": ("airway_lidc_1mm/mask_lungs.nii.gz", 5, 1),
    "liver, every 2nd": ("liver_totalseg_ct3mm/mask_liver.nii.gz", 2, 1),
    "colon, every 2nd": ("liver_totalseg_ct3mm/mask_colon.nii.gz", 2, 1),
    "brain (TCGA), coarse": ("brain_tcga_du7294/mask_brain.nii.gz", 2, 3),
    "airway, coarse": ("airway_lidc_1mm/mask_airway.nii.gz", 1, 2),
    "lungs, coarse": ("airway_lidc_1mm/mask_lungs.nii.gz", 2, 3),
}


def _uncorrected(_: Any, around: Any, *__: Any) -> Any:
    return around.base * around.sign


def _smooth(smooth: Mesh, *_: Any) -> Mesh:
    return smooth


#: What is replaced where a mechanism is left out.
WITHOUT: dict[str, tuple[str, Callable[..., Any]] | None] = {
    "nothing": None,
    "learned distance": ("cccd.surface.learned_distance.DistanceNetwork.estimate", _uncorrected),
    "volume of the slices": ("cccd.surface.smooth_mesh._of_volume", _smooth),
    "less filter at lost voxels": ("cccd.surface.smooth_mesh._mended", _smooth),
}


def main() -> None:
    """Loft every stack with and without, and write the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scans", type=Path, default=ROOT.parent / "shared/data")
    parser.add_argument("--table", type=Path, default=ROOT / "docs/ablation.csv")
    parser.add_argument("names", nargs="*", help="some of the stacks")
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for name, (thick, whole) in structures(options.scans):
        if options.names and name not in options.names:
            continue
        reference = Reference.of(whole)
        for mechanism, replaced in WITHOUT.items():
            rows.append({"stack": name, "without": mechanism, **lofted(thick, whole, reference, replaced)})
            print(*rows[-1].values(), flush=True)
    pd.DataFrame(rows).to_csv(options.table, index=False, float_format="%.4g")


def structures(scans: Path) -> Iterator[tuple[str, tuple[Structure, Structure]]]:
    """Give what is lofted and what it is measured against."""
    yield from structures_of_rates(Path())
    for name, (file, every, block) in SCANS.items():
        if (scans / file).exists():
            whole = cccd.read(scans / file)
            assert whole.mask is not None
            how = Thinning(whole.frame.slice_axis, every * block, 0, block, averaged=block > 1)
            affine = whole.frame.affine.copy()
            affine[:3, 3] += affine[:3, :3] @ whole.origin
            mask, affine = how.of(whole.mask, affine)
            yield name, (structure_of_array(mask, affine, ImportSettings(), name, EVERY_SLICE), whole)


def lofted(
    thick: Structure,
    whole: Structure,
    reference: Reference,
    replaced: tuple[str, Callable[..., Any]] | None,
) -> dict[str, Any]:
    """Loft with a function replaced, and measure."""
    with patch(*replaced) if replaced else nullcontext():
        surface = reconstruct_mask(thick, LoftSettings())
    found = measure_mesh(surface.mesh, whole, reference)
    keys = ("assd_mm", "hd95_mm", "bending_per_area_mm2", "genus", "volume_bias")
    return {**{key: found.get(key) for key in keys}, "bodies": surface.report["bodies"]}


if __name__ == "__main__":
    main()
