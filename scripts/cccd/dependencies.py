"""Which files of a source folder a script needs: the transitive closure of its imports, read as text."""

from __future__ import annotations

import ast
import functools
from pathlib import Path

__all__ = ["imported_files"]


@functools.cache
def _direct_imports(path: Path, folder: Path) -> frozenset[Path]:
    """Files below ``folder`` that ``path`` imports itself, the ``__init__`` of their packages included."""
    package = path.relative_to(folder).parts[:-1]
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"), filename=str(path))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join((*parents, *filter(None, [node.module])))
            names.update([base, *(f"{base}.{alias.name}" for alias in node.names)])
    stems = {
        folder.joinpath(*parts[:end])
        for parts in (n.split(".") for n in names if n)
        for end in range(1, len(parts) + 1)
    }
    return frozenset(
        file for stem in stems for file in (stem.with_suffix(".py"), stem / "__init__.py") if file.is_file()
    )


def imported_files(script: Path, folder: Path) -> list[Path]:
    """All files below ``folder`` that running ``script`` can import, sorted, without ``script`` itself.

    Imports inside functions count too. Snakemake does not see an edit in an imported module; declared
    as inputs, these files make their stage run again.

    Parameters
    ----------
    script : path
        A Python file below ``folder``.
    folder : path
        The folder on ``sys.path``.
    """
    found: set[Path] = set()
    pending = {script}
    while pending:
        found |= pending
        pending = set().union(*(_direct_imports(path, folder) for path in pending)) - found
    return sorted(found - {script})
