"""Smooth, watertight B-spline surfaces of organs from stacks of slices.

>>> import cccd
>>> surface = cccd.reconstruct(cccd.read("liver.nii.gz"))  # doctest: +SKIP
>>> surface.write("liver.stl")  # doctest: +SKIP

What is public stands in ``__all__``, and is loaded when it is first asked for. The library behind it never
sees ``snakemake``: arrays and small dataclasses go in and come out. Imports run one way: geometry -> volumes
-> boundary -> chaincode and tracing -> junctions -> curves -> surface -> comparisons -> report, with
``errors``, ``tolerances``, ``settings``, ``containers``, ``metrics`` and ``store`` underneath.
"""

# pyright: reportUnsupportedDunderAll=false

__version__ = "0.2.0"

__all__ = [
    "ControlMesh",
    "Curves",
    "FittedCurves",
    "InputError",
    "Patch",
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
]


def __getattr__(name: str) -> object:
    """Load a public name when it is first asked for (PEP 562); the types stand in ``__init__.pyi``."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    # by name, so that no job of the workflow counts all of the library among its own
    value = getattr(import_module("cccd.api"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
