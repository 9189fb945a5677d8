import cv2
import numpy as np
import pytest

from cccd.geometry.opencv import border_pixels
from cccd.geometry.polygons import RaggedPolygons
from cccd_datasets.corruptions import corrupt
from cccd_paper.comparisons.baselines.decoders import DECODERS
from cccd_paper.comparisons.decoders import decode
from cccd_training.junctions.scoring import score_slice

SEED = np.array([60.0, 60.0])


def organ():
    mask = np.zeros((120, 120), np.uint8)
    cv2.ellipse(mask, (60, 60), (40, 26), 20, 0, 360, 1, -1)
    cv2.circle(mask, (85, 72), 15, 1, -1)
    return mask


def run(name, drawn):
    return decode(DECODERS[name].run, np.argwhere(drawn), SEED)


@pytest.mark.parametrize("name", DECODERS)
def test_a_clean_map_is_ordered_right(name):
    chain = run(name, corrupt(np.random.default_rng(0), organ(), "clean"))
    assert score_slice([chain], border_pixels(organ())).correct


@pytest.mark.parametrize("name", DECODERS)
@pytest.mark.parametrize("kind", ["spurs", "noise", "gaps", "mixed"])
def test_the_curve_is_strictly_simple_whatever_the_map(name, kind):
    chain = run(name, corrupt(np.random.default_rng(1), organ(), kind))
    if len(chain):
        assert RaggedPolygons.of([chain]).is_simple.all()


@pytest.mark.parametrize("name", ["skeleton prune + tour + prizes", "circular shortest path (seeded)"])
def test_spurs_are_left_out(name):
    chain = run(name, corrupt(np.random.default_rng(2), organ(), "spurs"))
    assert score_slice([chain], border_pixels(organ())).dice > 0.99


@pytest.mark.parametrize(
    "name", ["watershed (seeded)", "circular shortest path (seeded)", "spanning tree, best cycle"]
)
def test_gaps_are_closed(name):
    chain = run(name, corrupt(np.random.default_rng(3), organ(), "gaps"))
    assert score_slice([chain], border_pixels(organ())).dice > 0.98


@pytest.mark.parametrize("name", DECODERS)
def test_a_map_that_encloses_nothing_gives_no_curve_that_is_not_simple(name):
    chain = decode(DECODERS[name].run, np.array([[5, 5], [5, 6], [9, 9], [12, 4]]), np.array([7.0, 6.0]))
    assert len(chain) == 0 or RaggedPolygons.of([chain]).is_simple.all()
