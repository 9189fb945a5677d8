"""From a segment to a smooth model: `cccd` runs as a program of its own, on files in a temporary folder."""

from __future__ import annotations

import os
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import slicer  # pyright: ignore[reportMissingImports]
import vtk

__all__ = ["CccdError", "load_model", "make_model", "run_cccd", "write_segment"]


class CccdError(RuntimeError):
    """What `cccd` says in one line."""


def make_model(
    scene: Any,
    segmentation: Any,
    segment: str,
    command: Sequence[str] = ("cccd",),
    annotated: str = "auto",
    environment: Mapping[str, str] | None = None,
) -> tuple[Any, list[str]]:
    """Make a smooth closed model of a segment.

    Parameters
    ----------
    scene : vtkMRMLScene
        The model is added to it.
    segmentation : vtkMRMLSegmentationNode
    segment : str
        The segment's identifier.
    command : sequence of str
        How `cccd` is called.
    annotated : {"auto", "nonempty", "every slice"}
        Which slices are annotated; the others are filled.
    environment : mapping, optional
        The program's. Slicer's own makes other Pythons fail: give ``slicer.util.startupEnvironment()``.

    Returns
    -------
    model : vtkMRMLModelNode
    warnings : list of str

    Raises
    ------
    CccdError
        The segment is empty, `cccd` is not there, or refuses the segment.
    """
    with tempfile.TemporaryDirectory() as folder:
        labels, surface = Path(folder) / "segment.nrrd", Path(folder) / "segment.ply"
        write_segment(scene, segmentation, segment, labels)
        warnings = run_cccd(
            [*command, "surface", str(labels), "-o", str(surface), "--annotated", annotated], environment
        )
        name = f"{segmentation.GetSegmentation().GetSegment(segment).GetName()} smooth"
        return load_model(scene, surface, name), warnings


def write_segment(scene: Any, segmentation: Any, segment: str, path: Path) -> None:
    """Write a segment's voxels as NRRD, in the place where they lie."""
    voxels = slicer.vtkOrientedImageData()
    found = segmentation.GetSegmentation().GetSegment(segment)
    if found is None:
        raise CccdError(f"there is no segment {segment}")
    segmentation.GetBinaryLabelmapRepresentation(segment, voxels)
    if 0 in voxels.GetDimensions() or not voxels.GetScalarRange()[1]:
        raise CccdError(f"the segment {found.GetName()} is empty: draw it on three slices or more")
    to_world, first = vtk.vtkMatrix4x4(), voxels.GetExtent()[::2]
    voxels.GetImageToWorldMatrix(to_world)
    corner = to_world.MultiplyPoint([*first, 1])
    for axis in range(3):  # the file's voxels begin at 0, wherever the segment's do
        to_world.SetElement(axis, 3, corner[axis])
    image = vtk.vtkImageData()
    image.DeepCopy(voxels)
    image.SetExtent([end for n in voxels.GetDimensions() for end in (0, n - 1)])
    image.SetOrigin(0, 0, 0)
    image.SetSpacing(1, 1, 1)
    node = slicer.vtkMRMLLabelMapVolumeNode()
    scene.AddNode(node)
    try:
        node.SetAndObserveImageData(image)
        node.SetIJKToRASMatrix(to_world)
        storage = slicer.vtkMRMLNRRDStorageNode()
        storage.SetFileName(str(path))
        if not storage.WriteData(node):
            raise CccdError(f"{path} cannot be written")
    finally:
        scene.RemoveNode(node)


def run_cccd(command: Sequence[str], environment: Mapping[str, str] | None = None) -> list[str]:
    """Run the program and return its warnings."""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, env=dict(environment or os.environ)
        )
    except OSError as error:
        raise CccdError(
            f"{command[0]} cannot be run ({error.strerror}): name it in the field cccd"
        ) from error
    lines = [line.strip() for line in (done.stdout + done.stderr).splitlines() if line.strip()]
    if done.returncode:
        raise CccdError(lines[-1] if lines else f"{command[0]} ended with {done.returncode}")
    return [line.removeprefix("warning: ") for line in lines if line.startswith("warning: ")]


def load_model(scene: Any, path: Path, name: str) -> Any:
    """Load a surface, which is in mm RAS, into the scene."""
    storage = slicer.vtkMRMLModelStorageNode()
    storage.SetFileName(str(path))
    storage.SetCoordinateSystem(slicer.vtkMRMLStorageNode.CoordinateSystemRAS)
    model = slicer.vtkMRMLModelNode()
    model.SetName(name)
    scene.AddNode(model)
    if not storage.ReadData(model):
        scene.RemoveNode(model)
        raise CccdError(f"{path} cannot be read")
    return model
