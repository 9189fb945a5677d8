"""Optional parts: which extra of the package brings a module, and one line for the one that is missing."""

from __future__ import annotations

import importlib.util

from cccd.errors import InputError

__all__ = ["EXTRAS", "check_extra", "how_to_install", "missing_extra"]

#: Modules of each extra, by what they are imported as; ``pyproject.toml`` names their distributions.
EXTRAS: dict[str, tuple[str, ...]] = {
    "dicom": ("pydicom", "highdicom"),
    "gnn": ("torch", "torch_geometric"),
    "segment": ("monai", "torch", "pandas"),
    "view": ("pyvista",),
    "report": ("matplotlib", "jinja2", "markupsafe", "pandas", "PIL", "fast_simplification"),
    "comparisons": ("itk", "open3d"),
    "s3": ("boto3", "botocore"),
    "cad": ("OCP",),
    "fe": ("pytetwild",),
    "print": ("lib3mf",),
    "run": ("snakemake", "jsonschema", "nilearn"),
}


def missing_extra(error: ModuleNotFoundError, location: str) -> InputError:
    """Say in one line what is not installed, and how to install it.

    Parameters
    ----------
    error : ModuleNotFoundError
        Of an import.
    location : str
        What needed it.

    Examples
    --------
    >>> print(missing_extra(ModuleNotFoundError("", name="torch.nn"), "maps.nii.gz"))
    maps.nii.gz: torch is not installed; in CCCD's checkout: pip install '.[gnn]'
    """
    module = (error.name or str(error)).split(".")[0]
    extra = next((extra for extra, modules in EXTRAS.items() if module in modules), "all")
    return _not_installed(module, extra, location)


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
            raise _not_installed(module, extra, location)


def _not_installed(module: str, extra: str, location: str) -> InputError:
    return InputError(location, f"{module} is not installed", how_to_install(extra))


def how_to_install(extra: str) -> str:
    """Say how an extra gets installed: from the checkout, as the registries have no ``cccd`` of ours.

    Examples
    --------
    >>> how_to_install("cad")
    "in CCCD's checkout: pip install '.[cad]'"
    """
    return f"in CCCD's checkout: pip install '.[{extra}]'"
