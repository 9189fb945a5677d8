"""Seeds: where somebody points into an image to say which organ is meant.

Read at every parse of the workflow, so nothing heavy is imported here.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from cccd.errors import InputError

#: What a seed looks like, for messages.
SEED_FORM = "a voxel 120,88,40 or a box 110:130,80:96,38:42; several separated by semicolons"


class Seed(NamedTuple):
    """A box of voxels within an organ.

    Attributes
    ----------
    first, end : (int, int, int)
        First voxel, and the one behind the last, along each axis.
    """

    first: tuple[int, int, int]
    end: tuple[int, int, int]

    def __str__(self) -> str:
        return ",".join(
            f"{a}" if b == a + 1 else f"{a}:{b}" for a, b in zip(self.first, self.end, strict=True)
        )


def parse_seeds(text: str, location: str) -> list[Seed]:
    """Read seeds as the cohort sheet and the command line write them.

    Parameters
    ----------
    text : str
        Voxels ``i,j,k`` and boxes ``i0:i1,j0:j1,k0:k1``, whose end is not part of them, separated by
        semicolons. Indices count from 0, along the axes in which the file stores its voxels.
    location : str
        What messages name.

    Raises
    ------
    InputError
        Something else, or a box without voxels.

    Examples
    --------
    >>> [str(seed) for seed in parse_seeds("120,88,40; 60:64,80:90,40", "seed")]
    ['120,88,40', '60:64,80:90,40']
    """
    seeds: list[Seed] = []
    for part in text.split(";"):
        plain = re.sub(r"\s", "", part)
        if not re.fullmatch(r"\d+(:\d+)?(,\d+(:\d+)?){2}", plain):
            raise InputError(location, f"seed {part.strip()!r} is not known", f"give {SEED_FORM}")
        first: list[int] = []
        end: list[int] = []
        for bounds in plain.split(","):
            a, _, b = bounds.partition(":")
            first.append(int(a))
            end.append(int(b) if b else int(a) + 1)
        if any(b <= a for a, b in zip(first, end, strict=True)):
            problem = f"seed {plain} is a box without voxels"
            raise InputError(location, problem, "give the larger index second; it is not part of the box")
        seeds.append(Seed((first[0], first[1], first[2]), (end[0], end[1], end[2])))
    return seeds
