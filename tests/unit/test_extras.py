"""What is not installed ends in one line that names the extra of what was asked for, on every way to it."""

import json

import nibabel
import numpy as np
import pytest
import trimesh
from scipy import ndimage
from support import fresh, scans

from cccd.extras import EXTRAS, check_extra, missing_extra, needing

AFFINE = np.diag([1.0, 1.0, 2.5, 1.0])

#: Runs commands and expressions where modules are not: nothing finds them, as where it was never installed.
PROGRAM = """
import contextlib, importlib.machinery, io, json, shlex, sys

missing, *asked = sys.argv[1:]
find = importlib.machinery.PathFinder.find_spec
importlib.machinery.PathFinder.find_spec = lambda name, path=None, target=None: (
    None if name.split(".")[0] in missing.split(",") else find(name, path, target)
)

import nibabel, numpy as np, cccd, cccd_workflow.remote
from cccd.cli import main

mask, maps = (np.asarray(nibabel.load(f"{name}.nii.gz").dataobj) > 0 for name in ("mask", "maps"))
for one in asked:
    code, said = 0, io.StringIO()
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
            code = main(shlex.split(one)[1:]) if one.startswith("cccd ") else eval(one)
    except cccd.InputError as error:
        code, said = "InputError", io.StringIO(str(error))
    except Exception as error:
        code, said = type(error).__name__, io.StringIO(str(error))
    print(json.dumps([one, code, said.getvalue()]))
"""

ORDERING = (
    "cccd surface maps.nii.gz --boundary",
    "cccd surface nowhere.nii.gz --seed 1,2,3",
    "cccd.order(maps)",
    "cccd.reconstruct(cccd.read('maps.nii.gz', boundary=True))",
)
SEGMENTING = "cccd segment mask.nii.gz --segmenter hippocampus"
FETCHING = (
    "cccd_workflow.remote.fetch(cccd_workflow.remote.read_address('s3://bucket/mr.nii.gz', 'here'), None)"
)


def writing(*suffixes):
    """Before anything is read, and in Python."""
    inputs = ("surface nowhere.nii.gz", "export results/case/organ")
    commands = [f"cccd {of} -o a.{suffix}" for of in inputs for suffix in suffixes]
    return (*commands, *(f"cccd.reconstruct(mask).write('a.{suffix}')" for suffix in suffixes))


OF_SEG = ("cccd surface seg.dcm", "cccd check seg.dcm", "cccd.read('seg.dcm')", "cccd.labels('seg.dcm')")
OF_DICOM = (
    *OF_SEG,
    *("cccd surface drawn", "cccd surface series", "cccd surface mask.nii.gz --image series"),
    *("cccd segment series --segmenter hippocampus", "cccd.reconstruct_labels('seg.dcm')"),
    "cccd surface seg.dcm --all-labels",
)

