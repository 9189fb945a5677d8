"""Organs of a label map, each alone and with shared walls: the figures of ``docs/label_maps.md``.

    python tests/benchmarks/whole_maps.py [MAP]

Without a map it takes the brain of ``../shared/data``: voxels of 2 mm, a cortex of two voxels, and 29 Voronoi
parcels of points within that five rounds of Lloyd's algorithm have evened out. ASSD is to marching cubes on
the voxels. Overlaps and gaps are counted at points half a voxel apart, gaps where the map has labels within a
voxel to all sides.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

for library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts"), str(Path(__file__).parent)]

import nibabel  # noqa: E402
import numpy as np  # noqa: E402
from scipy import ndimage  # noqa: E402
from scipy.spatial import cKDTree  # noqa: E402

import cccd  # noqa: E402
from cccd.containers import Structure  # noqa: E402
from cccd.geometry.mesh import Mesh  # noqa: E402
from cccd.geometry.raster import voxelise  # noqa: E402
from cccd.metrics import surface_distances  # noqa: E402
from cccd.settings.root import Settings  # noqa: E402
from cccd.settings.surface import LoftSettings  # noqa: E402
from cccd.surface.measure import mask_surface, voxel_volume  # noqa: E402
from cccd_labels.shared_walls import SharedWalls, on_one_grid, share_walls  # noqa: E402
from cccd_labels.whole_map import WholeMap  # noqa: E402

BRAIN = ROOT.parent / "shared" / "data" / "brain_tcga_du7294" / "mask_brain.nii.gz"
PARCELS = 29
SAMPLES = 20_000


def parcelled_brain() -> nibabel.Nifti1Image:
    """Cut the brain into parcels (labels 1 to 29) under a cortex (30)."""
    image = nibabel.load(BRAIN)
    fine = np.asanyarray(image.dataobj) > 0
    half = [size // 2 for size in fine.shape]
    blocks = fine[tuple(slice(2 * size) for size in half)]
    brain = blocks.reshape(half[0], 2, half[1], 2, half[2], 2).mean(axis=(1, 3, 5)) >= 0.5
    parts, _ = ndimage.label(brain)
    brain = parts == np.bincount(parts[parts > 0]).argmax()
    within = np.argwhere(ndimage.binary_erosion(brain, iterations=2))
    middles = within[np.random.default_rng(0).choice(len(within), PARCELS, replace=False)].astype(float)
    for _ in range(5):
        nearest = cKDTree(middles).query(within)[1]
        middles = np.array([within[nearest == number].mean(axis=0) for number in range(PARCELS)])
    labels = np.where(brain, PARCELS + 1, 0).astype(np.uint8)
    labels[tuple(within.T)] = 1 + cKDTree(middles).query(within)[1]
    doubled = np.diag([2.0, 2.0, 2.0, 1.0])
    doubled[:3, 3] = 0.5
    return nibabel.Nifti1Image(labels, image.affine @ doubled)


def structures_of(path: Path) -> dict[int, Structure]:
    """Read every label of a map."""
    whole = WholeMap.read(path, None, None, "auto", Settings())
    print(*whole.failures, sep="\n")
    return whole.structures


def overlap_and_gap(meshes: Mapping[int, Mesh], organs: Mapping[int, Structure]) -> tuple[float, float]:
    """Volumes in ml that lie in two organs, and between organs in none."""
    structures = on_one_grid(organs).values()
    frame = next(iter(structures)).frame
    labels = np.zeros(frame.shape, bool)
    for structure in structures:
        labels |= whole(structure)
    halves = np.diag([0.5, 0.5, 0.5, 1.0])
    halves[:3, 3] = -0.25  # the first two lie in the first voxel
    affine = frame.affine @ halves
    shape = tuple(2 * size for size in frame.shape)
    count = np.zeros(shape, np.uint8)
    for mesh in meshes.values():
        count += voxelise(mesh, affine, shape)
    within = ndimage.binary_erosion(labels, ndimage.generate_binary_structure(3, 3))
    fine = np.repeat(np.repeat(np.repeat(within, 2, 0), 2, 1), 2, 2)
    ml = abs(np.linalg.det(affine[:3, :3])) / 1000
    return float((count > 1).sum() * ml), float(((count == 0) & fine).sum() * ml)


def whole(structure: Structure) -> np.ndarray:
    """Mask on the whole grid of the scan; the margin beyond it is left out."""
    found = np.zeros(structure.frame.shape, bool)
    index = np.argwhere(structure.mask) + structure.origin
    found[tuple(index.T)] = True
    return found


def distance(mesh: Mesh, truth: Mesh) -> float:
    return surface_distances(mesh, truth, np.random.default_rng(0), SAMPLES)["assd"]


def report(structures: Mapping[int, Structure], walls: SharedWalls) -> None:
    """Print what is in the table, of the organs that touch others."""
    organs = {label: structures[label] for label in walls.surface.labels}
    together = {label: walls.surface.mesh_of(label) for label in organs}
    alone = {label: cccd.reconstruct(organ).lofted.mesh for label, organ in organs.items()}
    truths = {label: mask_surface(organ) for label, organ in organs.items()}
    apart = np.array([distance(alone[label], truths[label]) for label in organs])
    shared = np.array([distance(together[label], truths[label]) for label in organs])
    ratio = shared / apart
    print(f"closed manifolds: {sum(mesh.is_closed_manifold for mesh in together.values())} of {len(organs)}")
    print(f"ASSD mm, mean: alone {apart.mean():.4f}, shared {shared.mean():.4f}")
    above = int((ratio > 1.02).sum())
    print(f"ASSD by alone: median {np.median(ratio):.3f}, largest {ratio.max():.3f}, above 1.02 {above}")
    for name, meshes in {"alone": alone, "shared": together}.items():
        volumes = np.array([voxel_volume(organ) for organ in organs.values()])
        off = np.abs(np.array([mesh.volume for mesh in meshes.values()]) / volumes - 1)
        both, none = overlap_and_gap(meshes, organs)
        print(
            f"{name}: volume off at most {off.max():.3%}, in two organs {both:.2f} ml, in none {none:.2f} ml"
        )
    total = sum(voxel_volume(organ) for organ in organs.values()) / 1000
    triangles = sum(len(mesh.faces) for mesh in alone.values())
    print(f"of {total:.0f} ml; triangles alone {triangles}, shared {len(walls.surface.triangles)}")
    print(f"triangles that pass through others: {walls.passing} pairs; pinched: {walls.pinched}")


def main() -> None:
    """Loft, share, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("map", type=Path, nargs="?")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = given.map or Path(folder, "brain.nii.gz")
        if given.map is None:
            nibabel.save(parcelled_brain(), path)
        structures = structures_of(path)
        began = time.process_time()
        walls = share_walls(structures, LoftSettings())
        gigabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        print(f"shared walls: {time.process_time() - began:.0f} CPU s, {gigabytes:.2f} GB in all")
        report(structures, walls)


if __name__ == "__main__":
    main()
