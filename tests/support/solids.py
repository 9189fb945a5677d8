"""Closed meshes whose volume, area and genus are known."""

import numpy as np
import trimesh

from cccd.geometry.mesh import Mesh


def mesh_of(solid: trimesh.Trimesh, centre=(0.0, 0.0, 0.0)) -> Mesh:
    return Mesh(np.array(solid.vertices) + centre, np.array(solid.faces, np.int64))


def sphere(radius=10.0, centre=(0.0, 0.0, 0.0), subdivisions=4) -> Mesh:
    return mesh_of(trimesh.creation.icosphere(subdivisions, radius), centre)


def egg() -> trimesh.Trimesh:
    return trimesh.creation.icosphere(4, 20).apply_transform(np.diag([1, 0.8, 1.3, 1]))


def box(extents=(2.0, 3.0, 4.0)) -> Mesh:
    return mesh_of(trimesh.creation.box(extents))


def torus(major=10.0, minor=3.0) -> Mesh:
    return mesh_of(trimesh.creation.torus(major, minor, major_sections=160, minor_sections=80))
