import pytest

from cccd.errors import InputError
from cccd_segmentation.seeds import Seed, parse_seeds


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
    with pytest.raises(InputError, match="a box without voxels; give the larger index second"):
        parse_seeds(text, "x")
