"""Quadratic tetrahedra: curved along the surface, never folded, nearer to Lame's sphere than linear ones."""

from dataclasses import replace

import numpy as np
import pytest
import pyvista
from support.bars import SETTINGS, calculix, elastic, needs_calculix, two_halves
from support.solids import sphere

from cccd.geometry.distance import to_mesh
from cccd.geometry.mesh import Mesh
from cccd.settings.surface import TetrahedraSettings
from cccd_tetrahedra.build import fill_and_measure
from cccd_tetrahedra.files import WRITERS
from cccd_tetrahedra.quadratic import EDGES, curve_edges, jacobian_bounds, quadratic_volumes

pytest.importorskip("pytetwild", reason="the extra fe is not installed")

INNER, OUTER = 10.0, 20.0
MODULUS, POISSON, PRESSURE = 1000.0, 0.3, 1.0
CORNERS = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])


def filled_shell(elements):
    """Return the tetrahedra of a thick-walled sphere, whose boundaries are named inner and outer."""
    outer, inner = sphere(OUTER, subdivisions=5), sphere(INNER, subdivisions=5)
    faces = np.concatenate([outer.faces, inner.reversed().faces + len(outer.vertices)])
    shell = Mesh(np.concatenate([outer.vertices, inner.vertices]), faces)
    settings = TetrahedraSettings(edge_mm=6, tolerance_mm=0.5, elements=elements)
    filled, report = fill_and_measure({"shell": shell}, settings, {})
    far = np.linalg.norm(filled.vertices[filled.triangles].mean(axis=1), axis=1) > (INNER + OUTER) / 2
    return replace(filled, groups=far.astype(int), group_names=("inner", "outer")), report


@pytest.fixture(scope="module")
def shell():
    return filled_shell("tet10")


def test_nodes_of_the_boundary_lie_on_the_surface(shell):
    filled, report = shell
    assert (filled.nodes.shape[1], filled.face_nodes.shape[1]) == (10, 6)
    for n, radius in enumerate((INNER, OUTER)):
        nodes = np.unique(filled.face_nodes[filled.groups == n])
        away = np.linalg.norm(filled.vertices[nodes], axis=1) - radius
        on_surface = np.abs(away) < 0.005 * radius  # as far as its triangles are from the sphere
        assert on_surface.mean() > 0.95  # the others would flatten a tetrahedron; the mesher draws by chance
        assert np.abs(away).max() < 0.55  # the filling's tolerance and that of the triangles
    assert report["straight_edges"] < 0.02 * report["boundary_edges"]


def test_middle_nodes_lie_between_their_corners_and_are_shared(shell):
    filled, _ = shell
    ends = np.sort(filled.tetrahedra[:, EDGES].reshape(-1, 2), axis=1)
    pairs = {tuple(row) for row in np.column_stack([ends, filled.middles.ravel()]).tolist()}
    assert len(pairs) == len(np.unique(ends, axis=0)) == len(np.unique(filled.middles))
    start, end = (filled.vertices[np.roll(filled.triangles, -n, axis=1)] for n in range(2))
    aside = filled.vertices[filled.face_nodes[:, 3:]] - (start + end) / 2
    assert np.all(np.linalg.norm(aside, axis=2) < 0.25 * np.linalg.norm(end - start, axis=2))


def test_volume_and_jacobians(shell):
    filled, report = shell
    exact = 4 / 3 * np.pi * (OUTER**3 - INNER**3)
    assert filled.volumes.sum() == pytest.approx(exact, rel=2e-3)
    assert report["organs"]["shell"]["jacobian"]["min"] >= 0.1
    # where the bounds promise it, the Jacobian is positive: at random points, by finite differences
    rng = np.random.default_rng(1)
    at = rng.dirichlet(np.ones(4), 50)[:, 1:]
    nodes = filled.vertices[filled.nodes[::20]]
    step = 1e-6

    def placed(points):
        barycentric = np.column_stack([1 - points.sum(axis=1), points])
        shapes = np.column_stack(
            [
                barycentric * (2 * barycentric - 1),
                4 * barycentric[:, EDGES[:, 0]] * barycentric[:, EDGES[:, 1]],
            ]
        )
        return np.einsum("pn,knc->kpc", shapes, nodes)

    columns = [(placed(at + step * axis) - placed(at - step * axis)) / (2 * step) for axis in np.eye(3)]
    determinants = np.linalg.det(np.stack(columns, axis=-1))
    bounds = jacobian_bounds(nodes) * np.abs(np.linalg.det(nodes[:, 1:4] - nodes[:, :1])[:, None])
    assert np.all(determinants > bounds[:, :1] - 1e-4)
    assert np.all(determinants < bounds[:, 1:] + 1e-4)


