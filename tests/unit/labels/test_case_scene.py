"""One scene for a case: names, colours and places come back from every file."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import slicerio
import trimesh

from cccd.containers import Frame
from cccd.files import write_surface
from cccd.geometry.mesh import Mesh
from cccd.surface.surface import LoftedSurface
from cccd_labels.scene import describe_scene, name_organs, write_scene, write_segmentation

#: An oblique, mirrored scan.
AFFINE = np.array([[0, -2.0, 0, 30], [-1.5, 0, 0, 20], [0, 0, 3.0, -10], [0, 0, 0, 1]])
FRAME = Frame(AFFINE, 2, (30, 28, 20))


def box(low, high):
    """A box between two voxels, in mm RAS."""
    corners = np.array([np.asarray(low) - 0.5, np.asarray(high) + 0.5])
    mesh = trimesh.creation.box(bounds=corners)
    return Mesh(np.array(mesh.vertices), np.array(mesh.faces, np.int64)).transformed(AFFINE)


@pytest.fixture
def organs():
    meshes = {"Liver": box((3, 4, 2), (12, 15, 9)), "label_7": box((13, 4, 2), (20, 15, 9))}
    told = {
        "Liver": {"label": "5", "name": "Liver, whole", "colour": "#dd8265", "code": "SCT^10200004^Liver"}
    }
    return name_organs(meshes, told | {"label_7": {"label": "7"}})


def test_slicer_gets_names_colours_and_voxels_back(organs, tmp_path):
    path = tmp_path / "segmentation.seg.nrrd"
    write_segmentation(path, organs, FRAME)
    back = slicerio.read_segmentation(str(path))
    assert [(part["name"], part["labelValue"]) for part in back["segments"]] == [
        ("Liver, whole", 5),
        ("label_7", 7),
    ]
    assert back["segments"][0]["terminology"]["type"] == ["SCT", "10200004", "Liver"]
    assert np.allclose(back["segments"][0]["color"], np.array([0xDD, 0x82, 0x65]) / 255, atol=1e-5)
    expected = np.zeros(FRAME.shape, np.uint8)
    expected[3:13, 4:16, 2:10], expected[13:21, 4:16, 2:10] = 5, 7
    assert np.array_equal(back["voxels"], expected)
    assert np.allclose(np.diag([-1, -1, 1, 1]) @ back["ijkToLPS"], AFFINE)


def test_a_scene_has_a_named_coloured_node_for_each_organ(organs, tmp_path):
    path = tmp_path / "scene.glb"
    write_scene(path, organs)
    scene = trimesh.load(path)
    assert set(scene.geometry) == {"Liver", "label_7"}
    assert {mesh.visual.material.name for mesh in scene.geometry.values()} == {"Liver, whole", "label_7"}
    size = scene.extents * 1000  # metres, y up
    low, high = (np.min, np.max)
    points = np.concatenate([organ.mesh.vertices for organ in organs])
    assert np.allclose(size[[0, 2, 1]], high(points, axis=0) - low(points, axis=0), atol=1e-3)
    # colours are the table's, in sRGB; glTF's factors are linear, and trimesh keeps bytes
    given = np.array([0xDD, 0x82, 0x65]) / 255
    assert organs[0].rgb == pytest.approx(given)
    linear = np.asarray(scene.geometry["Liver"].visual.material.baseColorFactor[:3], float) / 255
    assert linear ** (1 / 2.2) == pytest.approx(given, abs=0.02)


def validator():
    """Khronos' validator, where npm put it."""
    beside = ["/usr/local/lib/node_modules", "/usr/lib/node_modules"]
    folders = [*filter(None, os.environ.get("NODE_PATH", "").split(":")), *beside]
    return next((path for folder in folders if (path := Path(folder, "gltf-validator")).is_dir()), None)


@pytest.mark.skipif(
    shutil.which("node") is None or validator() is None,
    reason="no node, or no gltf-validator where NODE_PATH points (npm install gltf-validator)",
)
def test_khronos_validator_finds_no_error(organs, tmp_path):
    write_scene(tmp_path / "scene.glb", organs)
    write_surface(tmp_path / "surface.glb", LoftedSurface([], organs[0].mesh, FRAME))
    for path in (tmp_path / "scene.glb", tmp_path / "surface.glb"):
        code = (
            f"require('{validator()}').validateBytes(new Uint8Array(require('fs').readFileSync('{path}')))"
            ".then(r => console.log(JSON.stringify(r.issues)))"
        )
        told = subprocess.run(["node", "-e", code], capture_output=True, text=True, check=True, timeout=60)
        assert json.loads(told.stdout)["numErrors"] == 0


def test_the_list_has_volumes_and_codes(organs):
    liver, other = describe_scene("anna", organs)["organs"]
    assert liver["volume_ml"] == pytest.approx(10 * 12 * 8 * 9 / 1000)
    assert (liver["code"], liver["color"]) == ("SCT^10200004^Liver", "#dd8265")
    assert other["color"] != liver["color"]
