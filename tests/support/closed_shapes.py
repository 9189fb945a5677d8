"""Closed meshes of known volume and genus, one by one and several in one mesh."""

import numpy as np
import trimesh

from cccd.geometry.mesh import Mesh
from support.solids import box, mesh_of, sphere, torus

__all__ = ["box", "mesh_of", "moved", "nested", "ring", "sphere", "together", "torus"]


def moved(mesh: Mesh, by) -> Mesh:
    return Mesh(mesh.vertices + np.asarray(by, float), mesh.faces)


def together(*meshes: Mesh) -> Mesh:
    return mesh_of(trimesh.util.concatenate([mesh.to_trimesh() for mesh in meshes]))


def ring() -> Mesh:
    return mesh_of(trimesh.creation.torus(8.0, 2.0, major_sections=40, minor_sections=16))


def nested() -> Mesh:
    """A shell with a body in its cavity, and a ring beside it: three bodies, one cavity."""
    balls = [sphere(radius, subdivisions=3) for radius in (10.0, 7.0, 4.0)]
    return together(balls[0], balls[1].reversed(), balls[2], moved(ring(), (30.0, 0, 0)))
