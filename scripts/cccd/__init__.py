"""Smooth, watertight spline surfaces of organs from stacks of CT and MR slices.

>>> import cccd
>>> structure = cccd.read("labels.nii.gz", 5)  # doctest: +SKIP
>>> surface = cccd.reconstruct(structure)  # doctest: +SKIP
>>> surface.write("liver.stl")  # doctest: +SKIP

Read
    `labels` lists what a file holds; `read` loads one structure of it as a `Structure`.
Reconstruct
    `reconstruct` makes a `Surface` of one structure, `reconstruct_labels` one of each label of a map, with
    shared walls; `smooth_mesh` makes one of a mesh.
Use
    `Surface.mesh` is the triangle mesh in mm (RAS), `Surface.bodies` the closed splines (`ControlMesh`),
    `Surface.write` writes a file by its suffix, `compare` measures how far two agree.
Step by step
    `order` turns boundary pixels into `Curves`, `fit_contours` fits splines to them (`FittedCurves`).

`help(cccd.reconstruct)` and the others have units, shapes, errors and examples. `Settings` holds every
setting; docs/configuration.md explains them. Wrong input raises `InputError`, whose message is one line. The
command `cccd --help` does the same from a shell.
"""

# Public names load when they are first asked for. The library never sees `snakemake`, and its imports run one
# way (CONTRIBUTING.md). The packages around it add what they have (`cccd.plugins`).
# pyright: reportUnsupportedDunderAll=false

__version__ = "1.0.0"

__all__ = [
    "ControlMesh",
    "Curves",
    "FittedCurves",
    "InputError",
    "Settings",
    "Structure",
    "Surface",
    "__version__",
    "compare",
    "fit_contours",
    "labels",
    "order",
    "read",
    "reconstruct",
    "reconstruct_labels",
    "smooth_mesh",
]


def __getattr__(name: str) -> object:
    """Load a public name when it is first asked for (PEP 562); the types stand in ``__init__.pyi``."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from cccd.plugins import find, row

    # by name, so that no job of the workflow counts all of the library among its own
    value = find(row("API", name))
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
