"""Every method from the image to the surface."""

import numpy as np
import pytest

from cccd.comparisons.paper_k import CCCD
from cccd.comparisons.stage_times import WAYS, time_stages
from cccd.settings.boundaries import BoundarySettings
from cccd.settings.comparisons import StageTimeSettings
from cccd.settings.imports import PhantomSettings
from cccd.settings.surface import LoftSettings
from cccd.tracing import trace_mask
from cccd.volumes.phantoms import make_phantom


@pytest.fixture(scope="module")
def table():
    scan = PhantomSettings(spacing_mm=(3, 3, 6))
    liver = make_phantom("case", "liver", scan, seed=1, margin_voxels=3, location="liver")
    settings = StageTimeSettings(most_slices=4)
    return time_stages(liver, trace_mask(liver), settings, BoundarySettings(), LoftSettings(), 1.5)


def test_every_method_goes_as_far_as_its_curves_allow(table):
    assert set(table["method"]) == {way.title for way in WAYS} | {CCCD}
    assert (table["slices"] == 4).all()
    assert (table["spline_ms"].isna() == (table["closed_share"] == 0)).all()
    assert (table["surface_ms"].notna() == (table["closed_share"] > 0.25)).all()


def test_the_total_is_the_sum_of_the_stages(table):
    stages = table[["corner_ms", "curve_ms", "spline_ms", "surface_ms"]]
    np.testing.assert_allclose(table["total_ms"], stages.sum(axis=1, skipna=False))
    assert (stages.fillna(0) >= 0).all(axis=None)


def test_ours_closes_every_curve_and_comes_nearest(table):
    own = table.set_index("method").loc[CCCD]
    assert own["closed_share"] == 1
    assert own["dice_3d"] == table["dice_3d"].max() > 0.97
