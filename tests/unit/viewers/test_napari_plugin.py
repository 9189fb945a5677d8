"""napari's own program finds the plugin by its manifest, and makes a surface layer where the labels are."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from support.refusals import refusal

napari = pytest.importorskip("napari")
npe2 = pytest.importorskip("npe2")

import cccd  # noqa: E402
import cccd_viewers  # noqa: E402
from cccd.store import write_ply  # noqa: E402
from cccd_viewers.napari_plugin import affine_of_layer, surface_of_layer  # noqa: E402

MANIFEST = Path(cccd_viewers.__file__).with_name("napari.yaml")
SCALE, TRANSLATE = np.array([2.0, 0.9, 1.0]), np.array([7.0, -3.0, 5.0])


def ball():
    offset = np.moveaxis(np.indices((12, 24, 22)), 0, -1) * SCALE - [11, 11, 11]
    return np.linalg.norm(offset, axis=-1) <= 8


def layer(**changes):
    given = {"scale": SCALE, "translate": TRANSLATE, "name": "organs", **changes}
    return napari.layers.Labels(4 * ball().astype(np.uint8), **given)


def test_the_manifest_names_what_is_there():
    manifest = npe2.PluginManifest.from_file(MANIFEST)
    manifest.validate_imports()
    assert {command.id.split(".")[1] for command in manifest.contributions.commands} == {
        "make_surface",
        "get_reader",
    }


@pytest.mark.parametrize("changes", [{}, {"rotate": 30}, {"shear": [0.2, 0, 0]}])
def test_the_surface_lies_where_the_labels_lie(changes):
    labels = layer(**changes)
    (data, arguments, kind), warnings = surface_of_layer(labels, 4, colour_by_error_band=True)
    made = napari.layers.Layer.create(data, arguments, kind)
    assert isinstance(made, napari.layers.Surface)
    assert warnings == []
    mesh = trimesh.Trimesh(*made.data[:2], process=False)
    middle = np.argwhere(ball()).mean(axis=0)
    assert mesh.center_mass == pytest.approx(labels.data_to_world(middle), abs=0.05)
    volume = ball().sum() * abs(np.linalg.det(affine_of_layer(labels)[:3, :3])) / 1000
    assert arguments["metadata"]["volume_ml"] == pytest.approx(volume, rel=0.02)
    assert data[2].min() > 0


def test_bad_layers_get_one_line():
    assert "no voxel has the label 9" in refusal(surface_of_layer, layer(), 9)
    moving = napari.layers.Labels(np.zeros((2, 4, 4, 4), np.uint8))
    assert "it has 4 axes, not three" in refusal(surface_of_layer, moving, 1)
    _, warnings = surface_of_layer(layer(scale=[1, 1, 1]), 4)
    assert "set layer.scale" in warnings[-1]


@pytest.fixture
def viewer(make_napari_viewer):
    manager = npe2.PluginManager.instance()
    manager.register(npe2.PluginManifest.from_file(MANIFEST))
    yield make_napari_viewer()
    manager.unregister("cccd-surfaces")


def test_the_widget_and_the_reader_work_in_the_viewer(viewer, tmp_path):
    labels = viewer.add_labels(4 * ball().astype(np.uint8), scale=SCALE, name="organs")
    _, widget = viewer.window.add_plugin_dock_widget("cccd-surfaces", "Smooth surface of labels")
    widget["labels"].value, widget["label"].value = labels, 4
    widget()
    assert viewer.layers[-1].name == "organs 4 surface"
    made = viewer.layers[-1]
    surface = cccd.reconstruct(ball(), affine_of_layer(labels))
    write_ply(tmp_path / "ball.ply", surface.lofted.mesh, "a ball")
    (read,) = viewer.open(tmp_path / "ball.ply", plugin="cccd-surfaces")
    assert np.allclose(read.data[0][:, ::-1].max(axis=0), made.data[0].max(axis=0), atol=1e-4)
