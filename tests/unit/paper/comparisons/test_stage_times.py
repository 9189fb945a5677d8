"""Every method from the image to the surface."""

import numpy as np
import pytest

from cccd.contours import trace_contours
from cccd.settings.junctions import BoundarySettings
from cccd.settings.surface import LoftSettings
from cccd_datasets.phantoms import make_phantom
from cccd_paper.comparisons.paper_k import CCCD
from cccd_paper.comparisons.stage_times import WAYS, _ordered_pixels, time_stages


@pytest.fixture(scope="module")
def liver():
    return make_phantom("case", "liver", (5, 5, 10), seed=1, margin_voxels=3, location="liver")


@pytest.fixture(scope="module")
def table(liver):
    return time_stages(liver, trace_contours(liver), BoundarySettings(), LoftSettings(), most_slices=3)


def test_every_method_goes_as_far_as_its_curves_allow(table):
    assert set(table["method"]) == {way.title for way in WAYS} | {CCCD}
    assert (table["slices"] == 3).all()
    assert (table["spline_ms"].isna() == (table["closed_share"] == 0)).all()
    assert (table["surface_ms"].notna() == (table["closed_share"] > 0.25)).all()


def test_the_total_is_the_sum_of_the_stages(table):
    stages = table[["corner_ms", "curve_ms", "spline_ms", "surface_ms"]]
    np.testing.assert_allclose(table["total_ms"], stages.sum(axis=1, skipna=False))
    assert (stages.fillna(0) >= 0).all(axis=None)


def test_no_method_is_given_the_half_pixel_to_the_border(liver, table):
    """Every outline runs through pixel centres, half a pixel inside the mask, ours too."""
    own = _ordered_pixels(liver, BoundarySettings(), ())
    assert not np.array_equal(own.curves.points, np.rint(own.curves.points))
    assert table["dice_3d"].max() < 0.99
