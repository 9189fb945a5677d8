"""What goes wrong with a user's input, in one line."""

from __future__ import annotations

__all__ = ["InputError"]


class InputError(ValueError):
    """Bad input: one clear line that names the place and the cure.

    Parameters
    ----------
    place : str
        File, and row or key where there is one, e.g. ``"cohort.tsv row 3"``.
    problem : str
        What is wrong there.
    cure : str
        What the user can do about it.

    Examples
    --------
    >>> print(InputError("cohort.tsv row 3", "label 7 is not in liver.nii.gz", "choose one of 1, 2, 5"))
    cohort.tsv row 3: label 7 is not in liver.nii.gz; choose one of 1, 2, 5
    """

    def __init__(self, place: str, problem: str, cure: str):
        parts = (str(place), str(problem), str(cure))
        self.place, self.problem, self.cure = (" ".join(part.split()) for part in parts)
        super().__init__(f"{self.place}: {self.problem}; {self.cure}")

    def __reduce__(self):
        return type(self), (self.place, self.problem, self.cure)
