import nibabel as nib
import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from cccd.file_headers import voxel_files


def scan():
    return sitk.GetImageFromArray(np.arange(24, dtype=np.int16).reshape(2, 3, 4))


@pytest.mark.parametrize(
    ("name", "compressed"), [("a.mhd", False), ("a.mhd", True), ("a.nhdr", False), ("a.nhdr", True)]
)
def test_the_file_that_a_library_writes_beside_its_header_is_found(tmp_path, name, compressed):
    sitk.WriteImage(scan(), str(tmp_path / name), useCompression=compressed)
    found = voxel_files(tmp_path / name)
    assert found == sorted(set(tmp_path.iterdir()) - {tmp_path / name})
    assert len(found) == 1


@pytest.mark.parametrize(("name", "other"), [("a.hdr", "a.img"), ("a.img", "a.hdr")])
def test_pairs_know_each_other(tmp_path, name, other):
    nib.save(nib.Nifti1Pair(np.zeros((3, 4, 5), np.int16), np.eye(4)), tmp_path / "a.img")
    assert voxel_files(tmp_path / name) == [tmp_path / other]


@pytest.mark.parametrize("name", ["a.mha", "a.nrrd", "a.nii.gz", "a.nii"])
def test_a_volume_in_one_file_has_no_other(tmp_path, name):
    sitk.WriteImage(scan(), str(tmp_path / name))
    (tmp_path / "a.raw").touch()
    assert voxel_files(tmp_path / name) == []


@pytest.mark.parametrize(
    "element", ["LIST\ns_1.raw\ns_2.raw\n", "s_%d.raw 1 2 1\n", "LIST 2\ns_1.raw\ns_2.raw\nlost.raw\n"]
)
def test_slices_in_files_of_their_own_are_found(tmp_path, element):
    for name in ("s_1.raw", "s_2.raw", "s_x.raw", "t_1.raw"):
        (tmp_path / name).touch()
    (tmp_path / "a.mhd").write_text(f"NDims = 3\nElementDataFile = {element}")
    assert voxel_files(tmp_path / "a.mhd") == [tmp_path / "s_1.raw", tmp_path / "s_2.raw"]


@pytest.mark.parametrize(
    "content",
    [b"", b"ElementDataFile = \n", b"ElementDataFile = a\0b\n", b"data file: nowhere\n", bytes(range(256))],
)
def test_damaged_headers_name_nothing(tmp_path, content):
    (tmp_path / "a.mhd").write_bytes(content)
    assert voxel_files(tmp_path / "a.mhd") == []
    assert voxel_files(tmp_path / "missing.mhd") == []


@pytest.mark.parametrize(
    "element", ["{}/far/s_1.raw", "../far/s_1.raw", "LIST\n{}/far/s_1.raw\n", "{}/far/s_%d.raw 1 1 1"]
)
def test_voxels_in_another_folder_are_found(tmp_path, element):
    for folder in ("near", "far"):
        (tmp_path / folder).mkdir()
    (tmp_path / "far" / "s_1.raw").touch()
    header = tmp_path / "near" / "a.mhd"
    header.write_text(f"NDims = 3\nElementDataFile = {element.format(tmp_path)}\n")
    (found,) = voxel_files(header)
    assert found.samefile(tmp_path / "far" / "s_1.raw")


def test_names_that_no_file_can_have_name_nothing(tmp_path):
    for value in ("x" * 5000, "/" + "y/" * 3000, "x" * 5000 + "/s_%d.raw 1 2 1", "LIST\na b\n" + "z" * 400):
        (tmp_path / "a.mhd").write_text(f"NDims = 3\nElementDataFile = {value}\n")
        assert voxel_files(tmp_path / "a.mhd") == []
