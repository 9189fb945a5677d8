"""What is packed comes out again, byte for byte; quantising is as exact as it says."""

import base64
import json
import zlib

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from cccd.report.payload import Grid, pack, quantise

TYPES = {"u1": np.uint8, "u2": np.uint16, "u4": np.uint32}


def unpack(text):
    """Undo `pack` as ``structure.js`` does."""
    raw = zlib.decompress(base64.b64decode(text))
    length = int.from_bytes(raw[:4], "little")
    header, body = json.loads(raw[4 : 4 + length]), raw[4 + length :]
    arrays = {}
    for name, entry in header["arrays"].items():
        kind = np.dtype(TYPES[entry["type"]])
        size = entry["count"] * kind.itemsize
        planes = np.frombuffer(body[entry["offset"] : entry["offset"] + size], np.uint8)
        deltas = np.ascontiguousarray(planes.reshape(kind.itemsize, -1).T).view(kind).reshape(-1)
        table = deltas.reshape(-1, entry["columns"])
        arrays[name] = np.cumsum(table, axis=0, dtype=kind)
    return header["meta"], arrays


shapes = st.tuples(st.integers(0, 30), st.integers(1, 3))


@settings(deadline=None)
@given(st.sampled_from([np.uint8, np.uint16, np.uint32]).flatmap(lambda kind: hnp.arrays(kind, shapes)))
def test_pack_round_trip(array):
    meta, arrays = unpack(pack({"k": [1, 2]}, {"first": np.arange(5, dtype=np.uint8), "table": array}))
    assert meta == {"k": [1, 2]}
    np.testing.assert_array_equal(arrays["table"], array)
    np.testing.assert_array_equal(arrays["first"].ravel(), np.arange(5))


points = hnp.arrays(float, st.tuples(st.integers(1, 20), st.just(3)), elements=st.floats(-1e4, 1e4))


@settings(deadline=None)
@given(points)
def test_quantise_is_within_half_a_step(where):
    grid = Grid(where)
    back = np.asarray(grid["origin"]) + grid["step"] * quantise(where, grid).astype(float)
    assert np.abs(back - where).max() <= 0.5 * grid["step"] * (1 + 1e-6) + 1e-9
    assert grid["step"] <= np.ptp(where, axis=0).max() / 65535 + 1e-300


def test_packing_a_sorted_mesh_takes_few_bytes_per_triangle():
    import trimesh

    from cccd.view import Mesh, sort_spatially

    sphere = trimesh.creation.icosphere(subdivisions=6)
    mesh, _ = sort_spatially(Mesh(np.asarray(sphere.vertices), np.asarray(sphere.faces)))
    text = pack({}, {"p": quantise(mesh.vertices, Grid(mesh.vertices)), "f": mesh.faces.astype(np.uint32)})
    assert len(text) < 10 * len(mesh.faces)
