"""Grey values in tetrahedra, materials from a table, and what CalculiX and FEBio's readers make of them."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
import pyvista
from scipy.spatial.transform import Rotation
from support.bars import FRAME, HALF, SETTINGS, calculix, needs_calculix, two_halves
from support.refusals import refusal

from cccd.errors import InputError
from cccd.inputs.grid import Volume
from cccd.settings.surface import TetrahedraSettings
from cccd_tetrahedra.build import fill_and_measure
from cccd_tetrahedra.files import WRITERS
from cccd_tetrahedra.materials import bin_materials, mean_grey_values, read_table

COLUMNS = "hu_from,hu_to,density,density_per_hu,young_mpa,young_power,poisson"

UNTURNED = np.eye(3)

#: Two tissues of constant modulus.
SOFT, STIFF = 2.0, 8.0
TISSUES = f"{COLUMNS}\n,100,1.0,,{SOFT},,0\n100,,2.0,,{STIFF},,0\n"


def scan_of(values, turn=UNTURNED, spacing=(1.0, 1.0, 1.0), origin=(0.0, 0, 0)):
    affine = np.eye(4)
    affine[:3, :3] = turn @ np.diag(spacing)
    affine[:3, 3] = origin
    return Volume(np.asarray(values, np.float32), affine, "ct.nii.gz")


def table(folder, text):
    path = folder / "tissues.csv"
    path.write_text(text)
    return path


def test_the_mean_of_a_linear_scan_is_its_value_at_the_centroid():
    rng = np.random.default_rng(3)
    slope, turn = np.array([2.0, -3.0, 5.0]), Rotation.from_euler("xyz", (20, 30, 40), degrees=True)
    scan = scan_of(np.zeros((40, 40, 20)), turn.as_matrix(), (1, 1, 2), (-5, 3, 8))
    index = np.stack(np.meshgrid(*map(np.arange, scan.shape), indexing="ij"), axis=-1)
    world = index @ scan.affine[:3, :3].T + scan.affine[:3, 3]
    scan = replace(scan, data=(world @ slope).astype(np.float32))
    small, large = rng.uniform(12, 14, (50, 4, 3)), rng.uniform((2, 2, 2), (37, 37, 17), (50, 4, 3))
    corners = np.concatenate([small, large]) @ scan.affine[:3, :3].T + scan.affine[:3, 3]
    assert mean_grey_values(corners, scan) == pytest.approx(corners.mean(axis=1) @ slope, abs=1e-3)


def test_the_mean_of_a_step_is_the_share_of_volume_on_its_sides():
    """Of the unit tetrahedron, scaled by 16, below x = 8 lies 1 - (1/2)^3 of the volume."""
    scan = scan_of((np.arange(40) >= 11)[:, None, None] * np.full((40, 40, 40), 1000.0))
    corners = 3 + 16 * np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])[None]
    # linear between voxels 10 and 11, so that half is reached at 10.5; by some points of the tetrahedron
    share = (1 - 7.5 / 16) ** 3
    assert mean_grey_values(corners, scan) == pytest.approx(1000 * share, abs=6)


def test_tetrahedra_outside_the_scan_are_refused():
    corners = 100 + np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])[None]
    with pytest.raises(InputError, match="1 of 1 tetrahedra lie outside the scan; give the scan"):
        mean_grey_values(corners, scan_of(np.zeros((9, 9, 9))))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("hu_from,hu_to,density,poisson\n,,1,0.3\n", "tissues.csv: it has no column young_mpa"),
        (f"{COLUMNS},colour\n,,1,,5,,0.3,red\n", "tissues.csv: column colour is not known"),
        (
            f"{COLUMNS}\n,100,1,,5,,0.3\n150,,1,,5,,0.3\n",
            "row 2: it begins at 150 HU, but row 1 ends at 100; let r",
        ),
        (
            f"{COLUMNS}\n,100,1,,5,,0.3\n50,,1,,5,,0.3\n",
            "row 2: it begins at 50 HU, but row 1 ends at 100; .*overlap",
        ),
        (f"{COLUMNS}\n100,0,1,,5,,0.3\n", "row 1: it goes from 100 to 0 HU"),
        (f"{COLUMNS}\n,,1,,five,,0.3\n", "row 1: young_mpa is 'five'; give a number"),
        (f"{COLUMNS}\n,,1,,,,0.3\n", "row 1: young_mpa is ''; give a number"),
        (f"{COLUMNS}\n,,1,,-5,,0.3\n", "row 1: young_mpa is -5; give a positive"),
        (f"{COLUMNS}\n,,1,,5,,0.5\n", "row 1: poisson is 0.5"),
        ("", "tissues.csv: it has no column hu_from"),
    ],
)
def test_one_line_says_what_is_wrong_with_a_table(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        read_table(table(tmp_path, text))


def test_a_missing_table_is_refused(tmp_path):
    assert "there is no such table" in refusal(read_table, tmp_path / "none.csv")


def test_grey_values_beyond_the_table_or_its_law_are_refused(tmp_path):
    grey, weights = np.array([-150.0, 50, 900]), np.ones(3)
    narrow = read_table(table(tmp_path, f"{COLUMNS}\n-100,800,1,,5,,0.3\n"))
    with pytest.raises(InputError, match="2 tetrahedra are outside it, with -150 to 900 HU; widen hu_from"):
        bin_materials(grey, weights, narrow, 5, "tissues.csv")
    law = read_table(table(tmp_path, f"{COLUMNS}\n,,0.1,0.001,6850,1.49,0.3\n"))
    with pytest.raises(InputError, match=r"row 1: the density is -0\.05 g/cm3 at -150 HU"):
        bin_materials(grey, weights, law, 5, "tissues.csv")


def test_few_tissues_are_kept_and_laws_are_binned(tmp_path):
    grey = np.linspace(0, 1500, 5000)
    weights = np.random.default_rng(2).uniform(1, 2, len(grey))
    tissues, off = bin_materials(grey, weights, read_table(table(tmp_path, TISSUES)), 2, "tissues.csv")
    assert tissues.young == pytest.approx([SOFT, STIFF])
    assert tissues.density == pytest.approx([1, 2])
    assert off == pytest.approx(0, abs=1e-12)
    assert tissues.number.tolist() == (grey >= 100).astype(int).tolist()
    law = read_table(table(tmp_path, f"{COLUMNS}\n,,0.1,0.001,6850,1.49,0.3\n"))
    exact = 6850 * (0.1 + 0.001 * grey) ** 1.49
    for most in (1, 10, 40):
        binned, off = bin_materials(grey, weights, law, most, "tissues.csv")
        assert len(binned.young) == most
        worst = np.abs(binned.young[binned.number] / exact - 1).max()
        assert off == pytest.approx(worst)
        # a bin is no wider than a share of the logarithms' range
        assert worst < np.expm1(np.log(exact[-1] / exact[0]) / most)
        assert (weights @ binned.young[binned.number]) == pytest.approx(weights @ exact)


def two_tissues(folder, **changes):
    """Return the bar whose left half is soft and whose right half is stiff, by its scan."""
    pytest.importorskip("pytetwild", reason="the extra fe is not installed")
    organs = {name: mesh for name, mesh in two_halves().items() if name != "tumour"}
    a, b, c = FRAME.shape
    z = FRAME.affine[2, 3] + np.arange(c)
    scan = Volume(np.broadcast_to(np.where(z < 0, 50.0, 150.0), (a, b, c)), FRAME.affine, "ct.nii.gz")
    settings = SETTINGS.model_copy(update={"materials": str(table(folder, TISSUES)), **changes})
    frames, scans = dict.fromkeys(organs, FRAME), dict.fromkeys(organs, scan)
    return fill_and_measure(organs, settings, frames, scans=scans)


@needs_calculix
@pytest.mark.parametrize("elements", ["tet4", "tet10"])
def test_calculix_presses_on_two_tissues(tmp_path, elements):
    """Two springs in a row: the bar shortens by p L (1 / E1 + 1 / E2), the file's own materials."""
    filled, report = two_tissues(tmp_path, elements=elements)
    assert report["materials"] >= 2
    WRITERS["inp"](tmp_path / "bar.inp", filled)
    pressure = 0.01
    moved = calculix(tmp_path, "bar.inp", "N_CUT_LEFT, 1, 3", "CUT_RIGHT", pressure)[:, 1:]
    assert moved[:, 2].mean() == pytest.approx(-pressure * HALF * (1 / SOFT + 1 / STIFF), rel=0.04)


