"""Optional parts: which extra of the package brings a module, and one line for the one that is missing."""

from __future__ import annotations

import contextlib
import importlib.util
from collections.abc import Generator

from cccd.errors import InputError

#: Modules of each extra, by what they are imported as; ``pyproject.toml`` names their distributions. Where
#: nobody says what a module was needed for, the first extra that brings it is named.
EXTRAS: dict[str, tuple[str, ...]] = {
    "dicom": ("pydicom", "highdicom"),
    "gnn": ("torch", "torch_geometric"),
    "segment": ("monai", "torch"),
    "comparisons": ("itk", "open3d"),
    "s3": ("boto3", "botocore"),
    "cad": ("OCP",),
    "fe": ("pytetwild",),
    "print": ("lib3mf",),
    "usd": ("pxr",),
    "zarr": ("zarr",),
}


def missing_extra(error: ModuleNotFoundError, location: str, extra: str = "") -> InputError:
    """Say in one line what is not installed, and how to install it.

    Parameters
    ----------
    error : ModuleNotFoundError
        Of an import.
    location : str
        What needed it.
    extra : str
        The extra of what was asked for; it is named where it brings the module, though others do as well.

    Examples
    --------
    >>> print(missing_extra(ModuleNotFoundError("", name="torch.nn"), "maps.nii.gz"))
    maps.nii.gz: torch is not installed; in CCCD's checkout: pip install '.[gnn]'
    """
    module = _top_level(error)
    bringing = [name for name, modules in EXTRAS.items() if module in modules]
    named = extra if extra in bringing else [*bringing, "all"][0]
    return InputError(location, f"{module} is not installed", how_to_install(named))


def _top_level(error: ModuleNotFoundError) -> str:
    return (error.name or str(error)).split(".")[0]


@contextlib.contextmanager
def needing(location: str, extra: str = "") -> Generator[None]:
    """Raise that one line in place of a bare ``ModuleNotFoundError``; a decorator, too.

    Parameters
    ----------
    location, extra : str
        See `missing_extra`.

    Raises
    ------
    InputError
        A module of an extra is not there; any other that is missing raises as it does.

    Examples
    --------
    >>> with needing("liver.3mf", "print"):
    ...     raise ModuleNotFoundError("No module named 'lib3mf'", name="lib3mf")
    Traceback (most recent call last):
    cccd.errors.InputError: liver.3mf: lib3mf is not installed; in CCCD's checkout: pip install '.[print]'
    """
    try:
        yield
    except ModuleNotFoundError as error:
        if not any(_top_level(error) in modules for modules in EXTRAS.values()):
            raise
        raise missing_extra(error, location, extra) from None


def check_extra(extra: str, location: str) -> None:
    """Refuse what needs an extra that is not installed; nothing is imported.

    Parameters
    ----------
    extra : str
        One of `EXTRAS`.
    location : str
        What needs it.

    Raises
    ------
    InputError
        One of its modules is not there.
    """
    for module in EXTRAS[extra]:
        if importlib.util.find_spec(module) is None:
            raise missing_extra(ModuleNotFoundError(name=module), location, extra)


def how_to_install(extra: str) -> str:
    """Say how an extra gets installed: from the checkout, as the registries have no ``cccd`` of ours.

    Examples
    --------
    >>> how_to_install("cad")
    "in CCCD's checkout: pip install '.[cad]'"
    """
    return f"in CCCD's checkout: pip install '.[{extra}]'"
