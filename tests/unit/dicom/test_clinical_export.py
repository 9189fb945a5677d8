"""What is written is read back in the same place."""

import nibabel as nib
import numpy as np
import pytest
from support.closed_shapes import box, moved, sphere, together
from support.scans import affine_of, full, load

from cccd.containers import Frame
from cccd.errors import InputError
from cccd.files import ExportOptions, write_label_map
from cccd.geometry.raster import voxelise
from cccd.surface.surface import LoftedSurface
from cccd_dicom.rtstruct import write_rtstruct


def frame_around(centre, spacing=(1.0, 1.3, 3.0), turn=(20, -30, 50), mirror=True, shape=(44, 36, 16)):
    affine = affine_of(spacing=spacing, turn=turn, mirror=mirror)
    affine[:3, 3] = centre - affine[:3, :3] @ ((np.array(shape) - 1) / 2)
    return Frame(affine, 2, shape)


def shell_mesh(centre):
    """A ball with a cavity."""
    return together(sphere(15.0, centre), sphere(7.0, centre).reversed())


def whole_grid(mesh, frame):
    return voxelise(mesh, frame.affine, frame.shape)


CENTRE = np.array((4.0, -7.0, 11.0))


def test_vertices_on_voxel_centres():
    """A box whose faces and edges pass exactly through voxel centres is still filled without streaks."""
    mask = whole_grid(moved(box((8, 6, 4)), 10), Frame(np.eye(4), 2, (20, 20, 20)))
    assert mask[7:14, 8:13, 9:12].all()  # the inner voxels
    outer = np.ones((20, 20, 20), bool)
    outer[6:15, 7:14, 8:13] = False
    assert not mask[outer].any()
    filled = mask.any(axis=(1, 2)), mask.any(axis=(0, 2)), mask.any(axis=(0, 1))
    assert mask.sum() == np.prod([line.sum() for line in filled])


def test_cavity_and_mesh_beyond_the_grid():
    frame = frame_around(CENTRE + np.array((12, 0, 0)))
    mask = whole_grid(shell_mesh(CENTRE), frame)
    world = np.stack(np.indices(frame.shape), -1) @ frame.affine[:3, :3].T + frame.affine[:3, 3]
    distance = np.linalg.norm(world - CENTRE, axis=-1)
    clear = (np.abs(distance - 15) > 0.05) & (np.abs(distance - 7) > 0.05)
    np.testing.assert_array_equal(mask[clear], ((distance < 15) & (distance > 7))[clear])
    part = voxelise(shell_mesh(CENTRE), frame.affine, (20, 22, 10), (5, 8, 3))
    np.testing.assert_array_equal(part, mask[5:25, 8:30, 3:13])


def test_label_map_is_read_back(tmp_path):
    frame = frame_around(CENTRE)
    mesh = sphere(15.0, CENTRE)
    name = "out.nii.gz"
    write_label_map(tmp_path / name, LoftedSurface([], mesh, frame), ExportOptions())
    image = nib.load(tmp_path / name)
    np.testing.assert_allclose(image.affine, frame.affine, atol=1e-5)
    structure = load(tmp_path, mask=name, label="1")
    np.testing.assert_array_equal(full(structure), whole_grid(mesh, frame))
    first = (tmp_path / name).read_bytes()
    write_label_map(tmp_path / name, LoftedSurface([], mesh, frame), ExportOptions())
    assert (tmp_path / name).read_bytes() == first


def test_rtstruct_on_any_spacing_with_holes_is_the_same_every_time(tmp_path):
    frame = frame_around(CENTRE, mirror=False)
    for name in ("rt.dcm", "again.dcm"):
        write_rtstruct(tmp_path / name, shell_mesh(CENTRE), frame, name="shell", spacing_mm=1.25)
    assert (tmp_path / "rt.dcm").read_bytes() == (tmp_path / "again.dcm").read_bytes()
    structure = load(tmp_path, mask="rt.dcm")
    curves = structure.contours
    assert structure.frame.slice_spacing == pytest.approx(1.25, abs=1e-3)
    assert curves.hole.sum() in (10, 11, 12)
    area = 0.0
    for points, hole in zip(curves, curves.hole, strict=True):
        x, y = points.T
        signed = (x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
        assert (signed < 0) == hole
        area += signed
    volume = area * structure.frame.pixel_spacing.prod() * 1.25
    assert volume == pytest.approx(4 / 3 * np.pi * (15**3 - 7**3), rel=0.01)


def test_reference_without_dicom(tmp_path):
    (tmp_path / "empty").mkdir()
    mesh = sphere(15.0, CENTRE)
    with pytest.raises(InputError, match="no DICOM images"):
        write_rtstruct(tmp_path / "a.dcm", mesh, frame_around(CENTRE), name="x", reference=tmp_path / "empty")
