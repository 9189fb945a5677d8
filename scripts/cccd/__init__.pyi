from cccd.api import (
    ControlMesh,
    Curves,
    FittedCurves,
    InputError,
    Settings,
    Structure,
    Surface,
    fit_contours,
    labels,
    order,
    read,
    reconstruct,
    reconstruct_labels,
    smooth_mesh,
)

__version__: str

__all__ = [
    "ControlMesh",
    "Curves",
    "FittedCurves",
    "InputError",
    "Settings",
    "Structure",
    "Surface",
    "__version__",
    "fit_contours",
    "labels",
    "order",
    "read",
    "reconstruct",
    "reconstruct_labels",
    "smooth_mesh",
]
