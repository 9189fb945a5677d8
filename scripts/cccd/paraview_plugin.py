"""ParaView's filter "CCCD smooth surface": labels of an image become a smooth closed surface.

In ParaView: Tools > Manage Plugins > Load New, and choose this file; `cccd` must be installed in the Python
that ParaView uses. In VTK and PyVista `SmoothSurface` is a filter like any other.
"""

from __future__ import annotations

import logging
from importlib import import_module
from typing import Any

import numpy as np
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase

from cccd.errors import InputError
from cccd.geometry.arrays import BoolArray, FloatArray

try:
    paraview: Any = import_module("paraview.util.vtkAlgorithm")
except ImportError:  # plain VTK
    paraview = None

__all__ = ["SmoothSurface", "voxel_grid", "voxels_of"]


class SmoothSurface(VTKPythonAlgorithmBase):
    """A filter from an image of labels (``vtkImageData``) to the surface of one label (``vtkPolyData``).

    Examples
    --------
    >>> import numpy as np, pyvista as pv
    >>> image = pv.ImageData(dimensions=(24, 24, 12), spacing=(1, 1, 2))
    >>> away = np.linalg.norm(image.points - [12, 12, 12], axis=1)
    >>> image["organ"] = (away <= 8).astype(np.uint8)
    >>> found = SmoothSurface()
    >>> found.SetInputDataObject(image)
    >>> _ = found.Update()
    >>> surface = pv.wrap(found.GetOutputDataObject(0))
    >>> surface.is_manifold, bool(abs(surface.volume / (2 * image["organ"].sum()) - 1) < 0.01)
    (True, True)
    """

    def __init__(self) -> None:
        super().__init__(nInputPorts=1, nOutputPorts=1, inputType="vtkImageData", outputType="vtkPolyData")
        self._label, self._annotated = 0, 0

    def SetLabel(self, label: int) -> None:  # noqa: N802 - VTK's way
        """Choose the organ's value; 0: all values but 0."""
        self._label = int(label)
        self.Modified()

    def SetAnnotated(self, rule: int) -> None:  # noqa: N802
        """Choose which slices are annotated: 0 auto, 1 those that are not empty, 2 every slice."""
        self._annotated = int(rule)
        self.Modified()

    def RequestData(self, _: Any, given: Any, made: Any) -> int:  # noqa: N802
        """Make the surface; what is wrong with the image is VTK's error, one line."""
        from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData

        import cccd
        from cccd.inputs.annotation import AUTO, EVERY_SLICE, NONEMPTY

        try:
            voxels, affine = voxels_of(vtkImageData.GetData(given[0]), self._label)
            rule = (AUTO, NONEMPTY, EVERY_SLICE)[self._annotated]
            surface = cccd.reconstruct(voxels, affine, annotated=rule)
        except cccd.InputError as error:
            logging.getLogger(__name__).error("%s", error)
            return 0
        vtkPolyData.GetData(made).ShallowCopy(surface.lofted.mesh.to_vtk())
        return 1


def voxels_of(image: Any, label: int) -> tuple[BoolArray, FloatArray]:
    """Voxels (a, b, c) of a label in a ``vtkImageData``, of its points or else cells; their affine (4, 4).

    Raises
    ------
    InputError
        No active array with one value per voxel.
    """
    from vtkmodules.util.numpy_support import vtk_to_numpy

    scalars, on_cells = image.GetPointData().GetScalars(), 0
    if scalars is None:
        scalars, on_cells = image.GetCellData().GetScalars(), 1
    if scalars is None or scalars.GetNumberOfComponents() != 1:
        raise InputError("the image", "it has no active array of labels", "choose one with a value per voxel")
    shape, affine = voxel_grid(image, on_cells)
    values = vtk_to_numpy(scalars).reshape(shape, order="F")
    return np.asarray(values == label if label else values != 0), affine


def voxel_grid(image: Any, on_cells: int) -> tuple[tuple[int, ...], FloatArray]:
    """Shape (3,) and affine (4, 4) of the voxels of a ``vtkImageData``: its points, or its cells."""
    matrix = image.GetIndexToPhysicalMatrix()
    affine = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
    affine[:3, 3] += affine[:3, :3] @ (np.array(image.GetExtent()[::2]) + on_cells / 2)
    return tuple(max(n - on_cells, 1) for n in image.GetDimensions()), affine


if paraview is not None:  # what ParaView shows of it
    _rule = (
        '<IntVectorProperty name="Annotated" command="SetAnnotated" number_of_elements="1" '
        'default_values="0"><EnumerationDomain name="rule"><Entry text="auto" value="0"/>'
        '<Entry text="nonempty" value="1"/><Entry text="every slice" value="2"/></EnumerationDomain>'
        "</IntVectorProperty>"
    )
    _number = paraview.smproperty.intvector(name="Label", default_values=0)
    SmoothSurface.SetLabel = _number(SmoothSurface.SetLabel)
    SmoothSurface.SetAnnotated = paraview.smproperty.xml(_rule)(SmoothSurface.SetAnnotated)
    _images = paraview.smdomain.datatype(dataTypes=["vtkImageData"], composite_data_supported=False)
    _input = paraview.smproperty.input(name="Input")
    SmoothSurface = paraview.smproxy.filter(label="CCCD smooth surface")(_input(_images(SmoothSurface)))
