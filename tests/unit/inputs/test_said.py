"""What is doubtful about a file is said, in words that help."""

import os

import nibabel
import numpy as np
import pytest

import cccd
from cccd.errors import InputError
from cccd.inputs.load import existing
from cccd.inputs.readers import read_volume


@pytest.mark.parametrize(("apart", "said"), [(50.0, True), (0.2, False)])
def test_two_affines_that_disagree_are_said(tmp_path, apart, said):
    mask = np.zeros((8, 9, 10), np.uint8)
    mask[2:6, 2:6, 2:6] = 1
    moved = np.eye(4)
    moved[0, 3] = apart
    image = nibabel.Nifti1Image(mask, np.eye(4))
    image.set_qform(moved, 1)
    image.set_sform(np.eye(4), 1)
    nibabel.save(image, tmp_path / "mask.nii")
    notes = read_volume(tmp_path / "mask.nii").warnings
    line = "mask.nii: its sform and qform put it up to 50 mm apart; the sform is used"
    assert notes == ([line] if said else [])
    assert (line in cccd.read(tmp_path / "mask.nii").warnings) == said


@pytest.mark.parametrize(
    ("asked", "there", "hint"),
    [
        ("zero.nii.gz", "one.nii.gz", "there is no zero.nii.gz in .*; correct the path"),
        ("mask.nii.gz", "one.nii.gz", "there is no mask.nii.gz in .*; correct the path"),
    ],
)
def test_a_name_is_near_by_itself_and_not_by_its_suffix(tmp_path, asked, there, hint):
    (tmp_path / there).write_bytes(b"")
    (tmp_path / "masks").mkdir()
    with pytest.raises(InputError, match=hint):
        existing(tmp_path / asked, "mask")


def test_a_file_without_permission_says_so(tmp_path, monkeypatch):
    path = tmp_path / "mask.nii"
    path.touch(0o000)
    if os.geteuid() == 0:  # root may read everything
        monkeypatch.setattr(os, "access", lambda path, _: bool(os.stat(path).st_mode & 0o400))
    with pytest.raises(InputError, match=r"you may not read mask\.nii; change its rights"):
        cccd.read(path)
