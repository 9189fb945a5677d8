"""Tubes of known length, radius, curvature and angles are measured as they are, without a branch too many."""

import csv
import functools

import numpy as np
import pytest
import pyvista
import trimesh
from support.scans import DATA
from support.solids import mesh_of
from support.tubes import Tube, helix, straight, turned, voxels

import cccd
from cccd.cli import main
from cccd.errors import InputError
from cccd.geometry.mesh import Mesh
from cccd.inputs.nifti_export import write_nifti
from cccd_vessels.centrelines import find_centrelines
from cccd_vessels.files import describe, write_centrelines

FINE, THICK = (1.0, 1.0, 1.0), (1.0, 1.0, 3.0)
AIRWAY = DATA / "airway_lidc_1mm" / "mask_airway.nii.gz"


def mesh_of_tubes(tubes, spacing=FINE):
    mask, affine = voxels(tubes, spacing)
    return cccd.reconstruct(mask, affine).lofted.mesh


def lines_of(tubes, spacing):
    return find_centrelines(mesh_of_tubes(tubes, spacing), min(spacing))


def fork(radius=6.0, daughters=4.5, angles=(30, -40)):
    at = np.array((0.0, 0, 40))
    arms = [straight(at, at + 35 * turned(angle), daughters, flat=False) for angle in angles]
    return [straight((0, 0, 0), at, radius, flat=False), *arms]


def near(value, true, voxel):
    """Within a tenth of a voxel, or 3 %."""
    return abs(value - true) <= max(0.1 * voxel, 0.03 * true)


@functools.cache
def lines_of_helix(spacing):
    return lines_of([helix()], spacing)


@functools.cache
def mesh_of_fork(spacing):
    return mesh_of_tubes(fork(), spacing)


@functools.cache
def lines_of_fork(spacing):
    return find_centrelines(mesh_of_fork(spacing), min(spacing))


# a flat end lies somewhere between two slices: its place is known to half their distance
@pytest.mark.parametrize("spacing", [FINE, THICK])
@pytest.mark.parametrize("shape", ["straight", "helix"])
def test_one_tube_is_one_branch_of_its_length_and_radius(shape, spacing):
    tube, radius = (helix(), 4.0) if shape == "helix" else (straight((0, 0, 0), (10, 6, 60), 5.0), 5.0)
    found = lines_of_helix(spacing) if shape == "helix" else lines_of([tube], spacing)
    (branch,) = found.branches
    assert abs(branch.length - tube.length) < 0.01 * tube.length + spacing[2] / 4
    assert near(branch.mean_radius, radius, spacing[0])
    assert (branch.start, branch.end, branch.parent, found.loops) == ("end", "end", 0, 0)
    assert branch.measured.mean() > 0.7


def test_a_helix_has_its_curvature_and_tortuosity():
    tube = helix()
    (branch,) = lines_of_helix(FINE).branches
    slope = 30 / (2 * np.pi)
    assert np.median(branch.curvature[branch.measured]) == pytest.approx(18 / (18**2 + slope**2), rel=0.05)
    chord = np.linalg.norm(tube.curve[-1] - tube.curve[0])
    # its last radius is straight, and so ends outside the helix by radius^2 / (2 * 18)
    assert branch.tortuosity == pytest.approx(tube.length / chord, rel=0.035)


@pytest.mark.parametrize("spacing", [FINE, THICK])
def test_a_tapering_tube_tapers(spacing):
    (branch,) = lines_of(
        [Tube(np.linspace((0, 0, 0), (5, 3, 80), 50), np.linspace(8, 3, 50))], spacing
    ).branches
    assert branch.points[0, 2] < branch.points[-1, 2]  # the widest end is the root
    axis = np.array((5, 3, 80))
    true = 8 - 5 * branch.points @ axis / (axis @ axis)  # by place: the found ends are not the tube's
    off = np.abs(branch.radius - true)[branch.measured]
    assert np.all(off < np.maximum(0.15 * spacing[0], 0.05 * true[branch.measured]))


@pytest.mark.parametrize("spacing", [FINE, THICK])
def test_a_fork_has_three_branches_of_known_angles(spacing):
    found = lines_of_fork(spacing)
    root, *arms = found.branches
    assert [branch.parent for branch in found.branches] == [0, 1, 1]
    assert [branch.generation for branch in found.branches] == [0, 1, 1]
    assert sorted(arm.angle_deg for arm in arms) == pytest.approx([30, 40], abs=3)
    assert np.linalg.norm(root.points[-1] - (0, 0, 40)) < 0.5
    assert near(root.mean_radius, 6.0, spacing[0])
    for arm in arms:
        np.testing.assert_array_equal(arm.points[0], root.points[-1])
        assert near(arm.mean_radius, 4.5, spacing[0])
        # to the top of its round end
        assert arm.length == pytest.approx(35 + 4.5, rel=0.01)


