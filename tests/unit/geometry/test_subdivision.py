"""Catmull-Clark surfaces beside other implementations of the same surface, and beside what they must be."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree
from support.control_meshes import CORNERS, SIDES, torus_grid

from cccd.geometry.subdivision import SHARP, ControlMesh, quad_edges

CUBE = ControlMesh(CORNERS, SIDES)
CUBE_EDGES, _ = quad_edges(SIDES)


def with_creases(sharpness):
    return ControlMesh(CORNERS, SIDES, CUBE_EDGES, np.full(12, float(sharpness)))


def quads_of(shape):
    at = np.arange(shape[0] * shape[1]).reshape(shape)
    corners = [at, np.roll(at, -1, 1), np.roll(at, (-1, -1), (0, 1)), np.roll(at, -1, 0)]
    return np.stack(corners, axis=-1).reshape(-1, 4)


def periodic(points, degree=3):
    """SciPy's closed uniform spline along the first axis; the parameter 0 is at the first control point."""
    wrapped = np.concatenate([points[-1:], points, points[: degree - 1]])
    return BSpline(np.arange(len(wrapped) + degree + 1) - degree, wrapped, degree)


@pytest.mark.parametrize("times", [0, 1, 2, 3])
def test_a_regular_mesh_is_scipys_bicubic_periodic_spline(times):
    grid = torus_grid()
    mesh = ControlMesh(grid.reshape(-1, 3), quads_of(grid.shape[:2]))
    found = mesh.tessellate(times).vertices
    step = 2.0**-times
    u, v = (np.arange(0, n, step) for n in grid.shape[:2])
    across = periodic(grid)(u)  # (U, along, 3)
    wanted = periodic(across.transpose(1, 0, 2))(v).reshape(-1, 3)
    assert len(found) == len(wanted)
    assert cKDTree(wanted).query(found)[0].max() < 1e-12
    assert cKDTree(found).query(wanted)[0].max() < 1e-12


def plain_subdivided(vertices, quads, sharpness):
    """One step of Catmull, Clark and DeRose's rules in plain loops; sharpness by edge (low, high)."""
    edges_of, quads_at = {}, {n: [] for n in range(len(vertices))}
    for number, quad in enumerate(quads):
        for one, other in zip(quad, np.roll(quad, -1), strict=True):
            edges_of.setdefault((min(one, other), max(one, other)), []).append(number)
            quads_at[one].append(number)
    centres = [vertices[quad].mean(axis=0) for quad in quads]
    points, place = [], {}
    for vertex, position in enumerate(vertices):
        mine = [edge for edge in edges_of if vertex in edge]
        sharp = [edge for edge in mine if sharpness.get(edge, 0) > 0]
        n = len(mine)
        face = np.mean([centres[number] for number in quads_at[vertex]], axis=0)
        middle = np.mean([(vertices[a] + vertices[b]) / 2 for a, b in mine], axis=0)
        smooth = (face + 2 * middle + (n - 3) * position) / n
        if len(sharp) < 2:
            points.append(smooth)
            continue
        rule = position
        if len(sharp) == 2:
            rule = 0.75 * position + sum(vertices[sum(edge) - vertex] for edge in sharp) / 8
        share = np.mean([min(sharpness[edge], 1) for edge in sharp])
        points.append((1 - share) * smooth + share * rule)
    for edge, beside in edges_of.items():
        place[edge] = len(points)
        middle = (vertices[edge[0]] + vertices[edge[1]]) / 2
        smooth = (2 * middle + centres[beside[0]] + centres[beside[1]]) / 4
        share = min(sharpness.get(edge, 0), 1)
        points.append((1 - share) * smooth + share * middle)
    finer, blunter = [], {}
    for number, quad in enumerate(quads):
        on = [place[min(a, b), max(a, b)] for a, b in zip(quad, np.roll(quad, -1), strict=True)]
        finer += [(quad[k], on[k], len(points) + number, on[k - 1]) for k in range(4)]
    for (low, high), sharp in sharpness.items():
        left = sharp if sharp >= SHARP else sharp - 1
        if left > 0:
            blunter |= {(end, place[low, high]): left for end in (low, high)}
    return np.array([*points, *centres]), np.array(finer), blunter


@pytest.mark.parametrize("sharpness", [0.0, 0.4, 1.0, 1.7, SHARP])
def test_steps_and_limits_are_those_of_plain_loops(sharpness):
    """On a cube's corners three quads meet; the edges around one side are sharp."""
    sharp = np.array([(0, 2), (2, 3), (1, 3), (0, 1)][: 4 if sharpness else 0]).reshape(-1, 2)
    mesh = ControlMesh(CORNERS * (1, 2, 3), SIDES, sharp, np.full(len(sharp), sharpness))
    vertices, quads = mesh.vertices, mesh.quads
    by_edge = {tuple(edge): sharpness for edge in sharp.tolist()}
    for times in range(1, 5):
        vertices, quads, by_edge = plain_subdivided(vertices, quads, by_edge)
        ours = mesh.subdivided(times).vertices
        assert len(ours) == len(vertices)
        away, nearest = cKDTree(vertices).query(ours)
        assert away.max() < 1e-9
        assert len(np.unique(nearest)) == len(vertices)
    limit = mesh.tessellate(1).vertices  # those of the control points come first, in plain loops as well
    assert limit[: len(CORNERS)] == pytest.approx(vertices[: len(CORNERS)], abs=0.02)


def test_where_the_affine_mirrors_the_outer_side_stays_outside():
    mirror = np.diag([-1.0, 2.0, 1.0, 1.0])
    mirror[:3, 3] = (3, 4, 5)
    for mesh in (CUBE, with_creases(SHARP)):
        moved = mesh.transformed(mirror)
        assert moved.sign == 1
        assert moved.tessellate(2).volume == pytest.approx(2 * mesh.tessellate(2).volume)
        wanted = mesh.tessellate(0).vertices @ mirror[:3, :3].T + mirror[:3, 3]
        assert moved.tessellate(0).vertices == pytest.approx(wanted)


def test_a_cavity_is_turned_inside_out_and_comes_apart_from_its_body():
    both = ControlMesh(
        np.concatenate([3 * CORNERS, CORNERS]),
        np.concatenate([SIDES, SIDES[:, ::-1] + 8]),
        CUBE_EDGES + 8,
        np.full(12, SHARP),
    )
    body, cavity = both.pieces()
    assert (body.sign, cavity.sign) == (1, -1)
    assert (len(body.creases), len(cavity.creases)) == (0, 12)
    assert cavity.tessellate(2).volume == pytest.approx(-8)


@pytest.mark.parametrize("tolerance", [0.5, 0.01, 0.0013])
def test_rounding_moves_by_at_most_the_tolerance_and_once(tolerance):
    mesh = ControlMesh(np.random.default_rng(0).normal(0, 90, (8, 3)), SIDES)
    rounded = mesh.rounded(tolerance)
    assert 0 < np.abs(rounded.vertices - mesh.vertices).max() <= tolerance
    assert np.array_equal(rounded.rounded(tolerance).vertices, rounded.vertices)
    assert not np.signbit(rounded.vertices[rounded.vertices == 0]).any()
