import numpy as np
import pytest
from support.refusals import refusal
from support.scans import affine_of, full, load, write_nifti

from cccd.errors import InputError
from cccd.geometry.raster import dice
from cccd_segmentation import growing
from cccd_segmentation.growing import grow_region
from cccd_segmentation.seeds import Seed, parse_seeds

SHAPE = (72, 60, 24)
SPACING = np.array((1.5, 1.5, 4.0))
X, Y, Z = np.indices(SHAPE) * SPACING.reshape(3, 1, 1, 1)


def ball(i, j, k, radius):
    """Voxels of a ball, mm."""
    return np.sqrt((X - i) ** 2 + (Y - j) ** 2 + (Z - k) ** 2) < radius


ORGAN = ball(48, 45, 46, 26)
BODY = ((X - 54) / 50) ** 2 + ((Y - 45) / 42) ** 2 < 1


def scan(*tissues, noise=12.0):
    """Grey values of a body in air, of tissues (mask, value) that cover it, and of noise."""
    image = np.where(BODY, -100.0, -1000.0)
    for mask, value in tissues:
        image[mask] = value
    return (image + np.random.default_rng(0).normal(0, noise, SHAPE)).astype(np.float32)


def grown(image, seed):
    return grow_region(image, SPACING, parse_seeds(seed, "x"), 2, "x").mask


@pytest.mark.parametrize("seed", ["32,30,11", "24:30,26:34,8:12", "40,38,14"])
def test_a_neighbour_that_a_threshold_takes_along_is_left_out(seed):
    """It is little brighter than the noise is wide, and touches the organ."""
    neighbour = ball(86, 45, 46, 16)
    image = scan((neighbour, 130), (ORGAN, 105))
    assert dice(grown(image, seed), ORGAN) > 0.95


def test_a_neck_of_the_same_tissue_leads_nowhere():
    other = ball(88, 45, 46, 11)
    neck = (np.hypot(Y - 45, Z - 46) < 3.5) & (X > 48) & (X < 88)
    found = grown(scan((other | neck | ORGAN, 105)), "32,30,11")
    assert dice(found, ORGAN) > 0.95
    assert not (found & ball(88, 45, 46, 6)).any()


def test_a_wall_of_the_same_tissue_is_left_out_but_where_it_touches():
    wall = (np.abs(X - 77) < 4) & BODY
    found = grown(scan((wall | ORGAN, 105)), "32,30,11")
    assert dice(found, ORGAN) > 0.93
    assert not (found & wall & ~ball(48, 45, 46, 40)).any()


def test_a_box_shows_all_tissues_of_an_organ_and_a_voxel_one():
    core = ball(48, 45, 46, 16)
    image = scan((ORGAN, 105), (core, 205))
    assert dice(grown(image, "18:46,26:34,10:13"), ORGAN) > 0.93
    assert dice(grown(image, "32,30,11"), core) > 0.9


def test_a_vessel_inside_is_part_of_the_organ_even_where_the_seed_lies_in_it():
    vessel = np.hypot(X - 48, Y - 45) < 3.1
    image = scan((ORGAN, 105), (vessel & ORGAN, 160))
    assert dice(grown(image, "22,30,11"), ORGAN) > 0.95


def test_a_seed_for_each_part():
    left, right = ball(30, 45, 46, 17), ball(78, 45, 46, 17)
    image = scan((left | right, 60))
    assert dice(grown(image, "20,30,11; 52,30,11"), left | right) > 0.94
    assert dice(grown(image, "20,30,11"), left) > 0.94


def test_a_fine_scan_is_looked_at_in_blocks_and_answered_in_voxels(monkeypatch):
    monkeypatch.setattr(growing, "_MOST_VOXELS", ORGAN.size + 1)
    fine, organ = (part.repeat(2, axis=0).repeat(2, axis=1)[:-1] for part in (scan((ORGAN, 105)), ORGAN))
    found = grow_region(fine, SPACING / (2, 2, 1), parse_seeds("64,60,11", "x"), 2, "x").mask
    assert found.shape == fine.shape
    assert dice(found, organ) > 0.95


