import numpy as np
import pytest

from cccd.containers import Frame, Structure
from cccd.settings.surface import LoftSettings
from cccd_paper.comparisons.baselines.surfaces import FAMILIES, Program
from cccd_paper.comparisons.thick_slices import every_nth_slice, thick_slice_experiment
from cccd_paper.settings import ThickSliceSettings


def ellipsoid(origin=(0, 0, 0)) -> Structure:
    index = np.stack(np.meshgrid(*map(np.arange, (44, 44, 50)), indexing="ij"), axis=-1)
    mask = np.sum(((index - (22, 22, 25)) / (18, 16, 21)) ** 2, axis=-1) <= 1
    frame = Frame(np.eye(4), 2, (80, 80, 90))
    return Structure("case", "organ", frame, np.array(origin), mask=mask)


@pytest.mark.parametrize("origin", [(0, 0, 0), (3, 5, 7)])
def test_kept_slices_stay_where_they_were(origin):
    structure = ellipsoid(origin)
    thick = every_nth_slice(structure, 4)
    assert thick.frame.slice_spacing == 4
    for s, plane in enumerate(thick.stack("mask")):
        k = thick.stack_origin[0] + s
        z = thick.frame.to_world(np.zeros((1, 2)), k)[0, 2]
        assert np.array_equal(plane, structure.stack("mask")[round(z) - origin[2]])


def test_the_experiment_measures_against_the_full_resolution():
    settings = ThickSliceSettings(spacings_mm=[5.0, 5.2, 40.0])
    table = thick_slice_experiment(ellipsoid(), settings, LoftSettings())
    assert table["every_nth"].unique().tolist() == [5]  # 5.2 is the same multiple, 40 leaves no shape
    assert table["method"].value_counts()["CCCD"] == 1
    assert {"flying edges + windowed sinc", "anti-aliased binary + windowed sinc"} <= set(table["method"])
    programs = [name for name, family in FAMILIES.items() if isinstance(family, Program)]
    assert (table.loc[~table["method"].isin(programs), "dice_3d"] > 0.95).all()
    ours = table["method"] == "CCCD"
    assert table.loc[ours, "closed_manifold"].all()
    assert (table["bytes"][ours] > table["control_bytes"][ours]).all()


def test_without_a_mask_there_is_nothing_to_compare():
    structure = ellipsoid()
    structure.mask = None
    assert thick_slice_experiment(structure, ThickSliceSettings(), LoftSettings()).empty
