import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import solids
from support.shapes import SETTINGS, ball, curves_of

from cccd.containers import Sections
from cccd.geometry.mesh import Mesh
from cccd.surface.checks import check_surface
from cccd.surface.stack import SliceStack, interpolate_slices

#: Words of the lines about a surface that lies too far from the slices.
NEAR = {"outline", "voxels"}


def is_near(violation):
    return bool(NEAR & set(violation.problem.split()))


def stack_of(mask: np.ndarray, spacing=(1.0, 1.0, 1.0)) -> SliceStack:
    return interpolate_slices(Sections(curves_of(mask, spacing)), SETTINGS)


STACK = stack_of(ball())


@pytest.fixture
def stack() -> SliceStack:
    return STACK


def sphere(stack: SliceStack, radius=20.0, centre=(30.0, 30.0, 30.0)) -> Mesh:
    """Triangles of a ball around a voxel of the volume, where the stack has it."""
    mesh = solids.sphere(radius, centre)
    return mesh.transformed(np.linalg.inv(stack.to_world))


def place_of(line: str) -> np.ndarray:
    """The place, mm, at the end of a line."""
    return np.array([float(number) for number in line[line.rindex("(") + 1 : line.rindex(")")].split(",")])


def problems(mesh: Mesh, stack: SliceStack) -> str:
    return "\n".join(violation.problem for violation in check_surface(mesh, stack))


def pulled(mesh: Mesh, factor: float) -> tuple[Mesh, np.ndarray]:
    """One vertex pulled away from the middle, or towards it."""
    vertices = mesh.vertices.copy()
    middle = vertices.mean(axis=0)
    vertices[7] = middle + factor * (vertices[7] - middle)
    return Mesh(vertices, mesh.faces), vertices[7]


def test_nothing_is_wrong_with_the_ball_that_the_slices_show(stack):
    mesh = sphere(stack, (3 / (4 * np.pi) * ball().sum()) ** (1 / 3))
    assert check_surface(mesh, stack) == []


@pytest.mark.parametrize("factor", [1.2, 1.5, 3.0])
def test_a_needle_is_found_where_it_is(stack, factor):
    mesh, tip = pulled(sphere(stack), factor)
    found = [violation for violation in check_surface(mesh, stack) if is_near(violation)]
    assert found
    ends = np.concatenate([violation.places for violation in found])
    assert np.linalg.norm(ends - tip, axis=1).min() < 1e-9
    world = ends @ stack.to_world[:3, :3].T + stack.to_world[:3, 3]
    assert np.linalg.norm(world - place_of(found[0].line(stack.to_world)), axis=1).min() < 0.1


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2561), st.floats(4.0, 30.0))
def test_no_needle_gets_through_wherever_it_is(vertex, length):
    mesh = sphere(STACK)
    vertices = mesh.vertices.copy()
    vertices[vertex] += length * mesh.vertex_normals[vertex]
    assert any(is_near(violation) for violation in check_surface(Mesh(vertices, mesh.faces), STACK))


def test_a_dent_is_found(stack):
    mesh, tip = pulled(sphere(stack), 0.3)
    (found,) = [violation for violation in check_surface(mesh, stack) if "outline" in violation.problem]
    assert np.linalg.norm(found.places[0] - tip) < 21


def test_a_missing_part_and_one_too_many_are_found(stack):
    one = sphere(stack)
    beside = sphere(stack, 3.0, (30.0, 30.0, 56.0))
    assert "has 2 parts, the slices imply 1" in problems(Mesh.joined([one, beside]), stack)
    two = stack_of(ball() | ball(centre=(8, 8, 52), radius=5.0))
    assert "has 1 part, the slices imply 2" in problems(sphere(two), two)


def test_another_volume_is_found(stack):
    assert "volume" in problems(sphere(stack, 20.3), stack)


def test_passing_through_itself_and_being_open_are_found(stack):
    one = sphere(stack)
    moved = Mesh(one.vertices + np.array([3.1, 0.7, 0.3]), one.faces)
    assert "intersects itself" in problems(Mesh.joined([one, moved]), stack)
    assert "not closed" in problems(Mesh(one.vertices, one.faces[1:]), stack)


def test_thick_slices_leave_the_surface_room_between_them():
    thick = stack_of(ball((60, 60, 12), (30, 30, 6), 20.0, (1.0, 1.0, 5.0)), (1.0, 1.0, 5.0))
    true = solids.sphere(20.0, (30.0, 30.0, 30.0)).transformed(np.linalg.inv(thick.to_world))
    assert not any(is_near(violation) for violation in check_surface(true, thick))
