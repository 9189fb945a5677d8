"""What whole label maps cost, in ``docs/measured/label_maps.csv``: seconds, memory, triangles, volumes.

    python bench/label_map_costs.py FOLDER [MAP ...]

A map is a file of the folder; the others' rows stay. ``spine.nii.gz``, ``brain.nii.gz`` and ``body.nii.gz``
are made there where they are missing: 14 labels on 17 slices of 512 x 512; MNI's grey and white matter
(nilearn) in 51 parcels and 2 halves; the shared CT's 61 labels on voxels of 1 mm, the largest halved until
there are 117. The others are public: ``icrp.nii.gz`` stacks the slices AM of
DOnghiaGroup/ICRP110_HumanPhantoms_GCR (GitHub) on voxels of 2.137 x 2.137 x 8 mm, ``abdomen.nrrd`` is
``Data/seg.nrrd`` of mhalle/spl-abdominal-atlas. With ``--alone`` each organ is also made by itself, and its
ASSD to marching cubes on its voxels is compared with that of its mesh with walls.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import nibabel
import numpy as np
import pandas as pd
import pyvista
from nilearn.datasets import load_mni152_gm_template, load_mni152_wm_template
from scipy.spatial import cKDTree

import cccd
from cccd.geometry.mesh import Mesh
from cccd.settings.root import Settings
from cccd_labels.whole_map import WholeMap
from cccd_workflow.surface_measures import mask_surface, surface_distances, voxel_volume

ROOT = Path(__file__).resolve().parents[1]
TABLE = ROOT / "docs" / "measured" / "label_maps.csv"
CT = ROOT.parent / "shared" / "data" / "liver_totalseg_ct3mm" / "labels.nii.gz"
COMMAND = (sys.executable, "-c", "import sys; from cccd.cli import main; sys.exit(main())")


def spine() -> nibabel.Nifti1Image:
    """Stack vertebrae (1 to 7), discs (8 to 13) and the canal (14) in sagittal slices 4 mm apart."""
    across, y, z = np.meshgrid(
        (np.arange(17) - 8) * 4.0, *[(np.arange(512) - 256) * 0.625] * 2, indexing="ij"
    )
    across, y, z = np.abs(across), y - 15 * np.sin(z / 60), z
    labels, heights = np.zeros(y.shape, np.uint8), np.linspace(-110, 110, 7)
    for number, height in enumerate(heights, 1):
        up = np.abs(z - height)
        body = (across / 22) ** 4 + (y / 16) ** 4 + (up / 13.5) ** 4 < 1
        arch = ((across / 16) ** 2 + ((y + 26) / 12) ** 2 < 1) & (up < 8)
        spinous = (across < 5) & (np.abs(y + 50) < 14) & (np.abs(z - height + 5) < 6)
        transverse = (np.abs(y + 20) < 5) & (across < 30) & (across > 14) & (up < 6)
        labels[body | arch | spinous | transverse] = number
    for number, height in enumerate((heights[1:] + heights[:-1]) / 2, 8):
        disc = ((across / 21) ** 3 + np.abs(y / 15.5) ** 3 < 1) & (np.abs(z - height) < 8)
        labels[disc & (labels == 0)] = number
    labels[((across / 9) ** 2 + ((y + 25) / 7) ** 2 < 1) & (np.abs(z) < 125)] = 14
    return nibabel.Nifti1Image(np.moveaxis(labels, 0, 2), np.diag([0.625, 0.625, 4.0, 1.0]))


def brain() -> nibabel.Nifti1Image:
    """Part MNI's white matter in halves (1, 2) and its grey matter in 51 parcels."""
    image, white = load_mni152_gm_template(1), load_mni152_wm_template(1).get_fdata()
    grey = image.get_fdata()
    labels = np.where(np.arange(len(grey))[:, None, None] < len(grey) // 2, 1, 2).astype(np.uint8)
    labels = np.where((grey + white > 0.5) & (white > grey), labels, 0)
    within = np.argwhere((grey + white > 0.5) & (white <= grey))
    middles = within[np.random.default_rng(0).choice(len(within), 51, replace=False)]
    labels[tuple(within.T)] = 3 + cKDTree(middles).query(within)[1]
    return nibabel.Nifti1Image(labels, image.affine)


def body(fine: Path) -> nibabel.Nifti1Image:
    """Halve the largest labels of the CT on voxels of 1 mm until there are 117."""
    subprocess.run([*COMMAND, "relabel", CT, "--voxel", "1", "-o", fine], check=True)
    image = nibabel.load(fine)
    labels = np.asanyarray(image.dataobj).astype(np.uint8)
    for number in range(int(labels.max()) + 1, int(labels.max()) + 118 - len(np.unique(labels[labels > 0]))):
        voxels = np.argwhere(labels == np.argmax(np.bincount(labels[labels > 0])))
        along = voxels[:, np.argmax(np.ptp(voxels, axis=0))]
        labels[tuple(voxels[along > np.median(along)].T)] = number
    return nibabel.Nifti1Image(labels, image.affine)


def distance(mesh: Mesh, truth: Mesh) -> float:
    """ASSD in mm, of 20,000 points on each."""
    return surface_distances(mesh, truth, np.random.default_rng(0), 20_000)["assd"]


def measured(path: Path, alone: bool) -> dict[str, object]:
    """Run the command on a map in a process of its own, and look at what it wrote."""
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["surface", path, "--all-labels", "--cores", "1", "-o", Path(folder, "s.ply")]
        process = subprocess.Popen(
            [*COMMAND, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        used = os.wait4(process.pid, 0)[2]
        meshes = {file.stem.removeprefix("s_"): pyvista.read(file) for file in Path(folder).glob("*.ply")}
    whole = WholeMap.read(path, None, None, "auto", Settings())
    truth = {part.organ: voxel_volume(part) for part in whole.structures.values()}
    ratios = np.array([])
    if alone:
        truths = {part.organ: mask_surface(part) for part in whole.structures.values()}
        apart = {part.organ: cccd.reconstruct(part).lofted.mesh for part in whole.structures.values()}
        ours = {name: Mesh(mesh.points.astype(float), mesh.regular_faces) for name, mesh in meshes.items()}
        ratios = np.array([distance(ours[n], truths[n]) / distance(apart[n], truths[n]) for n in meshes])
    return {
        "map": path.name.split(".")[0],
        "labels": len(whole.labels),
        "voxels_million": round(float(np.prod(next(iter(whole.structures.values())).frame.shape)) / 1e6, 1),
        "cpu_seconds": round(used.ru_utime + used.ru_stime),
        "gigabytes": round(used.ru_maxrss / 1e6, 2),
        "organs": len(meshes),
        "closed": sum(mesh.n_open_edges == 0 for mesh in meshes.values()),
        "triangles": sum(mesh.n_cells for mesh in meshes.values()),
        "volume_off_1_percent": sum(abs(m.volume / truth[n] - 1) > 0.01 for n, m in meshes.items()),
        "assd_to_alone": round(float(np.median(ratios)), 3) if alone else "",
        "assd_above_1.02": int((ratios > 1.02).sum()) if alone else "",
    }


def main() -> None:
    """Make the maps, measure those asked for, and write their rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("maps", nargs="*", default=["spine.nii.gz", "brain.nii.gz", "body.nii.gz"])
    parser.add_argument("--alone", action="store_true")
    given = parser.parse_args()
    makers = {"spine": spine, "brain": brain, "body": lambda: body(given.folder / "fine.nii.gz")}
    rows = pd.read_csv(TABLE).set_index("map").to_dict("index") if TABLE.exists() else {}
    for name in given.maps:
        path = given.folder / name
        if not path.exists():
            nibabel.save(makers[path.name.split(".")[0]](), path)
        row = measured(path, given.alone)
        rows[row.pop("map")] = row
        pd.DataFrame.from_dict(rows, "index").rename_axis("map").to_csv(TABLE)


if __name__ == "__main__":
    main()
