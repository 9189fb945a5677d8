"""Say what is wrong with a value, and what would be right, in one line."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable
from typing import Any

__all__ = ["choices", "nearest"]


def nearest(
    word: str, candidates: Iterable[str], named: Callable[[str], str] = str, otherwise: str = ""
) -> str:
    """Return ``"did you mean 'x'?"`` for a near miss, otherwise ``"choose one of ..."`` or other advice.

    Parameters
    ----------
    word : str
    candidates : iterable of str
    named : callable
        Gives the part of each that is compared, such as a file's name without its suffix.

    >>> nearest("livre", ["liver", "spleen"])
    "did you mean 'liver'?"
    """
    known = list(candidates)
    lower = {named(name).lower(): name for name in reversed(known)}
    match = difflib.get_close_matches(named(str(word)).lower(), lower, n=1, cutoff=0.6)
    return f"did you mean {lower[match[0]]!r}?" if match else otherwise or choices(known)


def choices(candidates: Iterable[Any], limit: int = 20) -> str:
    """Return ``"choose one of a, b, c"``, cut after ``limit`` names."""
    names = [str(name) for name in candidates]
    if not names:
        return "there is nothing to choose from"
    more = f" ... ({len(names)} in all)" if len(names) > limit else ""
    return f"choose one of {', '.join(names[:limit])}{more}"
