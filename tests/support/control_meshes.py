"""Control meshes whose surfaces are known, or known in part."""

import numpy as np
import trimesh

from cccd.geometry.subdivision import SHARP, ControlMesh, quad_edges
from cccd.surface.control_mesh import split_to_quads

CORNERS = np.array([(x, y, z) for z in (-1.0, 1) for y in (-1.0, 1) for x in (-1.0, 1)])
SIDES = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])


def cube(sharpness=0.0, size=1.0):
    """A cube whose edges are all as sharp."""
    edges, _ = quad_edges(SIDES)
    edges = edges if sharpness else edges[:0]
    return ControlMesh(size * CORNERS, SIDES, edges, np.full(len(edges), float(sharpness)))


def pill():
    """A cube with sharp rims above and below: straight walls between two flat caps."""
    edges, _ = quad_edges(SIDES)
    rims = edges[CORNERS[edges[:, 0], 2] == CORNERS[edges[:, 1], 2]]
    return ControlMesh(CORNERS, SIDES, rims, np.full(8, SHARP))


def polygon_area(points):
    x, y = points.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def torus_grid(around=9, along=14):
    """Control points (around, along, 3) of a torus that is not round, both ways closed."""
    u, v = np.meshgrid(*(2 * np.pi * np.arange(n) / n for n in (around, along)), indexing="ij")
    radius = 5 + (1 + 0.3 * np.sin(2 * v)) * np.cos(u)
    return np.stack([radius * np.cos(v), radius * np.sin(v), np.sin(u) + 0.2 * np.cos(3 * v)], axis=-1)


def torus(around=9, along=14):
    """A mesh in which four quads meet everywhere."""
    at = np.arange(around * along).reshape(around, along)
    corners = [at, np.roll(at, -1, 0), np.roll(at, (-1, -1), (0, 1)), np.roll(at, -1, 1)]
    return ControlMesh(torus_grid(around, along).reshape(-1, 3), np.stack(corners, axis=-1).reshape(-1, 4))


def bumpy(subdivisions=1, flat=False, seed=0):
    """A ball with bumps, of triangles and quads that were split; ``flat`` cuts its top off, with a crease."""
    ball = trimesh.creation.icosphere(subdivisions, 10.0)
    vertices, faces = np.array(ball.vertices), np.array(ball.faces, np.int64)
    vertices *= 1 + 0.05 * np.random.default_rng(seed).normal(size=(len(vertices), 1))
    if not flat:
        points, quads, _ = split_to_quads(vertices, np.zeros((0, 4), np.int64), faces)
        return ControlMesh(points, quads)
    top = np.flatnonzero(vertices[faces].mean(axis=1)[:, 2] > 6)
    vertices[np.unique(faces[top]), 2] = 7.0
    points, quads, _ = split_to_quads(vertices, np.zeros((0, 4), np.int64), faces)
    edges, side = quad_edges(quads)
    on_top = np.tile(np.isin(np.arange(len(faces)), top), 3)
    rim = edges[np.bincount(side.ravel(), np.repeat(on_top, 4), len(edges)) == 1]
    return ControlMesh(points, quads, rim, np.full(len(rim), SHARP))


def turned(mesh, degrees=(20, 33, -50)):
    """The same in a plane that no coordinate is constant on, rounded as surfaces are."""
    from scipy.spatial.transform import Rotation

    affine = np.eye(4)
    affine[:3, :3] = Rotation.from_euler("xyz", degrees, degrees=True).as_matrix()
    return mesh.transformed(affine).rounded(1e-3)
