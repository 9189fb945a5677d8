"""3D Slicer's own converter of a mask to a closed surface, in the Python that has ``slicer-core``.

``python convert_by_slicer.py GIVEN MADE``: ``GIVEN`` is an NPZ file of a mask (i, j, k), its affine (4, 4)
and settings (n, 4): surface nets or flying edges, the nets' own smoothing or windowed sinc, decimation,
smoothing factor. ``MADE`` gets points, triangles and processor seconds of each.
"""

import sys
import time
from pathlib import Path

import numpy as np


def convert(given: Path, made: Path) -> None:
    """Convert a mask by every setting of a file, as Slicer's segmentations do."""
    from slicer_core import vtkSegmentationCore  # pyright: ignore[reportMissingImports]
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkFiltersCore import vtkTriangleFilter

    file = np.load(given)
    image = vtkSegmentationCore.vtkOrientedImageData()
    image.SetDimensions(*file["mask"].shape)
    image.GetPointData().SetScalars(numpy_to_vtk(file["mask"].ravel(order="F"), deep=1))
    image.SetImageToWorldMatrix(_matrix(file["affine"]))
    results = {}
    for number, (nets, inside, decimation, smoothing) in enumerate(file["settings"].tolist()):
        rule = vtkSegmentationCore.vtkBinaryLabelmapToClosedSurfaceConversionRule()
        rule.SetConversionParameter(rule.GetConversionMethodParameterName(), str(int(nets)))
        rule.SetConversionParameter(rule.GetSurfaceNetInternalSmoothingParameterName(), str(int(inside)))
        rule.SetConversionParameter(rule.GetDecimationFactorParameterName(), str(decimation))
        rule.SetConversionParameter(rule.GetSmoothingFactorParameterName(), str(smoothing))
        segment = vtkSegmentationCore.vtkSegment()
        segment.SetLabelValue(1)
        segment.AddRepresentation(rule.GetSourceRepresentationName(), image)
        started = time.process_time()
        rule.Convert(segment)
        results[f"seconds_{number}"] = time.process_time() - started
        triangles = vtkTriangleFilter()  # surface nets leave some quads
        triangles.SetInputData(segment.GetRepresentation(rule.GetTargetRepresentationName()))
        triangles.Update()
        surface = triangles.GetOutput()
        results[f"points_{number}"] = vtk_to_numpy(surface.GetPoints().GetData())
        results[f"faces_{number}"] = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    np.savez(made, **results)


def _matrix(affine: np.ndarray):
    from vtkmodules.vtkCommonMath import vtkMatrix4x4

    matrix = vtkMatrix4x4()
    matrix.DeepCopy(affine.ravel().tolist())
    return matrix


if __name__ == "__main__":
    convert(*map(Path, sys.argv[1:]))