@pytest.mark.parametrize("elements", ["tet4", "tet10"])
def test_febio_gets_every_element_node_and_face_once(tmp_path, elements):
    filled, report = two_tissues(tmp_path, elements=elements)
    WRITERS["feb"](tmp_path / "bar.feb", filled)
    root = ElementTree.parse(tmp_path / "bar.feb").getroot()
    assert [child.tag for child in root] == ["Module", "Globals", "Material", "Mesh", "MeshDomains"]
    mesh = root.find("Mesh")
    points = np.array([[float(x) for x in node.text.split(",")] for node in mesh.iter("node")])
    assert points == pytest.approx(filled.vertices, rel=1e-8, abs=1e-8)
    found = {int(e.get("id")) - 1: e.text for part in mesh.iter("Elements") for e in part}
    nodes = np.array([[int(n) - 1 for n in found[k].split(",")] for k in range(len(filled.nodes))])
    assert np.array_equal(nodes, filled.nodes)
    materials = {m.get("name"): float(m.find("E").text) for m in root.iter("material")}
    domains = {domain.get("name"): domain.get("mat") for domain in root.iter("SolidDomain")}
    for part in mesh.iter("Elements"):
        assert part.get("type") == elements
        z = points[[[int(n) - 1 for n in e.text.split(",")[:4]] for e in part]].mean(axis=1)[:, 2]
        if np.abs(z).min() > 4:  # clear of the step
            assert materials[domains[part.get("name")]] == pytest.approx(SOFT if z[0] < 0 else STIFF)
    surfaces = {s.get("name"): len(s) for s in mesh.iter("Surface")}
    assert surfaces == report["groups"]
    sets = {s.get("name"): s.text for s in mesh.iter("NodeSet")}
    cut = np.array(sets["cut_left"].split(","), int) - 1
    assert points[cut, 2] == pytest.approx(-HALF, abs=SETTINGS.tolerance_mm)


