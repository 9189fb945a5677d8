"""Contours on planes that cross give the solid that they were cut from."""

import numpy as np
import pytest
import trimesh
from support import scans, solids
from support.refusals import refusal
from support.solids import mesh_of

import cccd
from cccd.cli import main
from cccd.geometry.sections import cross_sections
from cccd_meshes import crossing_planes
from cccd_meshes.crossing_planes import planes_of, surface_through
from cccd_workflow.surface_measures import surface_distances


def egg():
    return mesh_of(solids.egg())


def cut(mesh, normals, offsets):
    found = []
    for normal in np.asarray(normals, float):
        normal = normal / np.linalg.norm(normal)
        for section in cross_sections(mesh, normal, np.asarray(offsets, float)):
            found.append((normal, section))
    return [(normal, section) for normal, section in found if section]


CUTS = cut(egg(), [(1, 0, 0), (0, 1, 0), (0, 0, 1)], (-12, -6, 0, 6, 12))
SLANTED = cut(egg(), np.random.default_rng(1).normal(size=(14, 3)), (-4, 5))


def write_csl(path, cuts):
    lines = ["CSLC", f"{len(cuts)} 2", ""]
    for number, (normal, rings) in enumerate(cuts, 1):
        points = np.concatenate(rings)
        plane = (*normal, -points.mean(axis=0) @ normal)
        lines.append(" ".join(map(str, (number, len(points), len(rings), *plane))))
        lines += [" ".join(map(str, point)) for point in points]
        first = 0
        for ring in rings:
            lines.append(" ".join(map(str, (len(ring), 1, *range(first, first + len(ring))))))
            first += len(ring)
    path.write_text("\n".join(lines))


@pytest.fixture(scope="module", autouse=True)
def coarse():
    """Half the nodes along each axis."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(crossing_planes, "NODES", 64)
        yield


@pytest.fixture(scope="module", params=[CUTS, SLANTED], ids=["three directions", "in any direction"])
def through(request):
    """Cuts, their planes, and the surface through them."""
    planes = planes_of([ring for _, section in request.param for ring in section], "egg")
    return request.param, planes, surface_through(planes, "egg")


def test_the_surface_is_that_of_the_solid(through):
    cuts, planes, mesh = through
    assert len(planes) == len(cuts)
    assert mesh.is_closed_manifold
    assert mesh.genus == 0
    assert mesh.volume == pytest.approx(egg().volume, rel=0.03)
    found = surface_distances(mesh, egg(), np.random.default_rng(0), 5000)
    assert found["assd"] < 0.5


def test_on_every_plane_its_own_contours_count(through):
    _, planes, mesh = through
    for plane in planes:
        (again,) = cross_sections(mesh, plane.normal, np.array([plane.height]))
        area = [
            abs(np.einsum("nc,c->", np.cross(ring, np.roll(ring, -1, axis=0)), plane.normal)) / 2
            for ring in (again[0], plane.rings[0])
        ]
        assert area[0] == pytest.approx(area[1], rel=0.03)


def test_a_csl_file_becomes_a_surface(here, capsys, refused):
    write_csl(here / "egg.csl", SLANTED)
    assert main(["surface", "egg.csl", "-o", "egg.stl"]) == 0
    assert " ml" in capsys.readouterr().out
    assert trimesh.load("egg.stl").volume == pytest.approx(egg().volume, rel=0.03)
    write_csl(here / "parallel.csl", cut(egg(), [(0, 0, 1)], np.arange(-25, 26, 5)))
    assert cccd.smooth_mesh("parallel.csl").volume == pytest.approx(egg().volume, rel=0.01)
    (here / "broken.csl").write_text("CSLC\n3 2\n")
    assert "broken.csl" in refused("surface", "broken.csl")


def test_an_rtstruct_of_two_orientations_is_one_organ(here):
    drawn = cut(egg(), [(1, 0, 0), (0, 0, 1)], np.arange(-24, 25, 6.0))
    rings = [ring * (-1, -1, 1) for _, section in drawn for ring in section]
    scans.write_structure_set(here / "rt.dcm", {"organ": rings})
    assert main(["surface", "rt.dcm", "--label", "organ", "-o", "organ.ply"]) == 0
    assert trimesh.load("organ.ply").volume == pytest.approx(egg().volume, rel=0.03)


def test_too_few_planes_and_bent_contours_are_refused():
    planes = planes_of([ring for _, section in CUTS[:2] for ring in section], "egg")
    assert "egg: it was drawn in 2 planes" in refusal(surface_through, planes, "egg")
    bent = np.array([(0, 0, 0), (1, 0, 0.5), (1, 1, 0), (0, 1, 0.5)], float)
    assert "not planar" in refusal(planes_of, [bent], "egg")
