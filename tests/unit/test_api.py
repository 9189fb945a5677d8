"""What the library offers: few names, cheap to import, the same surface whichever way it is asked for."""

import inspect
from importlib import import_module

import nibabel
import numpy as np
import pytest
import trimesh
from support import fresh
from support.refusals import refusal
from support.shapes import drawn

import cccd
from cccd.project import PROJECT, SHIPPED_WEIGHTS
from cccd.tolerances import CONTROL_POINT_PIXELS

PUBLIC = {
    *("fit_contours", "labels", "order", "read", "reconstruct", "reconstruct_labels", "smooth_mesh"),
    *("compare", "ControlMesh", "Curves", "FittedCurves", "InputError", "Settings", "Structure", "Surface"),
    "__version__",
}
AFFINE = np.array([[-1.0, 0, 0, 10], [0, 0.9, 0, -20], [0, 0, 2.5, 5], [0, 0, 0, 1]])


def ball(radius=9.0):
    offset = (np.indices((26, 26, 12)) - np.array([12, 13, 5.5]).reshape(3, 1, 1, 1)).T * (1, 0.9, 2.5)
    return (np.linalg.norm(offset, axis=-1) <= radius).T


@pytest.fixture(scope="module")
def surface():
    return cccd.reconstruct(ball(), AFFINE)


def test_what_is_public_is_listed_once_and_is_there():
    assert set(cccd.__all__) == PUBLIC
    by_stub = {"compare", "order", "reconstruct_labels", "smooth_mesh"}
    assert {*import_module("cccd.api").__all__} | by_stub == PUBLIC - {"__version__"}
    for name in PUBLIC - {"__version__"}:
        assert getattr(cccd, name).__doc__
        assert name in dir(cccd)
    with pytest.raises(AttributeError, match="recontsruct"):
        _ = cccd.recontsruct


def test_a_signature_is_read_at_a_glance():
    """With a configuration for a default value, help opened with six thousand characters of it."""
    functions = {name: getattr(cccd, name) for name in PUBLIC if inspect.isfunction(getattr(cccd, name))}
    functions |= {f"Surface.{name}": f for name, f in vars(cccd.Surface).items() if inspect.isfunction(f)}
    assert {"read", "Surface.write"} < set(functions)
    for name, function in functions.items():
        assert len(str(inspect.signature(function))) < 400, name


def test_no_configuration_is_the_default_one(surface):
    given = cccd.reconstruct(ball(), AFFINE, settings=cccd.Settings())
    assert given.vertices.tobytes() == surface.vertices.tobytes()


def test_any_number_of_threads_gives_the_same_bits():
    """OpenBLAS's kernels for AVX2 share a product among threads at places that depend on their number."""
    code = """
import hashlib, numpy as np, cccd
at = (np.indices((40, 36, 18)).T - (19.7, 17.6, 8.8)) * (1, 1, 2)
wavy = np.linalg.norm(at / (14, 12, 13), axis=-1) + 0.1 * np.sin(at[..., 0] / 2) <= 1
surface = cccd.reconstruct(wavy.T, np.diag([1, 1, 2, 1]))
print(hashlib.sha256(surface.vertices.tobytes() + surface.faces.tobytes()).hexdigest())
"""
    said = set()
    for count in ("1", "2"):
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), count)
        said.add(fresh.python(code, OPENBLAS_CORETYPE="Haswell", **threads))
    assert len(said) == 1


def test_importing_loads_nothing_and_a_mask_needs_no_torch_and_no_table():
    code = """
import sys, cccd
assert not {"numpy", "cccd.api"} & set(sys.modules), "import cccd is not lazy"
cccd.reconstruct
print(*sys.modules)
"""
    heavy = {"torch", "torch_geometric", "pandas", "matplotlib", "pyvista", "vtk", "highdicom", "snakemake"}
    assert not heavy & {name.split(".")[0] for name in fresh.python(code).split()}


def test_the_surface_lies_in_the_world(surface):
    assert surface.volume == pytest.approx(ball().sum() * 0.9 * 2.5, rel=1e-3)
    assert surface.size == pytest.approx((18, 18, 18), abs=0.9)  # a pixel
    centre = (AFFINE @ (12, 13, 5.5, 1))[:3]
    assert isinstance(surface.mesh, trimesh.Trimesh)
    assert surface.mesh.center_mass == pytest.approx(centre, abs=0.02)
    assert surface.mesh.is_watertight
    assert surface.mesh.volume == pytest.approx(surface.volume)
    assert surface.to_pyvista().n_cells == len(surface.faces)
    assert isinstance(surface.bodies[0], cccd.ControlMesh)


