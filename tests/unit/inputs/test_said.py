"""What is doubtful about a file is said, in words that help."""

import os
import re

import nibabel
import numpy as np
import pytest

import cccd
from cccd.errors import InputError
from cccd.inputs.labels import choose_labels
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


@pytest.mark.parametrize("asked", ["zero.nii.gz", "mask.nii.gz"])
def test_a_name_is_near_by_itself_and_not_by_its_suffix(tmp_path, asked):
    (tmp_path / "one.nii.gz").write_bytes(b"")
    (tmp_path / "masks").mkdir()
    with pytest.raises(InputError, match=f"there is no {asked} in .*; correct the path"):
        existing(tmp_path / asked, "mask")


@pytest.mark.parametrize(("asked", "hint"), [("splen", "did you mean 'spleen'?"), ("9", "choose one of 5 ")])
def test_a_label_is_near_the_name_of_another(asked, hint):
    with pytest.raises(InputError, match=f"it has no label '{asked}'; {re.escape(hint)}"):
        choose_labels({5: "liver", 7: "spleen", 8: ""}, asked, "organ", "scan.nii", "label")


def test_a_file_without_permission_says_so(tmp_path, monkeypatch):
    path = tmp_path / "mask.nii"
    path.touch(0o000)
    if os.geteuid() == 0:  # root may read everything
        monkeypatch.setattr(os, "access", lambda path, _: bool(os.stat(path).st_mode & 0o400))
    with pytest.raises(InputError, match=r"you may not read mask\.nii; change its rights"):
        cccd.read(path)
