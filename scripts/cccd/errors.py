"""What goes wrong with a user's input, in one line."""

from __future__ import annotations

__all__ = ["EarlyWarning", "InputError", "MergedLabels"]


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
