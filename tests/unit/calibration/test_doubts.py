"""From which doubt on slices are listed: what is guaranteed holds on kinds that were not drawn."""

import numpy as np
import pytest
from scipy.special import expit

from cccd.geometry.opencv import border_pixels
from cccd_calibration.doubts import LEAST_UNLISTED, LEVELS, levels_of_shares, wrong_unlisted
from cccd_training.junctions.damages import DAMAGES
from cccd_training.junctions.random_masks import draw_mask


def kind(rng):
    """Slices of a kind of damage: it has a difficulty of its own, and doubts that are more or less off."""
    difficulty, off = rng.normal(-2, 1.5), rng.normal(0, 1)
    odds = difficulty + rng.normal(0, 2, 300)
    return expit(odds + off), rng.random(300) < expit(odds)


def test_the_share_rises_with_the_level_and_is_that_of_the_slices_below():
    rng = np.random.default_rng(1)
    for _ in range(20):
        doubt, wrong = kind(rng)
        share = wrong_unlisted(doubt, wrong)
        assert np.all(np.diff(share) >= 0)
        for n in (100, 300, 500):
            below = doubt < LEVELS[n]
            if below.mean() >= LEAST_UNLISTED:
                assert share[n] >= wrong[below].mean() - 1e-12


@pytest.mark.parametrize("share", [0.1, 0.2])
def test_of_a_further_kind_no_more_than_the_share_is_wrong_on_the_mean(share):
    rng = np.random.default_rng(2)
    found = []
    for _ in range(400):
        drawn = {str(n): kind(rng) for n in range(27)}
        level = levels_of_shares(drawn)[share]
        doubt, wrong = kind(rng)
        below = doubt < level
        found.append((below & wrong).mean() / max(below.mean(), LEAST_UNLISTED))
    assert share / 4 < np.mean(found) < share + 2 * np.std(found) / np.sqrt(len(found))


def test_a_larger_share_lists_fewer_and_few_kinds_guarantee_little():
    rng = np.random.default_rng(3)
    drawn = {str(n): kind(rng) for n in range(27)}
    levels = levels_of_shares(drawn)
    assert [*levels.values()] == sorted(levels.values())
    right = {str(n): (np.full(300, 0.01), np.zeros(300, bool)) for n in range(5)}
    assert [*levels_of_shares(right)] == [0.2, 0.3]  # (0 + 1) / (5 + 1)


@pytest.mark.parametrize("name", DAMAGES)
def test_every_damage_changes_an_outline_and_leaves_some_of_it(name):
    rng = np.random.default_rng(4)
    for _ in range(3):
        mask = draw_mask(rng)
        outline = np.zeros(mask.shape, bool)
        for contour in border_pixels(mask):
            outline[tuple(contour.T)] = True
        before = outline.copy()
        observed = DAMAGES[name](rng, mask > 0, outline)
        assert observed.dtype == bool
        assert observed.shape == mask.shape
        assert (outline == before).all()
        assert (observed != outline).any()
        near = np.count_nonzero(observed & outline)
        assert near > 0.05 * np.count_nonzero(outline)