def test_a_middle_node_that_would_fold_a_tetrahedron_stays_straight():
    """The surface bulges through a flat tetrahedron: one edge of it would pass through its far side."""
    flat = CORNERS * (10, 10, 0.3)
    ball = sphere(6.0, (5, 5, 5.05), subdivisions=4)
    curved = curve_edges(flat, np.array([(0, 1, 2, 3)]), np.array([(0, 2, 1)]), [ball])
    nodes = np.concatenate([curved.vertices[:4], curved.vertices[curved.middles[0]]])[None]
    assert jacobian_bounds(nodes)[0, 0] >= 0.1
    assert curved.straight > 0
    assert curved.vertices[4:][curved.middles[0] - 4] == pytest.approx(
        curved.vertices[:4][EDGES].mean(axis=1), abs=np.ptp(flat[EDGES])
    )


def test_the_volume_of_a_curved_tetrahedron_is_exact():
    """One edge of the unit tetrahedron bends by h: its volume grows by h times the integral of its shape."""
    nodes = np.concatenate([CORNERS, CORNERS[EDGES].mean(axis=1)])
    nodes[4] -= (0, 0, 0.1)  # the edge along x, downwards
    volume = quadratic_volumes(nodes[None])
    # the lower face z = 0 sinks by 0.1 * 4 x (1 - x - y), whose integral over it is 0.1 * 4 / 24
    assert volume == pytest.approx(1 / 6 + 0.1 / 6)


def test_organs_that_touch_share_curved_nodes_and_keep_ridges():
    organs = two_halves()
    quadratic = SETTINGS.model_copy(update={"elements": "tet10"})
    filled, report = fill_and_measure(organs, quadratic, {})
    for name in organs:
        assert report["organs"][name]["volume_ratio"] == pytest.approx(1, abs=2e-3)
        assert report["organs"][name]["jacobian"]["min"] >= 0.1
    wall = np.unique(filled.face_nodes[filled.groups == filled.group_names.index("interface_left_right")])
    assert np.abs(filled.vertices[wall, 2]).max() < SETTINGS.tolerance_mm
    ball = np.unique(filled.face_nodes[filled.groups == filled.group_names.index("interface_left_tumour")])
    assert np.abs(to_mesh(filled.vertices[ball], organs["tumour"])).max() < 0.02


def widening(filled, folder):
    """Solve with CalculiX: how far the inner radius moves outwards, without the body's rigid motion."""
    folder.mkdir()
    WRITERS["inp"](folder / "shell.inp", filled)
    outside = np.unique(filled.group("outer"))
    at = filled.vertices[outside]
    a, b, c = (outside[n] + 1 for n in (at[:, 2].argmax(), at[:, 2].argmin(), at[:, 0].argmax()))
    held = f"{a}, 1, 3\n{b}, 1, 2\n{c}, 2, 2"
    table = calculix(folder, "shell.inp", held, "INNER", PRESSURE, elastic(MODULUS, POISSON))
    points, moved = filled.vertices[table[:, 0].astype(int) - 1], table[:, 1:]
    outwards = points / np.linalg.norm(points, axis=1, keepdims=True)
    motions = [outwards, *(np.broadcast_to(axis, points.shape) for axis in np.eye(3))]
    motions += [np.cross(axis, points) for axis in np.eye(3)]
    return np.linalg.lstsq(np.stack([m.ravel() for m in motions], axis=1), moved.ravel())[0][0]


@needs_calculix
def test_a_sphere_under_pressure_widens_as_lame_says(shell, tmp_path):
    a, b = INNER, OUTER
    exact = PRESSURE * a**3 / (MODULUS * (b**3 - a**3))
    exact *= (1 - 2 * POISSON) * a + (1 + POISSON) * b**3 / (2 * a**2)
    linear = widening(filled_shell("tet4")[0], tmp_path / "tet4") / exact - 1
    quadratic = widening(shell[0], tmp_path / "tet10") / exact - 1
    assert abs(quadratic) < 0.01
    assert abs(linear) > 8 * abs(quadratic)


def test_gmsh_and_vtk_read_them(shell, tmp_path):
    filled, _ = shell
    WRITERS["vtu"](tmp_path / "shell.vtu", filled)
    grid = pyvista.read(tmp_path / "shell.vtu")
    solid = grid.extract_cells_by_type(pyvista.CellType.QUADRATIC_TETRA)
    assert solid.n_cells == len(filled.tetrahedra)
    assert solid.compute_cell_sizes()["Volume"].sum() == pytest.approx(filled.volumes.sum(), rel=0.01)
    gmsh = pytest.importorskip("gmsh")
    WRITERS["msh"](tmp_path / "shell.msh", filled)
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(tmp_path / "shell.msh"))
        tags = gmsh.model.mesh.getElementsByType(11)[0]
        assert len(tags) == len(filled.tetrahedra)
        points, weights = gmsh.model.mesh.getIntegrationPoints(11, "Gauss4")
        _, determinants, _ = gmsh.model.mesh.getJacobians(11, points)
        volume = (np.reshape(determinants, (-1, len(weights))) @ weights).sum()
        assert volume == pytest.approx(filled.volumes.sum(), rel=1e-6)
        assert min(gmsh.model.mesh.getElementQualities(tags, "minDetJac")) > 0
    finally:
        gmsh.finalize()
