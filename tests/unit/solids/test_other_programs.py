"""What programs that nobody here wrote make of the STEP files: FreeCAD cuts them, gmsh fills them."""

import json
import os
import shutil
import subprocess
import sys

import pytest
from support.closed_shapes import sphere, together

from cccd_solids.build import build_solids, write_solids

CHECK = """
import json, os, FreeCAD, Part
shape = Part.Shape()
shape.read(os.environ["STEP"])
box = shape.BoundBox
half = Part.makeBox(box.XLength, box.YLength, box.ZLength / 2, FreeCAD.Vector(box.XMin, box.YMin, box.ZMin))
cut = shape.cut(half)
try:
    shape.check(True)
    problem = ""
except Exception as error:
    problem = str(error)
print("FOUND", json.dumps({
    "solids": len(shape.Solids), "valid": shape.isValid(), "volume": sum(s.Volume for s in shape.Solids),
    "closed": all(shell.isClosed() for shell in shape.Shells), "problem": problem,
    "cut": cut.Volume, "cut_valid": cut.isValid(),
}))
"""

pytest.importorskip("OCP", reason="cadquery-ocp-novtk is not installed")


def runs(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0


FREECAD = shutil.which("freecadcmd")


@pytest.fixture(scope="module", params=["splines", "facets"])
def step(request, tmp_path_factory):
    """A file of a ball with a cavity, and the volume of its mesh."""
    mesh = together(sphere(10.0, subdivisions=3), sphere(6.0, subdivisions=3).reversed())
    smooth = request.param == "splines"
    solids = build_solids(mesh, 0.2) if smooth else build_solids(mesh, 0.01, most_quads=12, most_facets=800)
    path = tmp_path_factory.mktemp("step") / "organ.step"
    report = write_solids(path, "organ", solids, "step")
    assert report["smooth_shells"] == (2 if smooth else 0)
    return path, mesh.volume


@pytest.mark.skipif(FREECAD is None, reason="FreeCAD (Debian's freecad-python3) is not installed")
def test_freecad_finds_a_valid_solid_and_cuts_it(step):
    path, volume = step
    script = path.with_name("check.py")
    script.write_text(CHECK)
    done = subprocess.run(
        [FREECAD, str(script)],
        env=os.environ | {"STEP": str(path)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=300,
    )
    found = json.loads(done.stdout.rpartition("FOUND")[2].splitlines()[0])
    assert found["solids"] == 1
    assert found["valid"]
    assert found["closed"]
    assert found["problem"] == ""
    assert found["volume"] == pytest.approx(volume, rel=5e-3)
    assert found["cut"] == pytest.approx(volume / 2, rel=0.02)
    assert found["cut_valid"]


FILL = """
import sys, gmsh
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.occ.importShapes(sys.argv[1])
gmsh.model.occ.synchronize()
gmsh.option.setNumber("Mesh.MeshSizeMax", 3.0)
gmsh.model.mesh.generate(3)
_, tags, _ = gmsh.model.mesh.getElements(3)
volumes = gmsh.model.mesh.getElementQualities(tags[0], "volume")
print("FOUND", len(gmsh.model.getEntities(3)), len(tags[0]), min(volumes), sum(volumes))
"""


@pytest.mark.skipif(not runs("import gmsh"), reason="gmsh does not run here (pip install gmsh, libglu1-mesa)")
def test_gmsh_fills_the_solid_with_tetrahedra(step):
    path, volume = step
    done = subprocess.run(
        [sys.executable, "-c", FILL, str(path)], capture_output=True, text=True, timeout=300, check=True
    )
    solids, count, least, total = done.stdout.split("FOUND")[1].split()
    assert int(solids) == 1
    assert int(count) > 1000
    assert float(least) > 0
    assert float(total) == pytest.approx(volume, rel=0.02)
