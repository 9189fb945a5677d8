"""GIfTI, as FreeSurfer, Connectome Workbench and fMRIPrep keep surfaces; usually called ``.surf.gii``."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import numpy as np
from nibabel.gifti.gifti import GiftiCoordSystem, GiftiDataArray, GiftiImage, GiftiMetaData

from cccd.surface.formats import NOTE, Scan
from cccd.surface.surface import Surface

__all__ = ["write"]

#: NIfTI's code of the scanner's space.
SCANNER = 1


def write(path: Path, surface: Surface, scan: Scan) -> None:
    """Write the mesh in mm RAS (scanner's space): float32, as the format has it."""
    points = GiftiDataArray(
        np.asarray(surface.vertices, np.float32),
        intent="NIFTI_INTENT_POINTSET",
        datatype="NIFTI_TYPE_FLOAT32",
        coordsys=GiftiCoordSystem(SCANNER, SCANNER, np.eye(4)),
        # programs for cortices want to know which one it is
        meta=GiftiMetaData({"AnatomicalStructurePrimary": "Other", "GeometricType": "Anatomical"}),
    )
    triangles = GiftiDataArray(
        np.asarray(surface.faces, np.int32), intent="NIFTI_INTENT_TRIANGLE", datatype="NIFTI_TYPE_INT32"
    )
    about = GiftiMetaData({"Name": scan.organ, "Description": NOTE})
    image = cast(Any, GiftiImage(meta=about, darrays=[points, triangles]))
    path.write_bytes(image.to_xml())