def test_three_generations_on_thick_slices_have_seven_branches():
    tubes = [straight((0, 0, 0), (0, 0, 60), 7, flat=False)]

    def grow(start, way, side, generation):
        length, radius = ((40, 5.0), (28, 3.6))[generation - 1]
        for sign in (1, -1):
            onwards = np.cos(np.radians(35)) * way + sign * np.sin(np.radians(35)) * side
            tubes.append(straight(start, start + length * onwards, radius, flat=False))
            if generation == 1:
                grow(start + length * onwards, onwards, np.cross(way, side), 2)

    grow(np.array((0, 0, 60.0)), np.array((0, 0, 1.0)), np.array((1.0, 0, 0)), 1)
    found = lines_of(tubes, THICK)
    assert [branch.generation for branch in found.branches] == [0, 1, 1, 2, 2, 2, 2]
    assert sorted(branch.parent for branch in found.branches) == [0, 1, 1, 2, 2, 3, 3]
    for branch, radius in zip(found.branches, [7, 5, 5, *4 * [3.6]], strict=True):
        assert near(branch.mean_radius, radius, THICK[0])
        if branch.parent:
            assert branch.angle_deg == pytest.approx(35, abs=3)
    for branch in found.branches[1:3]:
        assert branch.length == pytest.approx(40, abs=THICK[2] / 6)


def test_a_flat_vein_is_one_branch_with_its_two_diameters():
    i, j, k = np.indices((60, 40, 70)).astype(float)
    mask = (((i - 30) / 16) ** 2 + ((j - 20) / 6) ** 2 <= 1) & (k > 4) & (k < 65)
    (branch,) = find_centrelines(cccd.reconstruct(mask).lofted.mesh, 1.0).branches
    assert branch.mean_radius == pytest.approx(np.sqrt(16 * 6), rel=0.03)
    assert np.nanmedian(branch.least_diameter) == pytest.approx(12, rel=0.04)
    assert np.nanmedian(branch.largest_diameter) == pytest.approx(32, rel=0.04)


def test_the_root_is_the_end_that_is_named():
    found = find_centrelines(mesh_of_fork(FINE), 1.0, root=(19, 0, 74))
    root = found.branches[0]
    assert np.linalg.norm(root.points[0] - (19.6, 0, 74.2)) < 1
    assert root.angle_deg != root.angle_deg
    assert sorted(branch.angle_deg for branch in found.branches[1:]) == pytest.approx([30, 110], abs=3)


def test_a_ring_is_reported_as_a_loop():
    angle = np.linspace(0, 2 * np.pi, 1000)
    ring = Tube(18 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]), 5.0, flat=False)
    found = lines_of([ring], FINE)
    (branch,) = found.branches
    assert (branch.start, branch.end, found.loops) == ("loop", "loop", 1)
    assert branch.length == pytest.approx(2 * np.pi * 18, rel=0.01)
    assert np.median(branch.curvature) == pytest.approx(1 / 18, rel=0.03)
    assert "1 loop" in found.notes[0]
    assert describe(branch)["tortuosity"] is None


def test_what_is_no_tube_is_refused_and_a_lone_piece_left_out():
    ball = trimesh.creation.icosphere(4, 12.0)
    tube = trimesh.creation.cylinder(3.0, 50.0, sections=48)
    tube.apply_translation((40, 0, 0))
    with pytest.raises(InputError, match=r"no tube in it.*give a vessel"):
        find_centrelines(mesh_of(ball), 1.0)
    both = trimesh.util.concatenate([ball, tube])
    found = find_centrelines(mesh_of(both), 1.0)
    assert [round(branch.length) for branch in found.branches] == [50]
    assert "1 piece" in found.notes[0]


@pytest.fixture(scope="module")
def forked():
    return lines_of_fork(FINE)


