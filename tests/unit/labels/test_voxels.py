import numpy as np
from support import solids
from support.shapes import ball

from cccd.geometry.mesh import Mesh
from cccd.inputs import structure_of_array
from cccd.settings.imports import ImportSettings
from cccd_labels.voxels import check_walls


def test_shared_walls_are_checked_by_the_organ_s_voxels():
    structure = structure_of_array(ball(), np.eye(4), ImportSettings())
    mesh = solids.sphere(20.0, (30.0, 30.0, 30.0))
    assert check_walls(mesh, structure) == []
    vertices = mesh.vertices.copy()
    vertices[0] += 20 * mesh.vertex_normals[0]  # a needle
    (line,) = check_walls(Mesh(vertices, mesh.faces), structure)
    place = [float(number) for number in line[line.rindex("(") + 1 : line.rindex(")")].split(",")]
    assert "from the organ's voxels" in line
    assert np.abs(place - vertices[0]).max() <= 0.05
