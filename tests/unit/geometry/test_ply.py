import numpy as np
import pytest
import trimesh
from support.solids import torus

from cccd.errors import InputError
from cccd.geometry.ply import read_ply, write_ply


def test_a_mesh_comes_back_to_the_last_bit(tmp_path):
    mesh = torus()
    write_ply(tmp_path / "a.ply", mesh, "unit mm")
    back = read_ply(tmp_path / "a.ply")
    assert np.array_equal(back.vertices, mesh.vertices)
    assert np.array_equal(back.faces, mesh.faces)
    assert b"\ncomment unit mm\n" in (tmp_path / "a.ply").read_bytes()[:200]
    other = trimesh.load(tmp_path / "a.ply", process=False)
    assert np.array_equal(other.faces, mesh.faces)


def test_half_a_file_and_other_meshes_are_refused(tmp_path):
    write_ply(tmp_path / "a.ply", torus(), "unit mm")
    whole = (tmp_path / "a.ply").read_bytes()
    (tmp_path / "half.ply").write_bytes(whole[: len(whole) // 2])
    torus().to_trimesh().export(tmp_path / "other.ply")
    for name in ("half.ply", "other.ply"):
        with pytest.raises(InputError, match="not a mesh that the lofting wrote"):
            read_ply(tmp_path / name)
