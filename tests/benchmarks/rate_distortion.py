"""Error and bending against bytes: our splines at several densities beside simplified meshes.

    python tests/benchmarks/rate_distortion.py [--scans FOLDER] [--table FILE] [--picture FILE]

Six structures: the default cohort's brain, liver and lungs, and three of the shared scans where those are.
Meshes are the best of a tuned baseline (signed distance, isosurface, windowed sinc) and our own tessellation,
both simplified by quadric error (fast-simplification). All are stored alike: coordinates rounded to the same
tolerance, HDF5 with gzip. Structures that the table has already are not measured again.
"""

import argparse
import io
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts")]

import h5py  # noqa: E402
import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402

import cccd  # noqa: E402
from cccd.containers import Frame, Structure  # noqa: E402
from cccd.geometry.mesh import Mesh  # noqa: E402
from cccd.inputs.phantoms import make_phantom  # noqa: E402
from cccd.reconstruction import reconstruct_mask  # noqa: E402
from cccd.settings.root import Settings  # noqa: E402
from cccd.settings.surface import LoftSettings  # noqa: E402
from cccd.surface import spline  # noqa: E402
from cccd.surface.measure import Reference, control_bytes, measure_mesh  # noqa: E402
from cccd.tolerances import CONTROL_POINT_PIXELS  # noqa: E402
from cccd_paper.comparisons.baselines.surfaces import FAMILIES  # noqa: E402
from cccd_paper.comparisons.thick_slices import every_nth_slice  # noqa: E402
from cccd_paper.comparisons.volume_meshes import GRID, windowed_sinc  # noqa: E402

#: Control points are this many times as dense as by default.
DENSITIES = (0.25, 0.5, 1.0, 2.0, 4.0)
#: Triangles of simplified meshes.
TRIANGLES = (1000, 2000, 4000, 8000, 16000, 32000)
SAMPLES = 20_000
BASELINE = "signed distance + isosurface + windowed sinc"
#: Shared scans: file, and every how many slices are kept.
SCANS = {
    "brain (TCGA), 5 mm": ("brain_tcga_du7294/mask_brain.nii.gz", 5),
    "airway, 2 mm": ("airway_lidc_1mm/mask_airway.nii.gz", 2),
    "hippocampus, 1 mm": ("hippocampus_msd/labels/hippocampus_001.nii.gz", 1),
}


def main() -> None:
    """Measure, write the table, draw it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scans", type=Path, default=ROOT.parent / "shared/data")
    parser.add_argument("--table", type=Path, default=ROOT / "docs/rate_distortion.csv")
    parser.add_argument("--picture", type=Path, default=ROOT / "docs/rate_distortion.png")
    options = parser.parse_args()
    known = pd.read_csv(options.table) if options.table.exists() else pd.DataFrame({"structure": []})
    rows = known.to_dict("records")
    for name, (thick, whole) in structures(options.scans):
        if name in set(known["structure"]):
            continue
        for row in measured(thick, whole):
            rows.append({"structure": name, **row})
            print(*rows[-1].values(), flush=True)
        pd.DataFrame(rows).to_csv(options.table, index=False, float_format="%.4g")
    draw(pd.DataFrame(rows), options.picture)


def structures(scans: Path) -> Iterator[tuple[str, tuple[Structure, Structure]]]:
    """Give what is reconstructed and what it is measured against."""
    from nilearn.datasets import load_mni152_brain_mask

    image = load_mni152_brain_mask(resolution=1)
    mask = np.asarray(image.dataobj) > 0
    brain = Structure("mni152", "brain", Frame(image.affine, 2, mask.shape), np.zeros(3, int), mask=mask)
    yield "brain (MNI), 1 mm", (brain, brain)
    settings = Settings()
    for organ in ("liver", "lungs"):
        phantom = make_phantom(
            "phantom",
            organ,
            settings.import_.phantom.spacing_mm,
            seed=settings.seed,
            margin_voxels=3,
            location=organ,
        )
        yield f"phantom {organ}, 5 mm", (phantom, phantom)
    for name, (file, n) in SCANS.items():
        if (scans / file).exists():
            whole = cccd.read(scans / file, *(["1,2"] if "hippocampus" in file else []))
            yield name, (every_nth_slice(whole, n) if n > 1 else whole, whole)


def measured(thick: Structure, whole: Structure) -> Iterator[dict[str, Any]]:
    """Rows of every method and size for one structure."""
    reference = Reference.of(whole)
    tolerance = CONTROL_POINT_PIXELS * float(min(thick.frame.spacing))

    def row(method: str, size: int, mesh: Mesh) -> dict[str, Any]:
        found = measure_mesh(mesh, whole, reference, SAMPLES)
        names = {"assd_mm": "assd_mm", "bending": "bending_per_area_mm2", "triangles": "triangles"}
        return {"method": method, "bytes": size, **{key: found[name] for key, name in names.items()}}

    own = None
    usual = spline.DENSITY, spline.AROUND
    for times in DENSITIES:
        spline.DENSITY, spline.AROUND = (times * density for density in usual)
        try:
            surface = reconstruct_mask(thick, LoftSettings())
        finally:
            spline.DENSITY, spline.AROUND = usual
        own = surface.mesh if times == 1 else own
        yield row("CCCD", control_bytes(surface), surface.mesh)
    assert own is not None
    shape = FAMILIES[BASELINE].shapes[""](thick)
    tuned = [windowed_sinc(shape, one.rounds, one.pass_band) for one in GRID]
    best = min(tuned, key=lambda mesh: measure_mesh(mesh, whole, reference, SAMPLES)["assd_mm"])
    for method, mesh in (("CCCD's mesh, simplified", own), ("best isosurface, simplified", best)):
        for most in TRIANGLES:
            if most < len(mesh.faces):
                small = mesh.simplified(most)
                yield row(method, mesh_bytes(small, tolerance), small)


def mesh_bytes(mesh: Mesh, tolerance: float) -> int:
    """Bytes of a mesh that is stored as control meshes are: rounded, column by column, gzip."""
    step = 2.0 ** np.floor(np.log2(2 * tolerance))
    arrays = {
        "vertices": (np.round(mesh.vertices / step) * step, None),
        "faces": (mesh.faces.astype(np.int32), (len(mesh.faces), 1)),
    }
    with h5py.File(io.BytesIO(), "w") as file:
        for name, (array, chunks) in arrays.items():
            file.create_dataset(
                name, data=array, compression="gzip", compression_opts=4, shuffle=True, chunks=chunks
            )
        return sum(int(file[name].id.get_storage_size()) for name in arrays)


def draw(table: pd.DataFrame, path: Path) -> None:
    """Draw error (above) and bending (below) by bytes, one column for each structure."""
    import matplotlib.pyplot as plt

    names = list(dict.fromkeys(table["structure"]))
    figure, axes = plt.subplots(
        2, len(names), figsize=(3 * len(names), 6), sharex="col", layout="constrained"
    )
    for column, name in zip(axes.T, names, strict=True):
        of_one = table[table["structure"] == name]
        for method, rows in of_one.groupby("method", sort=False):
            for axis, key in zip(column, ("assd_mm", "bending"), strict=True):
                axis.loglog(rows["bytes"] / 1000, rows[key], "o-", label=method, markersize=3)
        column[0].set_title(name, fontsize=9)
        column[1].set_xlabel("kB")
    axes[0, 0].set_ylabel("ASSD (mm)")
    axes[1, 0].set_ylabel("bending (1/mm²)")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
