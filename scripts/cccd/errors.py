"""What goes wrong with a user's input, and what would be right, in one line."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any


class MergedLabels(UserWarning):
    """Python's warning that several labels became one organ, as nobody said which."""


class EarlyWarning(str):
    """One line that a user should read before the work begins, not after it."""


class InputError(ValueError):
    """Bad input: one clear line that names the location and gives a hint.

    Parameters
    ----------
    location : str
        File, and row or key where there is one, e.g. ``"cohort.tsv row 3"``.
    problem : str
        What is wrong there.
    hint : str
        What the user can do about it.

    Examples
    --------
    >>> print(InputError("cohort.tsv row 3", "label 7 is not in liver.nii.gz", "choose one of 1, 2, 5"))
    cohort.tsv row 3: label 7 is not in liver.nii.gz; choose one of 1, 2, 5
    """

    def __init__(self, location: str, problem: str, hint: str):
        parts = (str(location), str(problem), str(hint))
        self.location, self.problem, self.hint = (" ".join(part.split()) for part in parts)
        super().__init__(f"{self.location}: {self.problem}; {self.hint}")

    def at(self, location: str) -> InputError:
        """Return this error with another location, such as a row; the old one then opens the problem.

        Examples
        --------
        >>> print(InputError("scan.nii", "no such file", "correct the path").at("cohort.tsv row 2"))
        cohort.tsv row 2: scan.nii: no such file; correct the path
        """
        if self.location == location:
            return self
        return InputError(location, f"{self.location}: {self.problem}", self.hint)

    def __reduce__(self):
        return type(self), (self.location, self.problem, self.hint)


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
    import difflib

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
