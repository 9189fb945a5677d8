"""All labels of a map: the same surfaces however many processes make them, each when it is ready."""

import os

import nibabel
import numpy as np
import pytest
from scipy import ndimage

import cccd
from cccd.commands import with_name
from cccd.geometry.mesh import Mesh
from cccd_labels.all_surfaces import without_written
from cccd_labels.whole_map import WholeMap

#: Corners of cubes of 8 voxels: the first two touch, the others stand alone.
CORNERS = [(3, 3, 3), (11, 3, 3), *((i, j, 20) for i in (3, 29) for j in (3, 29))]


@pytest.fixture(scope="module")
def cubes(tmp_path_factory):
    labels = np.zeros((40, 40, 31), np.uint8)
    for number, corner in enumerate(CORNERS, 1):
        labels[tuple(slice(start, start + 8) for start in corner)] = number
    labels[38, 38, 2] = 20  # a single voxel
    path = tmp_path_factory.mktemp("cubes") / "cubes.nii.gz"
    nibabel.save(nibabel.Nifti1Image(labels, np.eye(4)), path)
    return path


def whole_map(path):
    return WholeMap.read(path, None, None, "auto", cccd.Settings())


def test_processes_change_no_byte(cubes):
    (alone, failed), (together, also_failed) = (cccd.reconstruct_labels(cubes, n_jobs=n) for n in (1, 2))
    assert [surface.name for surface in alone] == [f"label_{n}" for n in range(1, len(CORNERS) + 1)]
    assert [surface.name for surface in together] == [surface.name for surface in alone]
    for one, other in zip(alone, together, strict=True):
        assert one.vertices.tobytes() == other.vertices.tobytes()
        assert one.faces.tobytes() == other.faces.tobytes()
    assert failed == also_failed
    assert "a single voxel" in failed[0]


def test_what_touches_nothing_is_ready_at_once_and_keeps_its_spline(cubes):
    whole, events, done = whole_map(cubes), [], []
    for one in whole.surfaces(1, events.append, done.append):
        events.append(one.number)
        touching = one.number <= 2
        assert bool(one.surface.bodies) != touching
        if not touching:
            own = cccd.reconstruct(cccd.read(cubes, one.number))
            assert one.surface.vertices.tobytes() == own.vertices.tobytes()
    begun, ready = events.index(f"label_{len(CORNERS)}"), events.index(len(CORNERS) - 1)
    assert ready < begun
    assert events.index("shared walls") < events.index(1) < events.index(2)
    assert sorted(n for n in events if isinstance(n, int)) == sorted(done) == list(whole.structures)


def test_what_is_said_of_shared_walls_is_true_of_them(tmp_path):
    labels = np.zeros((48, 48, 9), np.uint8)
    offset = (np.indices(labels.shape) - np.reshape((23.6, 23.7, 4.1), (3, 1, 1, 1))).T * (1, 1, 6)
    noise = ndimage.gaussian_filter(np.random.default_rng(0).normal(size=labels.shape), (0.5, 0.5, 0))
    inside = np.linalg.norm(offset, axis=-1).T + 1.5 * noise / noise.std() < 17
    labels[inside] = 1 + (offset[..., 0].T[inside] > 2)
    path = tmp_path / "rough.nii.gz"
    nibabel.save(nibabel.Nifti1Image(labels, np.diag([1.0, 1.0, 6.0, 1.0])), path)
    surfaces, failures = cccd.reconstruct_labels(path)
    assert (len(surfaces), failures) == (2, [])
    for surface in surfaces:
        crossing = len(Mesh(surface.vertices, surface.faces).self_intersections())
        said = [line for line in surface.warnings if "intersects itself" in line]
        assert len(said) == min(crossing, 1)


def test_labels_of_one_file_share_what_was_read(cubes, monkeypatch):
    opened = []
    nibabel_load = nibabel.loadsave.load
    monkeypatch.setattr(nibabel.loadsave, "load", lambda path: (opened.append(path), nibabel_load(path))[1])
    whole = whole_map(cubes)
    assert len(opened) <= 2  # the list of its labels, and the voxels
    for number, structure in whole.structures.items():
        alone = cccd.read(cubes, number)
        np.testing.assert_array_equal(structure.mask, alone.mask)
        np.testing.assert_array_equal(structure.origin, alone.origin)
        assert (structure.provenance, structure.warnings) == (alone.provenance, alone.warnings)


def test_a_resumed_call_leaves_out_what_is_written_and_what_touches_only_that(cubes, tmp_path):
    whole, outputs = whole_map(cubes), [tmp_path / "o.stl", tmp_path / "o.ply"]
    for path in outputs:
        for organ in whole.structures.values():
            with_name(path, organ.organ).touch()
    assert without_written(whole, outputs).structures == {}
    (tmp_path / "o_label_2.stl").unlink()  # it shares a wall with the first
    os.utime(tmp_path / "o_label_5.ply", (0, 0))  # older than the map
    assert set(without_written(whole, outputs).structures) == {1, 2, 5}
