"""Which files of a package a script needs: the transitive closure of its imports, read as text."""

from __future__ import annotations

import ast
import functools
from collections.abc import Iterable, Iterator
from pathlib import Path

__all__ = ["imported_files"]


@functools.cache
def _direct_imports(path: Path, library: Path) -> frozenset[Path]:
    """Files of the package ``library`` that ``path`` imports itself, its packages' ``__init__`` included."""
    package = path.relative_to(library.parent).parts[:-1] if path.is_relative_to(library) else ()
    names = set()
    for node in _statements(ast.parse(path.read_text(encoding="utf-8"), filename=str(path))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join((*parents, *filter(None, [node.module])))
            names.update([base, *(f"{base}.{alias.name}" for alias in node.names)])
    return frozenset().union(*(_module_files(name, library) for name in names if name))


def _statements(block: ast.AST) -> Iterator[ast.AST]:
    """Statements in a block and in the blocks within it: no expression imports, and most nodes are those."""
    for part in ("body", "orelse", "finalbody", "handlers", "cases"):
        inner = getattr(block, part, ())
        for node in inner if isinstance(inner, list) else ():  # a conditional expression's is none
            yield node
            yield from _statements(node)


@functools.cache
def _module_files(name: str, library: Path) -> frozenset[Path]:
    """Files of the package ``library`` of a dotted name: the module's, its packages' ``__init__``."""
    parts = name.split(".")
    if parts[0] != library.name:
        return frozenset()  # somebody else's
    stems = [library.parent.joinpath(*parts[:end]) for end in range(1, len(parts) + 1)]
    return frozenset(
        file for stem in stems for file in (stem.with_suffix(".py"), stem / "__init__.py") if file.is_file()
    )


def imported_files(script: Path, library: Path, modules: Iterable[str] = ()) -> list[Path]:
    """All files of a package that running ``script`` can import, sorted, without ``script`` itself.

    Imports inside functions count too. Snakemake does not see an edit in an imported module; declared
    as inputs, these files make their stage run again.

    Parameters
    ----------
    script : path
        A Python file, within the package or elsewhere.
    library : path
        The package's own folder.
    modules : iterable of str
        Modules that the script imports by a name it is given, e.g. ``cccd.comparisons.k_sweep``.
    """
    found: set[Path] = set()
    pending = {script}.union(*(_module_files(module, library) for module in modules))
    while pending:
        found |= pending
        pending = set().union(*(_direct_imports(path, library) for path in pending)) - found
    return sorted(found - {script})
