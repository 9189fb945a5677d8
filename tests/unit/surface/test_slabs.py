"""A surface made slab by slab is that of the whole, closed, and takes no more memory for more slices."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cccd.containers import Frame
from cccd.files.streamed import write_pieces
from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh
from cccd.geometry.ply import read_ply
from cccd.settings.surface import LoftSettings
from cccd.surface.slabs import find_window, loft_slabs

ROOT = Path(__file__).parents[3]
WHOLE = 1000


def made(mask, slab, spacing=(1.0, 1.0, 1.0), turned=False):
    """Surface of a mask (S, I, J) whose slices lie along z, and its parts."""
    z, y, x = spacing
    affine = np.array([[0, 0, x, 3.0], [0, -y if turned else y, 0, -7], [z, 0, 0, 11], [0, 0, 0, 1]])
    frame = Frame(affine, 0, mask.shape)

    def read(low, high):
        assert 0 <= low < high <= len(mask)
        return mask[low:high]

    window = find_window(read, len(mask), slab)
    pieces = list(loft_slabs(read, frame, window, slab, LoftSettings()))
    vertices = np.concatenate([piece.mesh.vertices[piece.fresh] for piece in pieces])
    faces = np.concatenate([piece.numbers[piece.mesh.faces] for piece in pieces])
    return Mesh(vertices, faces), pieces


def vessels(slices=90):
    """Two vessels that wind, join and part, with a bubble and a crumb."""
    k, i, j = np.indices((slices, 48, 52)).astype(float)
    way = 10 * np.sin(k / 15)
    one = np.hypot(i - 24 - way, j - 20) < 6 + np.sin(k / 7)
    two = np.hypot(i - 24 + way, j - 30) < 5
    mask = (one | two) & (k > 5) & (k < slices - 3)
    mask &= ~(np.hypot(np.hypot(i - 24 - way, j - 20), k - 40) < 2.5)
    mask[30, 3, 3] = True
    return mask


@pytest.mark.parametrize("spacing", [(1, 1, 1), (2.5, 1, 1), (0.6, 1, 0.8)], ids=["even", "thick", "thin"])
def test_slabs_join_to_the_surface_of_the_whole(spacing):
    mask = vessels()
    whole, _ = made(mask, WHOLE, spacing)
    for slab in (16, 25):
        joined, pieces = made(mask, slab, spacing)
        assert len(pieces) > 1
        assert joined.is_closed_manifold
        assert len(joined.self_intersections()) == 0
        assert joined.genus == whole.genus
        assert joined.count_bodies() == whole.count_bodies()
        for one, other in ((joined, whole), (whole, joined)):
            assert np.abs(to_mesh(one.vertices, other)).max() < 0.01 * min(spacing)


@pytest.mark.parametrize("turned", [False, True])
def test_the_volume_is_that_of_the_voxels_and_the_crumb_is_gone(turned):
    mask = vessels()
    joined, _ = made(mask, 20, turned=turned)
    assert joined.volume == pytest.approx(mask.sum(), rel=0.015)
    assert joined.count_bodies() == 1


def test_what_the_scan_cuts_ends_flat():
    _, i, j = np.indices((50, 40, 40))
    rod, _ = made(np.hypot(i - 19.5, j - 19.5) < 9, 16)
    assert rod.is_closed_manifold
    heights = rod.vertices[:, 2] - 11
    assert (heights.min(), heights.max()) == pytest.approx((-0.5, 49.5), abs=1e-4)
    assert rod.volume == pytest.approx(np.pi * 81 * 50, rel=0.02)


def test_organs_apart_by_empty_slabs_stay_apart():
    k, i, j = np.indices((120, 40, 40))
    balls = [np.hypot(np.hypot(i - 20, j - 20), k - at) < 8 for at in (15, 95)]
    joined, pieces = made(balls[0] | balls[1], 16)
    assert joined.is_closed_manifold
    assert joined.count_bodies() == 2
    assert len(pieces) < 8


def test_files_hold_the_parts_as_one(tmp_path):
    joined, pieces = made(vessels(), 20)
    paths = [tmp_path / "a.ply", tmp_path / "a.stl"]
    written = write_pieces(paths, pieces)
    read = read_ply(paths[0])
    np.testing.assert_array_equal(read.vertices, joined.vertices)
    np.testing.assert_array_equal(read.faces, joined.faces)
    assert written.triangles == len(joined.faces)
    assert written.volume == pytest.approx(joined.volume)
    trimesh = pytest.importorskip("trimesh")
    solid = trimesh.load(paths[1])
    assert solid.is_watertight
    assert solid.volume == pytest.approx(joined.volume, rel=1e-5)


PEAK = """
import resource, sys, numpy as np
from pathlib import Path
from cccd.containers import Frame
from cccd.files.streamed import write_pieces
from cccd.settings.surface import LoftSettings
from cccd.surface.slabs import find_window, loft_slabs

slices, folder = int(sys.argv[1]), Path(sys.argv[2])
i, j = np.indices((160, 160))

def read(low, high):
    k = np.arange(low, high)[:, None, None]
    return np.hypot(i - 80 - 30 * np.sin(k / 40), j - 80) < 30 + 5 * np.cos(k / 9)

frame = Frame(np.eye(4)[[2, 1, 0, 3]], 0, (slices, 160, 160))
window = find_window(read, slices, 32)
write_pieces([folder / "a.ply"], loft_slabs(read, frame, window, 32, LoftSettings()))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def test_memory_does_not_grow_with_the_slices(tmp_path):
    peaks = []
    for slices in (100, 300):
        run = subprocess.run(
            [sys.executable, "-c", PEAK, str(slices), str(tmp_path)],
            env={"PYTHONPATH": str(ROOT / "scripts"), "OMP_NUM_THREADS": "1"},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        peaks.append(float(run.stdout))
    assert max(peaks) < 1.1 * peaks[0], peaks
