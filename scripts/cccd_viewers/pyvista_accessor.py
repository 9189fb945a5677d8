"""``image.cccd`` on PyVista's images: from a mask in a notebook to its surface.

PyVista imports this module by its entry point when somebody first asks an image for it; in a checkout that
is not installed, ``import cccd_viewers.pyvista_accessor`` does.
"""

from __future__ import annotations

import numpy as np
import pyvista as pv

from cccd.api import Surface, reconstruct
from cccd.errors import InputError
from cccd.settings.root import Settings


@pv.register_dataset_accessor("cccd", pv.ImageData)
class ImageAccessor:
    """What `cccd` makes of an image whose values are a mask or labels.

    Examples
    --------
    >>> import numpy as np, pyvista as pv, cccd_viewers.pyvista_accessor
    >>> i, j, k = np.indices((24, 24, 12)) - np.array([12, 12, 6]).reshape(3, 1, 1, 1)
    >>> image = pv.ImageData(dimensions=(24, 24, 12), spacing=(1, 1, 2))
    >>> image["ball"] = (np.hypot(np.hypot(i, j), 2 * k) <= 8).ravel(order="F")
    >>> surface = image.cccd.surface("ball")
    >>> surface.is_manifold, bool(abs(surface.volume / (2 * image["ball"].sum()) - 1) < 0.01)
    (True, True)
    """

    def __init__(self, image: pv.ImageData) -> None:
        self._image = image

    def reconstruct(
        self, scalars: str | None = None, label: int | None = None, settings: Settings | None = None
    ) -> Surface:
        """Make a smooth closed surface.

        Parameters
        ----------
        scalars : str, optional
            Array of the image's points or cells; the active one by default.
        label : int, optional
            The organ's value; by default all but 0.
        settings : Settings, optional
            The configuration, section by section.

        Returns
        -------
        Surface
            In the image's own coordinates.

        Raises
        ------
        InputError
            No such array, more than one value per voxel, no voxel of the label, too few slices.
        """
        image, name = self._image, scalars or self._image.active_scalars_name
        if name is None or name not in image.array_names:
            known = ", ".join(image.array_names) or "none"
            raise InputError(str(name), "the image has no such array", f"there are: {known}")
        on_cells = name not in image.point_data
        values = np.asarray((image.cell_data if on_cells else image.point_data)[name])
        if values.ndim != 1:
            raise InputError(name, "it has more than one value per voxel", "give a mask or a label map")
        shape = tuple(max(n - on_cells, 1) for n in image.dimensions)
        affine = np.array(image.index_to_physical_matrix)
        affine[:3, 3] += affine[:3, :3] @ (np.array(image.extent[::2]) + on_cells / 2)
        voxels = values.reshape(shape, order="F")
        if label is not None:
            voxels = voxels == label
        return reconstruct(voxels, affine, settings=settings)

    def surface(
        self, scalars: str | None = None, label: int | None = None, settings: Settings | None = None
    ) -> pv.PolyData:
        """Return the mesh of `reconstruct`, to be drawn."""
        return self.reconstruct(scalars, label, settings).to_pyvista()
