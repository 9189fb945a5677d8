"""Time and memory of the whole lofting beside signed distance, isosurface and windowed sinc.

    python bench/lofting.py [--every N] [MASK ...]

Masks are files that ``cccd surface`` reads; without any it takes the MNI brain at 1 mm, every fifth slice
of it, and phantom lungs and a kidney. Both methods get the same stack and start from the mask, ours by
tracing it and fitting its splines. Processor time is the least of three runs, memory the peak above what
the process held before.
"""

import argparse
import os
import sys
from pathlib import Path

for library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "scripts"), str(Path(__file__).parent)]

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from run import machine, measure  # noqa: E402

import cccd  # noqa: E402
from cccd.containers import Structure  # noqa: E402
from cccd.inputs import load_structure  # noqa: E402
from cccd.settings.imports import ImportSettings  # noqa: E402
from cccd_paper.comparisons.thick_slices import every_nth_slice  # noqa: E402
from cccd_paper.comparisons.volume_meshes import distance_isosurface, windowed_sinc  # noqa: E402

#: Phantoms and their voxel sizes in mm: 390 x 512 pixels and 61 slices, about; and 600 slices.
PHANTOMS = {"lungs": (0.7, 0.7, 5.0), "kidney": (1.0, 1.0, 0.2)}


def default_structures() -> dict[str, Structure]:
    """Structures that need no file of the user's."""
    empty = dict.fromkeys(("image", "mask", "boundary", "label", "location"), "") | {"case": "bench"}
    brain = load_structure(empty | {"organ": "brain", "source": "mni152"}, Path(), ImportSettings(), seed=0)
    structures = {"MNI brain": brain, "MNI brain, every 5th slice": every_nth_slice(brain, 5)}
    for organ, spacing in PHANTOMS.items():
        settings = ImportSettings.model_validate({"phantom": {"spacing_mm": spacing}})
        row = empty | {"organ": organ, "source": "phantom", "location": organ}
        structures[f"phantom {organ}"] = load_structure(row, Path(), settings, seed=0)
    return structures


def from_file(path: Path, every: int) -> Structure:
    """Read a mask, and keep every n-th slice of it."""
    read = cccd.read(path)
    return every_nth_slice(read, every) if every > 1 else read


def compare(name: str, structure: Structure) -> dict:
    """Time both methods on one structure."""
    mask, affine = structure.mask, structure.frame.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ structure.origin
    seconds, peak = measure(lambda: cccd.reconstruct(mask, affine))
    peer_seconds, peer_peak = measure(lambda: windowed_sinc(distance_isosurface(structure)))
    shape = " x ".join(map(str, np.array(structure.stack("mask").shape)[[1, 2, 0]]))
    row = {"structure": name, "voxels": shape}
    row |= {"seconds": seconds, "peer_seconds": peer_seconds, "times": seconds / peer_seconds}
    return row | {"peak_mb": peak, "peer_peak_mb": peer_peak, "memory": peak / peer_peak}


def main() -> None:
    """Read the command line, run, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("masks", nargs="*", type=Path, metavar="MASK")
    parser.add_argument("--every", type=int, default=1, help="keep every n-th slice of the files' masks")
    arguments = parser.parse_args()
    named = {path.name: from_file(path, arguments.every) for path in arguments.masks}
    structures = named or default_structures()
    cccd.reconstruct(np.pad(np.ones((8, 8, 4), bool), 2), np.eye(4))  # compiles
    table = pd.DataFrame([compare(name, structure) for name, structure in structures.items()])
    print(machine())
    print(table.to_string(index=False, float_format="%.3g"))


if __name__ == "__main__":
    main()
