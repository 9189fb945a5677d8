"""Which files of some packages a script needs: the transitive closure of its imports, read as text."""

from __future__ import annotations

import ast
import functools
from collections.abc import Iterable, Iterator
from pathlib import Path


@functools.cache
def _direct_imports(path: Path, libraries: tuple[Path, ...]) -> frozenset[Path]:
    """Files of the packages ``libraries`` that ``path`` imports itself, their ``__init__`` included."""
    inside = (path.relative_to(library.parent) for library in libraries if path.is_relative_to(library))
    package = next((place.parts[:-1] for place in inside), ())
    names = set()
    for node in _statements(ast.parse(path.read_text(encoding="utf-8"), filename=str(path))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            parents = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join((*parents, *filter(None, [node.module])))
            names.update([base, *(f"{base}.{alias.name}" for alias in node.names)])
    return frozenset().union(*(_module_files(name, libraries) for name in names if name))


def _statements(block: ast.AST) -> Iterator[ast.AST]:
    """Statements in a block and in the blocks within it: no expression imports, and most nodes are those."""
    for part in ("body", "orelse", "finalbody", "handlers", "cases"):
        inner = getattr(block, part, ())
        for node in inner if isinstance(inner, list) else ():  # a conditional expression's is none
            yield node
            yield from _statements(node)


@functools.cache
def _module_files(name: str, libraries: tuple[Path, ...]) -> frozenset[Path]:
    """Files of a dotted name in the packages ``libraries``: the module's, its packages' ``__init__``."""
    parts = name.split(".")
    roots = [library.parent for library in libraries if library.name == parts[0]]  # else somebody else's
    stems = [root.joinpath(*parts[:end]) for root in roots for end in range(1, len(parts) + 1)]
    return frozenset(
        file for stem in stems for file in (stem.with_suffix(".py"), stem / "__init__.py") if file.is_file()
    )


def imported_files(script: Path, libraries: Iterable[Path], modules: Iterable[str] = ()) -> list[Path]:
    """All files of some packages that running ``script`` can import, sorted, without ``script`` itself.

    Imports inside functions count too. Snakemake does not see an edit in an imported module; declared
    as inputs, these files make their stage run again.

    Parameters
    ----------
    script : path
        A Python file, within the packages or elsewhere.
    libraries : iterable of path
        The packages' own folders.
    modules : iterable of str
        Modules that the script imports by a name it is given, e.g. ``cccd_paper.comparisons.k_sweep``.
    """
    folders = tuple(libraries)
    found: set[Path] = set()
    pending = {script}.union(*(_module_files(module, folders) for module in modules))
    while pending:
        found |= pending
        pending = set().union(*(_direct_imports(path, folders) for path in pending)) - found
    return sorted(found - {script})
