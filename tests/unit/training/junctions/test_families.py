import numpy as np
import pytest

from cccd.geometry.opencv import distance_to_zero
from cccd_training.junctions.damages import DAMAGES
from cccd_training.junctions.families import DETECTORS, FAMILIES
from cccd_training.junctions.synthetic_maps import ALL_KINDS, draw_map, truth_mask


def disc(radius=25, size=96):
    i, j = np.indices((size, size)) - size / 2 + 0.5
    return (np.hypot(i, j) < radius).astype(np.uint8)


def drawn(family, count=12, stream=0):
    return [draw_map(np.random.default_rng([stream, n]), family) for n in range(count)]


def beside(drawn_map, reach):
    """Shares of the true border with a pixel of the map so near by, and of these near the border."""
    observed, border = (np.ones(drawn_map.shape, np.uint8) for _ in range(2))
    observed[tuple(drawn_map.pixels.T)] = 0
    for contour in drawn_map.contours:
        border[tuple(contour.T)] = 0
    return [
        (distance_to_zero(away)[of == 0] <= reach).mean()
        for away, of in ((observed, border), (border, observed))
    ]


@pytest.mark.parametrize("family", [*FAMILIES, *ALL_KINDS])
def test_a_seed_gives_the_same_map_and_another_seed_another(family):
    for one, same, other in zip(drawn(family, 4), drawn(family, 4), drawn(family, 4, 1), strict=True):
        assert np.array_equal(one.pixels, same.pixels)
        assert all(map(np.array_equal, one.contours, same.contours))
        assert (one.image is None) == (same.image is None)
        assert one.image is None or np.array_equal(one.image, same.image)
        assert not np.array_equal(one.pixels, other.pixels)


@pytest.mark.parametrize("family", FAMILIES)
def test_maps_show_most_of_the_border_and_never_just_the_border(family):
    for one in drawn(family):
        shown, _ = beside(one, 2.0)
        assert shown >= 0.75
        true = {tuple(pixel) for contour in one.contours for pixel in contour.tolist()}
        assert {tuple(pixel) for pixel in one.pixels.tolist()} != true
        assert one.kind == family
        assert truth_mask(one).sum() >= 25


@pytest.mark.parametrize("family", ["label_maps", "detectors"])
def test_edges_of_images_come_with_a_finite_image_and_stay_in_the_band(family):
    for one in drawn(family):
        assert one.image is not None
        assert one.image.shape == one.shape
        assert np.isfinite(one.image).all()
        # nine pixels, and the corner of the widest square kernel around them
        assert beside(one, 9 * np.sqrt(2) + 1)[1] == 1


@pytest.mark.parametrize("detector", DETECTORS)
def test_every_detector_finds_the_edge_of_a_bright_disc(detector):
    mask = disc()
    true = truth_border(mask)
    found_shares = []
    for n in range(10):
        rng = np.random.default_rng(n)
        image = (mask + 0.02 * rng.standard_normal(mask.shape)).astype(np.float32)
        found = DETECTORS[detector](rng, image)
        assert found.shape == mask.shape
        assert found.dtype == bool
        away = distance_to_zero((~found).astype(np.uint8))
        found_shares.append((away[true] <= 2).mean())
    assert np.median(found_shares) > 0.95


def truth_border(mask):
    near = distance_to_zero(mask)
    return (near > 0) & (near <= 1)


def test_label_maps_have_random_contrasts():
    mask = disc()
    brighter = []
    for n in range(40):
        _, image = FAMILIES["label_maps"](np.random.default_rng(n), mask)
        depth = distance_to_zero(mask)
        brighter.append(image[(depth > 1) & (depth < 5)].mean() > image[mask == 0].mean())
    # darker as often as brighter: 40 tosses of a coin
    assert 10 <= sum(brighter) <= 30


def test_no_family_is_a_kind_of_damage_or_one_that_is_kept_unseen():
    assert not {*FAMILIES} & {*ALL_KINDS, *DAMAGES}
