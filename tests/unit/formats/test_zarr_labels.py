"""OME-Zarr label maps lie where their axes say, and refuse what is missing."""

import json
from pathlib import Path

import numpy as np
import pytest
from support.refusals import refusal

import cccd
from cccd.cli import main
from cccd.store import read_ply

zarr = pytest.importorskip("zarr")

from cccd.inputs.readers import read_volume, reader_of  # noqa: E402

SCALE, SHIFT = (2.0, 0.8, 1.0), (5.0, -3.0, 40.0)


def labels():
    """A rod along z of label 7 and a ball of label 3."""
    k, i, j = np.indices((70, 48, 40))
    data = np.where(np.hypot(i - 20.3, j - 18.6) < 11, 7, 0)
    data[np.hypot(np.hypot(i - 36, j - 32), k - 40) < 5] = 3
    data[:4] = data[62:] = 0
    return data.astype(np.uint8)


def write(path, data, version="0.5", axes=None, scale=SCALE, shift=SHIFT, **more):
    """Write an OME-Zarr by hand, with chunks of 16."""
    group = zarr.open_group(path, mode="w", zarr_format=2 if version == "0.4" else 3)
    axes = axes or [{"name": name, "type": "space", "unit": "millimeter"} for name in "zyx"]
    lead = [1.0] * (len(axes) - 3)
    changes = [
        {"type": "scale", "scale": [*lead, *scale]},
        {"type": "translation", "translation": [*[0.0] * len(lead), *shift]},
    ]
    multiscales = [{"axes": axes, "datasets": [{"path": "0", "coordinateTransformations": changes}]}]
    ome = {"version": version, "multiscales": multiscales}
    group.attrs.update(ome if version == "0.4" else {"ome": ome})
    shape = (*[1] * len(lead), *data.shape)
    array = group.create_array(
        "0", shape=shape, chunks=(*[1] * len(lead), 16, 16, 16), dtype=data.dtype, **more
    )
    array[:] = data.reshape(shape)
    return Path(path)


@pytest.mark.parametrize("version", ["0.4", "0.5"])
def test_a_surface_lies_where_the_axes_say(here, version):
    path = write(here / "map.ome.zarr", labels(), version)
    assert reader_of(path)
    assert main(["surface", "map.ome.zarr", "--label", "7", "-o", "rod.ply"]) == 0
    mesh = read_ply("rod.ply")
    assert mesh.volume == pytest.approx((labels() == 7).sum() * np.prod(SCALE), rel=0.015)
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    true = np.array((18.6 + 40, 0.8 * 20.3 - 3, 2 * 32.5 + 5))
    assert np.abs(middle - true).max() < 0.35


def test_units_and_orientations_are_followed(here):
    axes = [{"name": name, "type": "space", "unit": "micrometer"} for name in "zyx"]
    axes[2]["orientation"] = {"type": "anatomical", "value": "right-to-left"}
    found = read_volume(
        write(here / "map.zarr", labels(), axes=axes, scale=(2000, 800, 1000), shift=(0, 0, 5000))
    )
    np.testing.assert_allclose(found.affine @ (1, 1, 1, 1), (-6, 0.8, 2, 1))


def test_a_time_and_a_channel_are_left_out(here):
    axes = [{"name": "t", "type": "time"}, {"name": "c", "type": "channel"}]
    axes += [{"name": name, "type": "space"} for name in "zyx"]
    found = read_volume(write(here / "map.zarr", labels(), axes=axes))
    assert found.shape == (70, 48, 40)
    np.testing.assert_array_equal(found.data, labels())


def test_what_ngff_zarr_writes_is_read(here):
    ngff = pytest.importorskip("ngff_zarr")
    image = ngff.to_ngff_image(
        labels(), dims=["z", "y", "x"], scale=dict(zip("zyx", SCALE, strict=True)),
        translation=dict(zip("zyx", SHIFT, strict=True)),
    )  # fmt: skip
    ngff.to_ngff_zarr("map.ome.zarr", ngff.to_multiscales(image, scale_factors=[]), version="0.5")
    found = read_volume(here / "map.ome.zarr")
    np.testing.assert_array_equal(found.data, labels())
    np.testing.assert_allclose(found.affine @ (0, 0, 0, 1), (*SHIFT[::-1], 1))
    np.testing.assert_allclose(found.affine @ (1, 0, 0, 0), (0, 0, 2, 0))


def test_a_chunk_that_is_missing_is_named(here):
    path = write(here / "map.ome.zarr", labels())
    (path / "0" / "c" / "2" / "1" / "1").unlink()
    assert "chunk c/2/1/1 is missing, and the organ is cut off there" in refusal(read_volume, path)


def test_chunks_that_are_empty_need_no_file(here):
    path = write(here / "map.ome.zarr", labels())
    assert not (path / "0" / "c" / "0" / "2" / "2").exists()  # Zarr writes none
    np.testing.assert_array_equal(read_volume(path).data, labels())


def test_a_damaged_chunk_is_one_line(here, refused):
    path = write(here / "map.ome.zarr", labels())
    (path / "0" / "c" / "2" / "1" / "1").write_bytes(b"nothing")
    assert "is damaged" in refused("surface", "map.ome.zarr", "-o", "a.ply")
    assert not Path("a.ply").exists()


def test_what_cannot_work_ends_in_one_line(here, refused):
    write(here / "map.ome.zarr", labels())
    zarr.open_group(here / "plain.zarr", mode="w").create_array("0", shape=(4, 4, 4), dtype="u1")
    axes = [{"name": "c", "type": "channel"}, *({"name": name, "type": "space"} for name in "zyx")]
    two = write(here / "two.zarr", labels(), axes=axes)
    meta = json.loads((two / "zarr.json").read_text())
    meta["attributes"]["ome"]["multiscales"][0]["axes"] = axes[:1] + axes[:0:-1]
    (two / "zarr.json").write_text(json.dumps(meta))
    group = zarr.open_group(write(here / "vast.ome.zarr", labels()), mode="a")
    group.create_array("0", shape=(1000, 1000, 1000), chunks=(100, 100, 100), dtype="u1", overwrite=True)
    wrong = {
        "nowhere.ome.zarr": "there is no nowhere.ome.zarr",
        "plain.zarr": "it has no OME multiscales",
        "two.zarr": "its axes are c 1, x 70, y 48, z 40",
        "map.ome.zarr --label 9": "it has no label '9'; choose one of 3, 7",
        "map.ome.zarr --label liver": "it has no label 'liver'",
        "vast.ome.zarr": "1000 x 1000 x 1000 voxels are too many",
    }
    for arguments, words in wrong.items():
        assert words in refused("surface", *arguments.split())


def test_every_label_becomes_a_surface_and_python_reads_one(here):
    write(here / "map.ome.zarr", labels())
    assert main(["surface", "map.ome.zarr", "--all-labels", "--cores", "1"]) == 0
    for label in (3, 7):
        volume = read_ply(f"map_label_{label}.ply").volume
        assert volume == pytest.approx((labels() == label).sum() * np.prod(SCALE), rel=0.03)
    assert cccd.labels("map.ome.zarr") == {"3": "", "7": ""}
    assert cccd.read("map.ome.zarr", 7).mask.sum() == (labels() == 7).sum()