@pytest.mark.parametrize(
    ("seed", "words"),
    [
        ("32,30,24", "lies outside the scan, whose last voxel is 71,59,23; correct the seed"),
        ("60:80,30,11", "lies outside the scan"),
        ("1,1,11", "lies in the background"),
        ("71,30,3", "lies in the background"),
        ("32,30,11; 1,1,11", "seed 1,1,11 lies in the background"),
        (
            "31:33,29:31,16:18",
            "around seed 31:33,29:31,16:18 is of one tissue; point at the organ's even tissue",
        ),
    ],
)
def test_a_seed_that_cannot_be_meant_is_refused(tmp_path, seed, words):
    image = scan((ORGAN, 105))
    image[31:33, 29:31, 16:18] = 900
    write_nifti(tmp_path / "image.nii", image, affine_of(SPACING))
    line = refusal(load, tmp_path, image="image.nii", seed=seed)
    assert line.startswith("cohort.tsv row 2: image.nii: ")
    assert words in line


def test_a_seed_where_grey_values_vary_as_in_the_whole_scan_is_refused():
    image = scan((ORGAN, 105))
    image[50:70, 20:40, 19:22] = np.random.default_rng(1).normal(0, 3000, (20, 20, 3))
    with pytest.raises(InputError, match="vary as much as in the whole scan; point at the organ"):
        grown(image, "50:70,20:40,19:22")


def test_a_row_with_a_seed_is_a_region_with_its_image(tmp_path):
    write_nifti(tmp_path / "image.nii", scan((ORGAN, 105)), affine_of(SPACING))
    structure = load(tmp_path, image="image.nii", seed="32,30,11")
    assert structure.mask is None
    assert structure.provenance["region"]["seed"] == ["32,30,11"]
    assert any("no mask; the organ is grown from seed 32,30,11" in note for note in structure.warnings)
    structure.mask = structure.region
    assert dice(full(structure), ORGAN) > 0.95


def test_a_region_whose_border_lies_on_no_edges_is_doubtful():
    """A part of a large organ that is as grey as all around it in noise; and an organ with clear borders."""
    alike = scan((BODY, 100), (ORGAN, 104), noise=30.0)
    clear = scan((ORGAN, 205))
    (seed,) = parse_seeds("32,30,11", "x")
    assert grow_region(clear, SPACING, [seed], 2, "x").doubtful == ()
    assert grow_region(alike, SPACING, [seed], 2, "x").doubtful == (seed,)


@pytest.mark.parametrize(
    ("text", "seeds"),
    [
        ("1,2,3", [Seed((1, 2, 3), (2, 3, 4))]),
        (" 0 , 0,0 ; 7,8,9", [Seed((0, 0, 0), (1, 1, 1)), Seed((7, 8, 9), (8, 9, 10))]),
        ("1:4,2:3,5:9", [Seed((1, 2, 5), (4, 3, 9))]),
        ("1:4,2:3,5", [Seed((1, 2, 5), (4, 3, 6))]),  # a rectangle on one slice
    ],
)
def test_voxels_and_boxes(text, seeds):
    assert parse_seeds(text, "x") == seeds
    assert parse_seeds("; ".join(map(str, seeds)), "x") == seeds


@pytest.mark.parametrize("text", ["1,2", "1,2,3,4", "-1,2,3", "1.5,2,3", "a,b,c", "1,2,3;", ";", "1:2:3,4,5"])
def test_what_is_no_seed_is_refused_with_its_form(text):
    with pytest.raises(InputError, match=r"^sheet.tsv row 2: seed .* give a voxel 120,88,40 or a box"):
        parse_seeds(text, "sheet.tsv row 2")


@pytest.mark.parametrize("text", ["5:5,1,1", "1,9:3,1"])
def test_a_box_needs_voxels(text):
    assert "a box without voxels; give the larger index second" in refusal(parse_seeds, text, "x")