def test_a_file_gives_what_its_array_gives_and_every_format_is_the_registry_s(surface, tmp_path):
    nibabel.save(nibabel.Nifti1Image(ball().astype(np.uint8) * 5, AFFINE), tmp_path / "organ.nii.gz")
    read = cccd.reconstruct(cccd.read(tmp_path / "organ.nii.gz", 5))
    # the header keeps single precision of the affine, and control points may be rounded elsewhere
    assert np.array_equal(read.faces, surface.faces)
    assert np.allclose(read.vertices, surface.vertices, atol=2 * CONTROL_POINT_PIXELS)
    assert cccd.labels(tmp_path / "organ.nii.gz") == {"5": ""}
    for label in (np.int64(5), np.array([5]), "5"):
        assert cccd.read(tmp_path / "organ.nii.gz", label).mask.sum() == ball().sum()
    assert trimesh.load(surface.write(tmp_path / "a.stl")).is_watertight
    with pytest.raises(cccd.InputError, match=r"unknown surface format '.tsl'.*\.stl"):
        surface.write(tmp_path / "a.tsl")


def test_the_order_of_a_map_s_pixels_is_found_and_lofted():
    mask = ball()
    inner = mask & np.roll(mask, 1, 0) & np.roll(mask, -1, 0) & np.roll(mask, 1, 1) & np.roll(mask, -1, 1)
    curves = cccd.order(mask & ~inner, AFFINE)
    assert len(curves) == mask.any((0, 1)).sum()
    assert cccd.reconstruct(curves).volume == pytest.approx(4 / 3 * np.pi * 9**3, rel=0.05)
    assert len(cccd.order((mask & ~inner)[:, :, 6])) == 1
    assert SHIPPED_WEIGHTS.is_relative_to(PROJECT)


def test_a_given_curve_that_crosses_itself_is_a_warning_of_the_surface():
    angle = np.linspace(0, 2 * np.pi, 80, endpoint=False) + 0.01
    circle = 30 + 12.3 * np.column_stack([np.cos(angle), np.sin(angle)])
    loop = 30 + np.column_stack([12.3 * np.sin(angle), 9 * np.sin(2 * angle) + 6 * np.sin(angle)])
    curves = drawn([circle, circle, loop, circle, circle], shape=(60, 60, 5))
    (line,) = (line for line in cccd.reconstruct(curves).warnings if "crosses itself" in line)
    assert "slice 2 at (30.0, 30.0), 30.0, 30.0, 2.0 mm" in line


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: cccd.reconstruct(np.zeros((9, 9, 9), bool)), ["the mask is empty"]),
        (lambda: cccd.reconstruct(np.ones((9, 9), bool)), ["2 dimensions"]),
        (lambda: cccd.reconstruct(ball(), np.zeros((4, 4))), ["no extent"]),
        (lambda: cccd.reconstruct(ball(), np.eye(3)), ["shape (3, 3); give a 4 x 4 matrix"]),
        (lambda: cccd.fit_contours([np.zeros((2, 2))]), ["contour 0", "(2, 2)"]),
        (lambda: cccd.fit_contours([]), ["there is none"]),
        (lambda: cccd.order(np.zeros((2, 2, 2, 2))), ["(2, 2, 2, 2)"]),
        (lambda: cccd.reconstruct(np.full((9, 9, 9), "a")), ["no real numbers"]),
        (lambda: cccd.reconstruct(ball().astype(complex)), ["no real numbers"]),
        (lambda: cccd.reconstruct("liver.nii.gz"), ["liver.nii.gz: a path", "cccd.read"]),
        (lambda: cccd.labels("there/liver.nii.gz"), ["liver.nii.gz is not there"]),
        (lambda: cccd.read(__file__, 5.5), ["5.5 is not a label"]),
        (lambda: cccd.read(__file__, None), ["None is not a label"]),
        (lambda: cccd.reconstruct(ball(), settings={"surface": {}}), ["dict is no cccd.Settings"]),
        *(
            (lambda threshold=threshold: cccd.read(__file__, threshold=threshold), ["is not a range"])
            for threshold in (150, None, "150:", (1, 2, 3), (300, 100), (None, None), (np.nan, None))
        ),
    ],
)
def test_bad_arrays_are_refused_in_one_line(call, words):
    line = refusal(call)
    assert all(word in line for word in words)
