"""What a rule's jobs request of memory and time, and the digest of the code that they run."""

from __future__ import annotations

import functools
import hashlib
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from cccd_workflow.dependencies import imported_files

#: Every further attempt gets so many times the memory of the one before.
_GROWTH = 1.5


def memory(base_mb: int, per_input_mb: int = 0) -> Callable[[Any, Iterable[str], int], int]:
    """Make a ``mem_mb`` function: it grows with the inputs' size and with every attempt.

    Parameters
    ----------
    base_mb : int
        What the smallest job needs.
    per_input_mb : int, optional
        MB for each MB of input that is there when the function is called.

    Examples
    --------
    >>> memory(1000)(None, [], 2)
    1500
    """

    # Snakemake passes these by name
    def mem_mb(wildcards: Any, input: Iterable[str], attempt: int) -> int:
        # not Snakemake's slow input.size_mb; files that a group is yet to write are no error here
        sized = input if per_input_mb else ()
        size_mb = sum(os.path.getsize(file) for file in sized if os.path.exists(file)) / 2**20
        return int((base_mb + per_input_mb * size_mb) * _GROWTH ** (attempt - 1))

    return mem_mb


def minutes(base: int) -> Callable[[Any, int], int]:
    """Make a ``runtime`` function: every attempt gets the base time again.

    Examples
    --------
    >>> minutes(20)(None, 3)
    60
    """

    def runtime(wildcards: Any, attempt: int) -> int:
        return base * attempt

    return runtime


@functools.cache
def digest(script: Path, libraries: tuple[Path, ...], functions: tuple[str, ...]) -> str:
    """Return the SHA-256 of the library files that a script imports: editing one runs its stage again.

    One parameter, because twenty files among the inputs of every job treble the time to plan.

    Parameters
    ----------
    script : path
        The job's script, which Snakemake watches itself.
    libraries : tuple of path
        Folders of this project's packages.
    functions : tuple of str
        Dotted paths of functions and classes that the script is given to call: their modules count too.
    """
    modules = [function.rpartition(".")[0] for function in functions]
    return digest_files(imported_files(script, libraries, modules))


def digest_files(files: Iterable[Path]) -> str:
    """Return the SHA-256 of what some files hold."""
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in files)).hexdigest()