@pytest.mark.parametrize("materials", [True, False])
def test_pyfebio_reads_the_file(tmp_path, materials):
    """Nobody here wrote its model of FEBio's format 4.0, which refuses what that does not have."""
    pyfebio = pytest.importorskip("pyfebio", reason="pip install pyfebio")
    filled, report = two_tissues(tmp_path, elements="tet10")
    WRITERS["feb"](tmp_path / "bar.feb", filled if materials else replace(filled, materials=None))
    model = pyfebio.model.Model.from_xml((tmp_path / "bar.feb").read_bytes())
    assert model.version == "4.0"
    assert sum(len(part.all_elements) for part in model.mesh_.elements) == report["tetrahedra"]
    assert {s.name: len(s.all_tri6) for s in model.mesh_.surfaces} == report["groups"]
    assert {s.name for s in model.mesh_.node_sets} == set(report["groups"])
    names = {material.name for material in model.material_.all_materials}
    assert {domain.mat for domain in model.meshdomains_.solid_domains} == names


def test_vtk_reads_grey_values_and_materials(tmp_path):
    filled, _ = two_tissues(tmp_path)
    WRITERS["vtu"](tmp_path / "bar.vtu", filled)
    grid = pyvista.read(tmp_path / "bar.vtu")
    solid = grid.extract_cells_by_type(pyvista.CellType.TETRA)
    z = solid.points[solid.cells_dict[pyvista.CellType.TETRA]][..., 2]
    on_left, on_right = (z < -2).all(axis=1), (z > 2).all(axis=1)
    assert on_left.any()
    assert on_right.any()
    assert solid["material"].min() == 1
    for name, left, right in (("grey", 50, 150), ("young", SOFT, STIFF)):
        assert solid[name][on_left] == pytest.approx(left)
        assert solid[name][on_right] == pytest.approx(right)


def test_materials_without_a_scan_are_refused(tmp_path):
    pytest.importorskip("pytetwild", reason="the extra fe is not installed")
    settings = TetrahedraSettings(edge_mm=8, tolerance_mm=0.5, materials=str(table(tmp_path, TISSUES)))
    with pytest.raises(InputError, match=r"left: materials need the grey values of its scan.*--image"):
        fill_and_measure({"left": two_halves()["left"]}, settings, {})
