import numpy as np
import pytest

from cccd.containers import Frame, Sections, Structure
from cccd.contours import trace_contours
from cccd.settings.surface import LoftSettings
from cccd.surface.loft import loft_surface
from cccd_paper.comparisons.baselines.surfaces import FAMILIES, Program
from cccd_paper.comparisons.isosurfaces import compare_isosurfaces
from cccd_paper.comparisons.point_meshes import ball_pivoting, has_open3d, poisson
from cccd_paper.comparisons.thick_slices import every_nth_slice, thick_slice_experiment
from cccd_paper.comparisons.volume_meshes import (
    antialiased_isosurface,
    distance_isosurface,
    flying_edges,
    marching_cubes,
    windowed_sinc,
)
from cccd_paper.settings import IsosurfaceSettings, ThickSliceSettings

METHODS = [
    "marching cubes",
    "flying edges + windowed sinc",
    "surface nets",
    "signed distance + isosurface",
    "signed distance + isosurface + windowed sinc",
    "paper's loft, eq. (10)",
]

#: Those that only Open3D makes.
OF_POINTS = ["ball pivoting", "Poisson", "alpha shape"]


@pytest.fixture(scope="module")
def structure():
    """An ellipsoid on a sagittal, mirrored scan: slices along the first axis."""
    index = np.stack(np.meshgrid(*map(np.arange, (18, 40, 40)), indexing="ij"), axis=-1)
    spacing = np.array([2.0, 1.0, 1.0])
    mask = np.sum((((index - (9, 20, 20)) * spacing) / (14, 15, 12)) ** 2, axis=-1) <= 1
    affine = np.diag([-2.0, 1.0, 1.0, 1.0])
    affine[:3, 3] = (50, -20, 7)
    return Structure("case", "organ", Frame(affine, 0, mask.shape), np.zeros(3, int), mask=mask)


@pytest.mark.parametrize("make", [marching_cubes, flying_edges, distance_isosurface, antialiased_isosurface])
def test_isosurfaces_lie_where_the_voxels_do(structure, make):
    mesh = make(structure)
    assert mesh.is_closed_manifold
    assert mesh.volume == pytest.approx(2.0 * structure.mask.sum(), rel=0.03)
    centre = structure.frame.affine[:3, :3] @ (9, 20, 20) + structure.frame.affine[:3, 3]
    assert mesh.vertices.mean(axis=0) == pytest.approx(centre, abs=0.05)


def test_sinc_smooths(structure):
    rough = marching_cubes(structure)
    assert windowed_sinc(rough).curvature_per_area < 0.8 * rough.curvature_per_area


@pytest.mark.skipif(not has_open3d(), reason="Open3D is not installed")
@pytest.mark.parametrize("make", [ball_pivoting, poisson])
def test_point_methods_come_near_the_ellipsoid(structure, make):
    mesh = make(trace_contours(structure))
    centre = structure.frame.affine[:3, :3] @ (9, 20, 20) + structure.frame.affine[:3, 3]
    size = np.linalg.norm((mesh.vertices - centre) / (14, 15, 12), axis=1)
    assert np.median(np.abs(size - 1)) < 0.12
    assert mesh.volume > 0


def test_one_row_per_method(structure):
    curves = trace_contours(structure)
    surface = loft_surface(Sections(curves), LoftSettings())
    table = compare_isosurfaces(
        structure, curves, surface, IsosurfaceSettings(methods=[*METHODS, *OF_POINTS]), LoftSettings()
    )
    expected = ["CCCD", *METHODS, *(OF_POINTS if has_open3d() else [])]
    assert table["method"].drop_duplicates().tolist() == expected
    tuned = table["method"].str.endswith("windowed sinc")
    assert table.loc[tuned, "chosen"].notna().all()
    assert table.loc[~tuned, "chosen"].isna().all()
    assert table["dice_3d"].between(0, 1).all()
    assert (table["seconds"] > 0).all()  # ours too
    ours = table.iloc[0]
    assert ours["closed_manifold"]
    assert ours["self_intersections"] == 0
    assert ours["mesh_bytes"] == 12 * len(surface.mesh.vertices) + 13 * len(surface.mesh.faces)


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