def test_the_table_has_a_row_for_each_branch(forked, tmp_path):
    write_centrelines(tmp_path / "tree.csv", forked)
    with (tmp_path / "tree.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["parent"] for row in rows] == ["", "1", "1"]
    for row, branch in zip(rows, forked.branches, strict=True):
        assert float(row["length_mm"]) == pytest.approx(branch.length, abs=1e-3)
        end = [float(row[f"end_{axis}"]) for axis in "xyz"]
        assert end == pytest.approx(branch.points[-1].tolist(), abs=1e-3)


def test_vtk_reads_the_lines_and_their_arrays(forked, tmp_path):
    write_centrelines(tmp_path / "tree.vtp", forked)
    lines = pyvista.read(tmp_path / "tree.vtp")
    lengths = lines.compute_cell_sizes()["Length"]
    assert lengths == pytest.approx([branch.length for branch in forked.branches], rel=1e-6)
    assert lines["radius"].max() == pytest.approx(max(branch.radius.max() for branch in forked.branches))
    assert lines["parent"].tolist() == [0, 1, 1]
    assert lines.field_data["Space"][0] == "RAS"


def test_samples_are_a_tree_of_the_same_length(forked, tmp_path):
    write_centrelines(tmp_path / "tree.swc", forked)
    samples = np.loadtxt(tmp_path / "tree.swc")
    parents = samples[:, 6].astype(int)
    assert np.all(parents < samples[:, 0])  # parents come first
    assert np.count_nonzero(parents < 0) == 1
    children = np.bincount(parents[parents > 0], minlength=len(samples) + 1)
    assert np.count_nonzero(children == 2) == 1
    assert np.all(samples[:, 5] > 0)
    linked = samples[parents > 0]
    steps = linked[:, 2:5] - samples[parents[parents > 0] - 1, 2:5]
    length = np.linalg.norm(steps, axis=1).sum()
    assert length == pytest.approx(sum(branch.length for branch in forked.branches), rel=1e-5)


def test_morphio_reads_the_samples(forked, tmp_path):
    morphio = pytest.importorskip("morphio")
    write_centrelines(tmp_path / "tree.swc", forked)
    text = (tmp_path / "tree.swc").read_text()
    # neurons have types, and a root without one is none of theirs
    lines = [
        " ".join([*line.split()[:1], "3", *line.split()[2:]]) if line[0] != "#" else line
        for line in text.splitlines()
    ]
    (tmp_path / "dendrite.swc").write_text("\n".join(lines) + "\n")
    neuron = morphio.Morphology(tmp_path / "dendrite.swc")
    assert len(neuron.sections) == 3
    sums = sorted(np.linalg.norm(np.diff(part.points, axis=0), axis=1).sum() for part in neuron.sections)
    assert sums == pytest.approx(sorted(branch.length for branch in forked.branches), rel=1e-3)


def test_the_command_writes_what_it_prints(here, capsys, refused, answer):
    mask, affine = voxels([straight((0, 0, 0), (10, 6, 60), 5.0)], FINE)
    write_nifti(here / "duct.nii.gz", mask.astype(np.uint8), affine)
    assert main(["centrelines", "duct.nii.gz"]) == 0
    printed = capsys.readouterr().out
    assert "duct_centrelines.csv" in printed
    (branch,) = answer("centrelines", "duct.nii.gz", "-o", "duct.swc")["branches"]
    assert branch["mean_radius_mm"] == pytest.approx(5, abs=0.05)
    asked = ("centrelines", "duct.nii.gz")
    assert "choose one of .csv, .vtp, .swc" in refused(*asked, "-o", "duct.xyz")
    assert "--root: '3;4' is not a point" in refused(*asked, "--root", "3;4")


@pytest.mark.skipif(not AIRWAY.is_file(), reason="the real scans are not at ../shared/data")
def test_an_adult_airway_has_published_calibres():
    """Tracheas of men are 13 to 27 mm wide and of women 10 to 23 (Breatnach et al. 1984, AJR 142:903)."""
    bodies = cccd.reconstruct(cccd.read(AIRWAY)).bodies
    mesh = Mesh.joined([body.tessellate(1) for body in bodies])  # of a quarter of the triangles
    found = find_centrelines(mesh, 1.0)
    trachea = found.branches[0]
    mains = [branch for branch in found.branches if branch.parent == 1]
    assert 13 < 2 * trachea.mean_radius < 23
    assert len(mains) == 2
    short, long = sorted(mains, key=lambda branch: branch.length)
    assert short.mean_radius > long.mean_radius  # the right main bronchus is the shorter and wider one
    assert 40 < long.length < 60
    assert 9 < 2 * long.mean_radius < 2 * short.mean_radius < 18
    assert found.loops == mesh.genus
