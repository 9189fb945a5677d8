"""A user's ten lines, as type checkers see them, and what people have in memory."""

import re
import subprocess
import sys

import nibabel
import numpy as np
import pytest
import SimpleITK
from support import ROOT

import cccd
from cccd.inputs.in_memory import array_of

LINES = """
import nibabel
import numpy as np

import cccd

surface = cccd.reconstruct(nibabel.load("labels.nii.gz"))
even = surface.uniform(triangles=500)
reveal_type(surface)
reveal_type(even.volume)
reveal_type(surface.write("liver.stl"))
surfaces, failures = cccd.reconstruct_labels("labels.nii.gz")
reveal_type(surfaces[0].area)
cccd.reconstruct(cccd.read("labels.nii.gz", 5), affin=np.eye(4))
"""


def test_a_type_checker_sees_types_and_a_wrong_word(tmp_path):
    (tmp_path / "lines.py").write_text(LINES)
    (tmp_path / "pyrightconfig.json").write_text(
        f'{{"extraPaths": ["{ROOT / "scripts"}"], "pythonVersion": "3.11"}}'
    )
    command = [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, "--project", tmp_path]
    said = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    if "reveal_type" not in said and "information" not in said:
        pytest.skip(f"pyright does not run here: {said[-200:]}")
    assert 'Type of "surface" is "Surface"' in said
    assert 'Type of "even.volume" is "float"' in said
    assert 'is "Path"' in said
    assert 'Type of "surfaces[0].area" is "float"' in said
    assert re.search(r'No parameter named "affin".*\n1 error', said)


def ball():
    at = (np.indices((20, 20, 12)).T - (9.5, 9.5, 5.5)).T
    return (np.linalg.norm((at.T * (1, 1, 2)).T, axis=0) <= 7).astype(np.uint8)


def test_images_in_memory_bring_their_grid():
    mask, affine = ball(), np.array([[-1, 0, 0, 3], [0, -1, 0, 4], [0, 0, 2, 5], [0, 0, 0, 1]], float)
    image = SimpleITK.GetImageFromArray(mask.T)
    image.SetSpacing((1, 1, 2))
    image.SetOrigin((-3, -4, 5))
    for given in (nibabel.Nifti1Image(mask, affine), image):
        voxels, grid = array_of(given)
        np.testing.assert_array_equal(voxels, mask)
        np.testing.assert_allclose(grid, affine)
    surface = cccd.reconstruct(image)
    assert surface.volume == pytest.approx(2 * mask.sum(), rel=0.02)
    assert np.allclose(surface.mesh.center_mass, (affine @ (9.5, 9.5, 5.5, 1))[:3], atol=0.05)
    again = cccd.reconstruct(mask, spacing=(1, 1, 2))
    assert again.volume == pytest.approx(surface.volume, rel=1e-3)
    assert re.fullmatch(r"<Surface 'mask': 1\.\d+ ml, [\d. x]+ mm, \d+ triangles>", repr(again))
    assert "\n" not in repr(again)
    assert again.area == pytest.approx(again.mesh.area)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (((np.zeros((3, 3, 3)),),), "tuple is no mask"),
        ((None,), "NoneType is no mask"),
        ((np.zeros((3, 3, 3)), np.eye(4), (1, 1, 1)), "the affine has it already"),
        ((np.zeros((3, 3, 3)), None, (1, 1)), "is no three lengths"),
        ((nibabel.Nifti1Image(ball(), np.eye(4)), np.eye(4)), "a grid of its own"),
    ],
)
def test_what_is_no_mask_is_refused_in_a_line(given, words):
    with pytest.raises(cccd.InputError, match=words):
        array_of(*given)


def test_two_files_are_not_taken_for_one(tmp_path):
    surface = cccd.reconstruct(ball())
    with pytest.raises(TypeError):
        surface.write(tmp_path / "a.stl", tmp_path / "b.ply")
    assert not list(tmp_path.iterdir())
