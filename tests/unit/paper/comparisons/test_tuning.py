import numpy as np
import pandas as pd
import pytest

from cccd.containers import Frame, Structure
from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd_paper.comparisons.baselines.surfaces import FAMILIES
from cccd_paper.comparisons.paper_k import AS_SMOOTH, BEST, DISTANCES
from cccd_paper.comparisons.tuning import Truth, tuned_rows
from cccd_paper.comparisons.volume_meshes import has_morphological, windowed_sinc
from cccd_workflow.surface_measures import Reference

RADIUS = 12.0


def ball(radius=RADIUS) -> Mesh:
    """A sphere around the origin, in steps of half a mm."""
    axis = np.arange(-16, 16.1, 0.5)
    distance = np.linalg.norm(np.meshgrid(axis, axis, axis, indexing="ij"), axis=0) - radius
    return ScalarGrid.uniform(distance, (-16, -16, -16), 0.5).isosurface(0.0)


@pytest.fixture(scope="module")
def structure():
    """A ball of voxels, whose true surface is known."""
    index = np.indices((32, 32, 16)).astype(float)
    affine = np.diag([1.0, 1.0, 2.0, 1.0])
    affine[:3, 3] = (-16, -16, -16)
    place = np.einsum("xy,y...->x...", affine[:3, :3], index) - 16
    mask = np.linalg.norm(place, axis=0) <= RADIUS
    return Structure("case", "ball", Frame(affine, 2, mask.shape), np.zeros(3, int), mask=mask, truth=ball())


@pytest.mark.parametrize("name", FAMILIES)
def test_a_baseline_stands_at_the_best_of_its_grid(structure, name):
    if not FAMILIES[name].available():
        pytest.skip(f"what {name} needs is not installed")
    truth = Truth(Reference.of(structure))
    rows = pd.DataFrame(tuned_rows(FAMILIES[name], structure, structure, truth, ours_bends=0.2))
    best = rows[rows["chosen"].str.contains(BEST)].iloc[0]
    for _, rough, _ in FAMILIES[name].meshes(structure):
        for setting in FAMILIES[name].smoothings:
            mesh = windowed_sinc(rough, setting.rounds, setting.pass_band) if setting else rough
            away = np.abs(np.linalg.norm(mesh.sample(4000, np.random.default_rng(1)), axis=1) - RADIUS).mean()
            assert best["assd_mm"] < 1.1 * away + 0.01
    calm = rows[rows["chosen"].str.contains(AS_SMOOTH)]
    assert (calm["curvature_per_area_mm"] < 0.22).all()
    assert (calm["assd_mm"] >= best["assd_mm"] - 0.01).all()


def test_what_is_smoother_than_all_settings_leaves_the_best_alone(structure):
    truth = Truth(Reference.of(structure))
    family = FAMILIES["flying edges + windowed sinc"]
    assert [row["chosen"] for row in tuned_rows(family, structure, structure, truth, 0.001)] == [BEST]
    both = [row["chosen"] for row in tuned_rows(family, structure, structure, truth, 100.0)]
    assert both == [f"{BEST}, {AS_SMOOTH}"]


def test_morphological_interpolation_lies_where_the_voxels_do(structure):
    if not has_morphological():
        pytest.skip("needs itk-morphologicalcontourinterpolation")
    mesh = FAMILIES["morphological interpolation + windowed sinc"].shapes[""](structure)
    assert mesh.is_closed_manifold
    assert mesh.volume == pytest.approx(2.0 * structure.mask.sum(), rel=0.05)


def test_the_distances_that_we_loft_from_enclose_the_ball(structure):
    mesh = FAMILIES[DISTANCES].shapes[""](structure)
    assert mesh.is_closed_manifold
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.02)
    away = np.linalg.norm(mesh.sample(4000, np.random.default_rng(1)), axis=1) - RADIUS
    assert np.abs(away).mean() < 0.2  # a tenth of the slice distance
