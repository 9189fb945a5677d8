import numpy as np
import pytest

from cccd.geometry.grid import ScalarGrid
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import BlendingSettings
from cccd.surface.fairing import fair, without_crossings

CELL = 0.5
PIXEL = 1.0
BRANCH, BODY = 1.0, 10.0


def ball_with_a_branch():
    """A ball of 10 mm, around the origin, that a branch of 2 mm leaves along x; exact but for the grid."""
    x, y, z = np.meshgrid(*(np.arange(-12, stop, CELL) for stop in (33, 12, 12)), indexing="ij")
    ball = np.sqrt(x * x + y * y + z * z) - BODY
    along = np.clip(x, 0, 30)
    branch = np.sqrt((x - along) ** 2 + y * y + z * z) - BRANCH
    return ScalarGrid.uniform(np.minimum(ball, branch), (-12, -12, -12), CELL).isosurface(0.0)


def radii_of_branch(mesh):
    on_branch = (mesh.vertices[:, 0] > 15) & (mesh.vertices[:, 0] < 25)
    return np.linalg.norm(mesh.vertices[on_branch, 1:], axis=1)


def radii_of_body(mesh):
    return np.linalg.norm(mesh.vertices[mesh.vertices[:, 0] < 0], axis=1)


def test_a_branch_keeps_its_radius_while_ripples_go():
    organ = ball_with_a_branch()
    noise = 0.1 * np.random.default_rng(0).standard_normal((len(organ.vertices), 1))
    rough = Mesh(organ.vertices + noise * organ.vertex_normals, organ.faces)
    settings = BlendingSettings()
    smooth = fair(rough, CELL, PIXEL, settings)
    drawn_in = fair(rough, CELL, PIXEL, settings.model_copy(update={"regain_rounds": 0}))
    assert radii_of_branch(drawn_in).mean() < 0.5 * BRANCH
    assert radii_of_branch(smooth).mean() == pytest.approx(BRANCH, rel=0.015)
    assert radii_of_body(smooth).mean() == pytest.approx(BODY, rel=0.002)
    assert radii_of_body(smooth).std() < 0.25 * radii_of_body(rough).std()


def test_what_would_pass_through_itself_stays():
    organ = ball_with_a_branch()
    at = int(np.argmax(organ.vertices[:, 0]))
    pushed = organ.vertices.copy()
    pushed[at] -= (5 * BRANCH, 3 * BRANCH, 0)  # from the tip out of the branch's side
    pushed[organ.vertices[:, 0] < 0] *= 1.01
    moved = Mesh(pushed, organ.faces)
    assert len(moved.self_intersections())
    sound = without_crossings(moved, organ)
    assert len(sound.self_intersections()) == 0
    assert np.array_equal(sound.vertices[at], organ.vertices[at])
    assert np.array_equal(sound.vertices[pushed[:, 0] < 0], pushed[pushed[:, 0] < 0])


@pytest.mark.parametrize(("height", "kept"), [(0.02, (0.0, 0.3)), (0.05, (0.0, 0.3)), (0.4, (0.8, 1.0))])
def test_low_waves_are_ripples_and_high_ones_details(height, kept):
    """Waves of three pixels on a ball, by their root mean square: steps of pixels leave such low ones."""
    points = np.stack(np.meshgrid(*[np.arange(-24, 24, CELL)] * 3, indexing="ij"))
    waves = height * np.sqrt(8) * np.prod(np.sin(2 * np.pi / 5 * points), axis=0)
    values = np.linalg.norm(points, axis=0) - 20 - waves
    rough = ScalarGrid.uniform(values, (-24, -24, -24), CELL).isosurface(0.0)
    smooth = fair(rough, CELL, PIXEL, BlendingSettings())
    before, after = (np.linalg.norm(mesh.vertices, axis=1) - 20 for mesh in (rough, smooth))
    share = before @ (after - after.mean()) / (before @ before)
    assert kept[0] <= share <= kept[1]
