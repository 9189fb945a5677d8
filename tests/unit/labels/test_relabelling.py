"""A label map on other voxels: nearer to the truth than the nearest voxel, nothing twice, nothing lost."""

import nibabel
import numpy as np
import pytest

from cccd.cli import main

CENTRE, RADIUS = 31.3, 22.0


def truth(voxel, count):
    """Three sectors of a ball on voxels whose first corner is the origin."""
    x, y, z = (np.indices((count,) * 3) + 0.5) * voxel - CENTRE
    sector = 1 + np.floor((np.arctan2(y, x) + np.pi) / (2 * np.pi / 3)).astype(int).clip(0, 2)
    return np.where(np.sqrt(x * x + y * y + z * z) < RADIUS, sector, 0).astype(np.uint8)


def affine(voxel):
    found = np.diag([voxel, voxel, voxel, 1.0])
    found[:3, 3] = voxel / 2
    return found


@pytest.fixture(scope="module")
def fine(tmp_path_factory):
    folder = tmp_path_factory.mktemp("relabel")
    labels = truth(3.0, 21)
    labels[2, 2, 2] = 9  # too small for a surface
    nibabel.save(nibabel.Nifti1Image(labels, affine(3.0)), folder / "map.nii.gz")
    output = folder / "fine.nii.gz"
    assert main(["relabel", str(folder / "map.nii.gz"), "--voxel", "1", "--soft", "-o", str(output)]) == 0
    return labels, nibabel.load(output), folder


def test_voxels_cover_the_space_of_the_map(fine):
    _, found, _ = fine
    assert found.shape == (63, 63, 63)
    np.testing.assert_allclose(found.affine, affine(1.0), atol=1e-5)


def test_labels_are_nearer_to_the_truth_than_their_nearest_voxels(fine):
    labels, found, _ = fine
    new, old, true = np.asarray(found.dataobj), labels.repeat(3, 0).repeat(3, 1).repeat(3, 2), truth(1.0, 63)

    def wrong(values):
        return np.count_nonzero((values != true) & (values != 9))

    assert wrong(new) < 0.6 * wrong(old)
    for label in (1, 2, 3):
        assert np.count_nonzero(new == label) == pytest.approx(
            27 * np.count_nonzero(labels == label), rel=0.01
        )


def test_a_label_of_one_voxel_stays(fine):
    _, found, _ = fine
    new = np.asarray(found.dataobj)
    assert np.count_nonzero(new == 9) == 27
    assert (new[6:9, 6:9, 6:9] == 9).all()


def test_shares_of_a_voxel_add_up_to_no_more_than_one(fine):
    labels, _, folder = fine
    shares = [np.asarray(nibabel.load(folder / f"fine_label_{n}.nii.gz").dataobj) for n in (1, 2, 3)]
    total = np.sum(shares, axis=0)
    assert total.max() <= 1 + 1e-6
    deep = np.linalg.norm((np.indices((63,) * 3) + 0.5).T - CENTRE, axis=-1).T < RADIUS - 4
    assert (total[deep] > 1 - 1e-6).mean() > 0.999
    volume = 27 * np.count_nonzero((labels > 0) & (labels < 9))
    assert total.sum() == pytest.approx(volume, rel=0.005)


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ([], "one of --voxel and --like is needed"),
        (["--voxel", "0"], "is not positive"),
        (["--voxel", "0.0001"], "give a larger one"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(fine, options, line, refused):
    _, _, folder = fine
    assert line in refused("relabel", folder / "map.nii.gz", *options, "-o", folder / "other.nii.gz")
