"""Surfaces by programs that people use on masks: niimath and 3D Slicer, each run as it is.

Both are optional. niimath (``pip install niimath``) is found on the PATH. Slicer's converters
(``pip install slicer-core``) pin a VTK, so they live in an environment of their own, whose Python the
environment variable ``CCCD_SLICER_PYTHON`` names.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyvista as pv

from cccd.containers import Structure
from cccd.errors import InputError
from cccd.geometry.mesh import Mesh
from cccd.inputs.nifti_export import write_nifti
from cccd_paper.comparisons import convert_by_slicer
from cccd_paper.comparisons.timing import timed
from cccd_paper.comparisons.volume_meshes import from_polydata

NIIMATH, SLICER = "niimath", "slicer-core"

#: Names the Python that has slicer-core.
SLICER_PYTHON = "CCCD_SLICER_PYTHON"


class Niimath(NamedTuple):
    """Options of ``niimath -mesh``; as they stand here they are its own.

    Attributes
    ----------
    presmooth : int
        Whether the volume is smoothed before marching cubes (``-p``).
    reduced : float
        The share of the triangles that is left (``-r``).
    rounds : int
        Of smoothing the mesh (``-s``, Vollmer et al. 1999).
    """

    presmooth: int = 1
    reduced: float = 0.25
    rounds: int = 0

    @property
    def options(self) -> list[str]:
        """As the command has them."""
        return ["-p", str(self.presmooth), "-r", f"{self.reduced:g}", "-s", str(self.rounds)]

    def __str__(self) -> str:
        """Write it as the tables do."""
        return " ".join(self.options) + (", its defaults" if self == Niimath() else "")


class Slicer(NamedTuple):
    """Parameters of Slicer's conversion to a closed surface; as they stand here they are its own.

    Attributes
    ----------
    nets : bool
        Surface nets, not flying edges.
    inside : bool
        The nets' own smoothing, not windowed sinc.
    decimation : float
        Share of the triangles to be left out.
    smoothing : float
        Smoothing factor; the pass band is 10 to the power of -4 times it.
    """

    nets: bool = False
    inside: bool = False
    decimation: float = 0.0
    smoothing: float = 0.5

    def __str__(self) -> str:
        """Write it as the tables do."""
        inside = ", the nets' own smoothing" if self.inside else ""
        own = ", its defaults" if self == Slicer(self.nets) else ""
        return f"smoothing {self.smoothing:g}, decimation {self.decimation:g}{inside}{own}"


_DECIMATIONS, _SMOOTHINGS = (0.0, 0.5, 0.8), (0.25, 0.5, 0.75, 1.0)

#: What is tried of each. niimath without any smoothing is marching cubes, which has a row of its own.
NIIMATH_GRID = tuple(
    Niimath(presmooth, reduced, rounds)
    for presmooth, reduced, rounds in product((1, 0), (0.25, 1.0), (0, 10, 50))
    if presmooth or rounds
)
SLICER_EDGES = tuple(Slicer(False, False, *setting) for setting in product(_DECIMATIONS, _SMOOTHINGS))
SLICER_NETS = tuple(Slicer(True, *setting) for setting in product((False, True), _DECIMATIONS, _SMOOTHINGS))


def has_niimath() -> bool:
    """Whether niimath is on the PATH."""
    return shutil.which(NIIMATH) is not None


def has_slicer() -> bool:
    """Whether the environment names a Python that has Slicer's converters."""
    return SLICER_PYTHON in os.environ


def by_niimath(structure: Structure, settings: Sequence[Niimath]) -> Iterator[tuple[Mesh, float]]:
    """Mesh a mask by niimath's marching cubes.

    Parameters
    ----------
    structure : Structure
        With a mask.
    settings : sequence of Niimath
        All parts are kept (``-l 0``): by itself niimath keeps the largest alone, one lung of two.

    Yields
    ------
    mesh : Mesh
        In world mm (RAS), outwards.
    seconds : float
        The whole command's, of the processor.
    """
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder) / "mask.nii", Path(folder) / "mesh.ply"
        write_nifti(given, *_padded(structure))
        for setting in settings:
            command = [NIIMATH, given, "-mesh", "-i", "0.5", "-l", "0", "-v", "0", *setting.options, made]
            _, seconds = timed(
                _run, command, NIIMATH, "niimath did not mesh the mask", "pip install -U niimath"
            )
            yield from_polydata(pv.read(made)).outwards(), seconds


def by_slicer(structure: Structure, settings: Sequence[Slicer]) -> Iterator[tuple[Mesh, float]]:
    """Mesh a mask as 3D Slicer's segmentations do, by Slicer's own code.

    Parameters
    ----------
    structure : Structure
        With a mask.
    settings : sequence of Slicer

    Yields
    ------
    mesh : Mesh
        In world mm (RAS), outwards.
    seconds : float
        The conversion's, of the processor, in a process that has loaded what it needs.

    Raises
    ------
    InputError
        The Python that the environment names has no slicer-core.
    """
    mask, affine = _padded(structure)
    with tempfile.TemporaryDirectory() as folder:
        given, made = Path(folder) / "given.npz", Path(folder) / "made.npz"
        np.savez(given, mask=mask, affine=affine, settings=np.array(settings, float))
        python = os.environ[SLICER_PYTHON]
        command = [python, convert_by_slicer.__file__, given, made]
        hint = "name a Python that has it: python -m venv slicer && slicer/bin/pip install slicer-core"
        _run(command, f"{SLICER_PYTHON} {python}", "slicer-core did not mesh the mask", hint)
        with np.load(made) as file:
            for number in range(len(settings)):
                mesh = Mesh(file[f"points_{number}"].astype(float), file[f"faces_{number}"].astype(np.int64))
                yield mesh.outwards(), float(file[f"seconds_{number}"])


def _padded(structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    """Mask of uint8 with a voxel of background all around, and the affine (4, 4) of its indices."""
    stack = structure.required_stack("mask")
    mask = np.pad(np.moveaxis(stack, 0, structure.frame.slice_axis), 1).astype(np.uint8)
    affine = structure.frame.affine.copy()
    affine[:3, 3] += affine[:3, :3] @ (np.asarray(structure.origin) - 1)
    return mask, affine


def _run(command: list[str | Path], location: str, problem: str, hint: str) -> None:
    try:
        subprocess.run(command, capture_output=True, text=True, check=True)
    except OSError as error:
        raise InputError(location, f"{problem} ({error.strerror})", hint) from error
    except subprocess.CalledProcessError as error:
        said = (error.stderr or error.stdout).strip().splitlines()
        raise InputError(location, f"{problem} ({said[-1] if said else error.returncode})", hint) from error
