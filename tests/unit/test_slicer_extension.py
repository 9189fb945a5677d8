"""The logic of 3D Slicer's module, in the Python that has slicer-core; its widget is not run here."""

import json
import os
import subprocess
import sys

import pytest
from support import ROOT

PYTHON = os.environ.get("CCCD_SLICER_PYTHON")

pytestmark = pytest.mark.skipif(not PYTHON, reason="CCCD_SLICER_PYTHON names no Python with slicer-core")

SCRIPT = """
import json, sys
import numpy as np, slicer, vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from CCCDSurfaceLib.logic import CccdError, make_model

spacing, origin, first = np.array([1.0, 0.9, 2.0]), np.array([5.0, -3.0, 7.0]), np.array([2, 3, 4])
index = np.moveaxis(np.indices((22, 24, 10)), 0, -1)
ball = np.linalg.norm((index + first) * spacing + origin - [18.0, 10.0, 25.0], axis=-1) <= 8
voxels = slicer.vtkOrientedImageData()
voxels.SetExtent(*(int(end) for low, n in zip(first, ball.shape) for end in (low, low + n - 1)))
voxels.SetSpacing(*spacing)
voxels.SetOrigin(*origin)
voxels.GetPointData().SetScalars(numpy_to_vtk(ball.ravel(order="F").astype(np.uint8), deep=1))
scene, node = slicer.vtkMRMLScene(), slicer.vtkMRMLSegmentationNode()
scene.AddNode(node)
segments = node.GetSegmentation()
segments.SetSourceRepresentationName("Binary labelmap")
for name, image in (("ball", voxels), ("nothing", slicer.vtkOrientedImageData())):
    segment = slicer.vtkSegment()
    segment.SetName(name)
    segment.AddRepresentation("Binary labelmap", image)
    segments.AddSegment(segment, name)
command = [sys.argv[1], "-c", "import sys; from cccd.cli import main; sys.exit(main())"]
environment = {"PYTHONPATH": sys.argv[2], "PATH": "/usr/bin:/bin", "HOME": sys.argv[3]}
model, warnings = make_model(scene, node, "ball", command, "every slice", environment)
points = vtk_to_numpy(model.GetPolyData().GetPoints().GetData())
mass = vtk.vtkMassProperties()
mass.SetInputData(model.GetPolyData())
said = []
for segment, called in (("nothing", command), ("ball", ["/nowhere/cccd"]), ("none", command)):
    try:
        make_model(scene, node, segment, called, environment=environment)
    except CccdError as error:
        said.append(str(error))
middle = ((points.min(axis=0) + points.max(axis=0)) / 2).tolist()
voxel = float(spacing.prod())
print(json.dumps([model.GetName(), warnings, middle, mass.GetVolume() / (ball.sum() * voxel), said]))
"""


def test_a_segment_becomes_a_model_in_its_place(tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "extensions" / "slicer" / "CCCDSurface")}
    arguments = [PYTHON, "-c", SCRIPT, sys.executable, str(ROOT / "scripts"), str(tmp_path)]
    done = subprocess.run(arguments, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    name, warnings, middle, volume, said = json.loads(done.stdout.splitlines()[-1])
    assert (name, warnings) == ("ball smooth", [])
    assert middle == pytest.approx([18, 10, 25], abs=0.3)
    assert volume == pytest.approx(1, abs=0.02)
    assert "is empty" in said[0]
    assert "cannot be run" in said[1]
    assert said[2] == "there is no segment none"