#: By module and extra: what cannot be done without it.
WITHOUT = {
    "torch": {"gnn": ORDERING, "segment": [SEGMENTING]},
    "torch_geometric": {"gnn": ORDERING},
    "monai": {"segment": [SEGMENTING]},
    "pydicom": {"dicom": [*OF_DICOM, *writing("dcm", "stl.dcm", "seg.dcm")]},
    "highdicom": {"dicom": [*OF_SEG, "cccd surface enhanced --threshold", *writing("seg.dcm")]},
    "OCP": {"cad": writing("step", "iges", "brep")},
    "pytetwild": {"fe": writing("msh", "vtu", "inp")},
    "lib3mf": {"print": writing("3mf")},
    "pxr": {"usd": writing("usd", "usda", "usdc")},
    "zarr": {"zarr": ["cccd surface labels.ome.zarr"]},
    "boto3": {"s3": [FETCHING]},
}
#: Modules that one interpreter may lack together: no call above asks for two of them.
TOGETHER = [
    ("torch",),
    ("monai", "highdicom"),
    ("torch_geometric", "pydicom", "OCP", "pytetwild", "lib3mf", "pxr", "zarr", "boto3"),
]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A folder with an input of every kind."""
    from cccd.geometry.mesh import Mesh
    from cccd_dicom.seg import write

    folder = tmp_path_factory.mktemp("inputs")
    offset = (np.indices((24, 24, 13)) - np.array((12, 12, 6)).reshape(3, 1, 1, 1)).T * (1, 1, 2.5)
    ball = (np.linalg.norm(offset, axis=-1) <= 8).T
    inner = np.logical_and.reduce([np.roll(ball, way, axis) for way in (1, -1) for axis in (0, 1)])
    for name, data in {"mask": ball, "maps": ball & ~inner}.items():
        nibabel.save(nibabel.Nifti1Image(data.astype(np.uint8), AFFINE), folder / f"{name}.nii.gz")
    for name in ("mask.nrrd", "mask.mha"):
        scans.write_itk(folder / name, ball.astype(np.uint8), AFFINE)
    grey, grid = 100 * ball.astype(np.int16), scans.dicom_affine(spacing=(1, 1, 2.5))
    nibabel.save(nibabel.Nifti1Image(grey, AFFINE), folder / "grey.nii.gz")
    scans.write_series(folder / "series", grey, grid)
    for name in ("drawn", "enhanced", "labels.ome.zarr", "results/case/organ"):
        (folder / name).mkdir(parents=True)
    scans.write_structure_set(folder / "drawn" / "rt.dcm", {"ball": scans.outlines(ball, AFFINE)})
    scans.write_enhanced(folder / "enhanced" / "ct.dcm", grey, grid, range(13))
    sphere = trimesh.creation.icosphere(3, 8.0)
    mesh = Mesh(sphere.vertices + (grid @ (12, 12, 6, 1))[:3], np.asarray(sphere.faces, np.int64))
    scans.export(write, folder / "seg.dcm", mesh, organ="ball", series=folder / "series")
    (folder / "mesh.vtp").write_text("<VTKFile/>")
    (folder / "damaged.tsv").write_text("case\torgan\tsource\na\tliver\tdamaged_phantom\n")
    (folder / "sheet.tsv").write_text("case\torgan\tmask\na\tball\tmask.nii.gz\n")
    for name, source, organ in (("mni", "mni152", "brain"), ("ct", "whole_body_ct", "liver")):
        (folder / f"{name}.tsv").write_text(f"case\torgan\tsource\na\t{organ}\t{source}\n")
    for name in ("metrics.json", "surface.h5", "surface.ply"):
        (folder / "results" / "case" / "organ" / name).write_text("{}")
    return folder


@pytest.mark.parametrize("modules", TOGETHER, ids=",".join)
def test_one_line_names_the_extra_of_what_was_asked_for(inputs, modules):
    named = [
        (one, module, extra)
        for module in modules
        for extra, calls in WITHOUT[module].items()
        for one in calls
    ]
    said = fresh.python(PROGRAM, ",".join(modules), *(one for one, *_ in named), cwd=inputs)
    for (asked, module, extra), line in zip(named, said.splitlines(), strict=True):
        one, code, told = json.loads(line)
        assert one == asked
        assert code == (1 if one.startswith("cccd ") else "InputError"), one
        assert len(told.splitlines()) == 1, (one, told)
        assert f"{module} is not installed" in told, (one, told)
        assert f"[{extra}]" in told, (one, told)


def test_every_module_is_asked_for():
    assert sorted(WITHOUT) == sorted(sum(TOGETHER, ()))


def test_without_any_extra_masks_probabilities_and_label_maps_become_surfaces(inputs, tmp_path):
    inside = np.asarray(nibabel.load(inputs / "mask.nii.gz").dataobj, np.float32)
    nibabel.save(nibabel.Nifti1Image(ndimage.gaussian_filter(inside, 0.7), AFFINE), tmp_path / "maps.nii.gz")
    nibabel.save(nibabel.Nifti1Image((2 * inside).astype(np.uint8), AFFINE), tmp_path / "mask.nii.gz")
    commands = (
        "cccd surface mask.nii.gz -o a.ply -o a.stl -o a.obj -o a.glb -o a.gii -o a.vtp -o a.nii.gz",
        "cccd surface maps.nii.gz -o b.ply",
        "cccd surface mask.nii.gz --all-labels -o c.glb",
        "cccd surface a.stl -o d.ply",
        "cccd compare a.ply mask.nii.gz",
        "cccd hollow mask.nii.gz --thickness 2 -o e.stl",
        "cccd check mask.nii.gz",
        "cccd surface mask.nii.gz --triangles 2000 -o f.ply",
    )
    modules = ",".join(sorted({module for brought in EXTRAS.values() for module in brought}))
    for line in fresh.python(PROGRAM, modules, *commands, cwd=tmp_path).splitlines():
        one, code, said = json.loads(line)
        assert code == 0, (one, said)


def test_every_module_of_an_extra_is_named_with_one_that_brings_it():
    for extra, modules in EXTRAS.items():
        for module in modules:
            error = ModuleNotFoundError(name=f"{module}.part")
            assert f"[{extra}]" in str(missing_extra(error, "here", extra))
            assert any(f"[{name}]" in str(missing_extra(error, "here")) for name in EXTRAS), module


def test_a_module_of_no_extra_raises_as_it_does():
    with pytest.raises(ModuleNotFoundError, match="no_such_module"), needing("here", "gnn"):
        import no_such_module  # noqa: F401  # pyright: ignore[reportMissingImports]


def test_an_extra_is_there_when_all_that_it_brings_is(monkeypatch):
    monkeypatch.setitem(EXTRAS, "cad", ("json", "numpy"))
    check_extra("cad", "a.step")
    monkeypatch.setitem(EXTRAS, "cad", ("json", "no_such_module"))
    with pytest.raises(ValueError, match=r"a\.step: no_such_module is not installed; .*\[cad\]"):
        check_extra("cad", "a.step")
