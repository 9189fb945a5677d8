"""scikit-fem solves on the tetrahedra: patch test, and a lofted bar that bends as beams do."""

import numpy as np
import pytest
from support.bars import SETTINGS, two_halves

import cccd
from cccd.settings.surface import TetrahedraSettings
from cccd_tetrahedra.filling import fill_organs

pytest.importorskip("pytetwild", reason="the extra fe is not installed")
pytest.importorskip("skfem", reason="scikit-fem is not installed")

from skfem import (
    Basis,
    ElementTetP1,
    ElementTetP2,
    ElementVector,
    FacetBasis,
    LinearForm,
    MeshTet,
    condense,
    solve,
)
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity

MODULUS, POISSON = 3.0, 0.3


def test_a_linear_displacement_is_reproduced():
    """The patch test: given on the boundary, it holds inside, through all organs and to rounding."""
    filled = fill_organs({"left": two_halves()["left"]}, SETTINGS)
    mesh = MeshTet(filled.vertices.T, filled.tetrahedra.T)
    basis = Basis(mesh, ElementVector(ElementTetP1()))
    stiffness = linear_elasticity(*lame_parameters(MODULUS, POISSON)).assemble(basis)
    gradient = np.array([[0.01, 0.02, -0.01], [0.0, -0.03, 0.02], [0.04, 0.01, 0.02]])
    expected = np.zeros(basis.N)
    expected[basis.nodal_dofs] = gradient @ filled.vertices.T
    found = solve(*condense(stiffness, x=expected, D=basis.get_dofs()))
    inner = basis.complement_dofs(basis.get_dofs())
    assert len(inner) > 30
    assert np.abs(found - expected).max() < 1e-10


def test_a_lofted_bar_bends_as_timoshenko_says():
    """The scan cuts a round bar at both ends: one is held, the other loaded across."""
    i, j = np.indices((24, 24)) - 11.5
    mask = np.repeat((i**2 + j**2 < 7.5**2)[:, :, None], 30, axis=2)
    surface = cccd.reconstruct(mask, np.diag([1.0, 1.0, 2.0, 1.0])).lofted
    settings = TetrahedraSettings(edge_mm=7.5, tolerance_mm=0.4)
    filled = fill_organs({"bar": surface.mesh}, settings, {"bar": surface.frame})
    cut = np.unique(filled.group("cut"))
    z = filled.vertices[:, 2]
    low, high = z.min(), z.max()
    assert [low, high] == pytest.approx([-1, 59], abs=0.2)
    assert set(np.round(z[cut])) == {-1, 59}
    mesh = MeshTet(filled.vertices.T, filled.tetrahedra.T).with_boundaries(
        {"held": lambda x: x[2] < low + 0.1, "loaded": lambda x: x[2] > high - 0.1}
    )
    basis = Basis(mesh, ElementVector(ElementTetP2()))
    stiffness = linear_elasticity(*lame_parameters(MODULUS, POISSON)).assemble(basis)
    end = FacetBasis(mesh, ElementVector(ElementTetP2()), facets="loaded")
    across = np.array([1.0, 0.0, 0.0])[:, None, None]
    load = LinearForm(lambda v, w: dot(across, v)).assemble(end)
    force = end.dx.sum()
    moved = solve(*condense(stiffness, load, D=basis.get_dofs("held")))
    found = moved @ load / force

    # area and second moment of the section as the tetrahedra have them
    length = high - low
    corners = filled.vertices[filled.tetrahedra]
    area = filled.volumes.sum() / length
    x = corners[:, :, 0] - np.average(corners[:, :, 0].mean(axis=1), weights=filled.volumes)
    squares = ((x**2).sum(axis=1) + x.sum(axis=1) ** 2) / 20
    moment = filled.volumes @ squares / length
    assert area == pytest.approx(np.pi * 7.5**2, rel=0.03)
    shear = MODULUS / (2 * (1 + POISSON))
    timoshenko = force * length**3 / (3 * MODULUS * moment) + force * length / (0.9 * shear * area)
    assert found == pytest.approx(timoshenko, rel=0.03)
