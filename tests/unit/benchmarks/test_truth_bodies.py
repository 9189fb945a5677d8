"""Bodies of the exact-truth benchmark: closed, turned, and their masks are theirs."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from truth_bodies import (
    CORTICAL,
    TURN_DEG,
    analytic_body,
    cortical_body,
    mesh_body,
    mesh_files,
    sample_stack,
)
from truth_measures import euler_number, open_edges, wrong_voxels

TURN = Rotation.from_euler("xyz", TURN_DEG, degrees=True)
EULER = {"ball": 2, "ellipsoid": 2, "torus": 0, "rounded box": 2, "curved sheet": 2, "hollow ball": 4}


@pytest.mark.parametrize("name", EULER)
def test_analytic_bodies_are_closed_and_lie_on_their_zero_sets(name):
    body = analytic_body(name, TURN)
    assert (open_edges(body.truth), euler_number(body.truth)) == (0, EULER[name])
    assert np.abs(body.solid(body.truth.vertices.T)).max() < 1e-3
    # the middles of the faces too: the mesh is the body, but for its chords
    middles = body.truth.vertices[body.truth.faces].mean(axis=1)
    assert np.abs(body.solid(middles.T)).mean() < 0.003


@pytest.mark.parametrize(("name", "ratio"), [("rounded box", 1), ("curved sheet", 2), ("hollow ball", 3)])
def test_a_mask_holds_the_centres_inside(name, ratio):
    body = analytic_body(name, TURN)
    mask, affine = sample_stack(body, ratio)
    assert np.allclose(np.linalg.norm(affine[:3, :3], axis=0), [1, 1, ratio])
    assert not any(mask.take(end, axis).any() for axis in range(3) for end in (0, 1, -1, -2))
    assert wrong_voxels(body.truth, mask, affine)[1] < 0.02
    assert mask.sum() * ratio == pytest.approx(body.truth.volume, rel=0.05)


def test_volumes_are_the_formulas():
    assert analytic_body("ball", TURN).truth.volume == pytest.approx(4 / 3 * np.pi * 20**3, rel=1e-3)
    assert analytic_body("torus", TURN).truth.volume == pytest.approx(2 * np.pi**2 * 20 * 49, rel=1e-3)
    # a box rounded by 3: the core, a slab on each face, quarter cylinders, a ball
    a, b, c, r = 34, 24, 16, 3
    volume = a * b * c + 2 * r * (a * b + b * c + c * a) + np.pi * r**2 * (a + b + c) + 4 / 3 * np.pi * r**3
    assert analytic_body("rounded box", TURN).truth.volume == pytest.approx(volume, rel=1e-3)


@pytest.mark.parametrize("name", CORTICAL)
def test_cortical_surfaces_are_closed_and_outwards(name):
    body = cortical_body(name, TURN)
    assert (open_edges(body.truth), euler_number(body.truth)) == (0, 2)
    assert 300_000 < body.truth.volume < 520_000


def test_a_folder_gives_its_closed_meshes(tmp_path):
    inverted = trimesh.creation.box(extents=(30, 250, 70))
    inverted.invert()
    inverted.export(tmp_path / "slab.stl")
    holed = trimesh.creation.icosphere()
    holed.update_faces(np.arange(len(holed.faces)) > 0)
    holed.export(tmp_path / "holed.ply")
    (tmp_path / "notes.txt").write_text("no mesh")
    assert [path.name for path in mesh_files(tmp_path)] == ["holed.ply", "slab.stl"]
    slab = mesh_body(tmp_path / "slab.stl", Rotation.identity())
    assert slab.truth.volume == pytest.approx(30 * 250 * 70)
    # slices cut the longest axis; a hundredth of it is 2.5 mm
    assert np.ptp(slab.truth.vertices, axis=0) == pytest.approx([30, 70, 250])
    assert slab.pixel == 2
    assert mesh_body(tmp_path / "slab.stl", Rotation.identity(), 0.5).pixel == 0.5
    with pytest.raises(ValueError, match="holed: the mesh is not closed"):
        mesh_body(tmp_path / "holed.ply", TURN)
