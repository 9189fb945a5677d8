"""What a person sees while a label map runs, and of its organs."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TextIO

from cccd.console import millilitres

#: Share of the jobs after which the time left is worth saying.
FORESEEN = 0.1
#: Organs that a warning of several names.
NAMED = 4
#: Seconds between the lines.
LINES_APART = 20.0


def duration(seconds: float) -> str:
    """Say how long, in the largest unit that fits.

    >>> duration(7.4), duration(100), duration(7000)
    ('7 s', '2 min', '1 h 57 min')
    """
    if seconds < 60:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def organ_table(rows: Sequence[tuple[str, float, int, int]]) -> str:
    """Write a table of organs: name, ml, triangles, warnings.

    >>> print(organ_table([("liver", 1503.26, 29670, 1), ("aorta", 81.5, 702, 0)]))
    organ    volume  triangles  warnings
    liver 1503.3 ml      29670         1
    aorta   81.5 ml        702         0
    """
    width = max(len("organ"), *(len(name) for name, *_ in rows)) if rows else 5
    lines = [f"{'organ':<{width}} {'volume':>9} {'triangles':>10} {'warnings':>9}"]
    lines += [f"{name:<{width}} {millilitres(ml):>9} {count:>10} {said:>9}" for name, ml, count, said in rows]
    return "\n".join(lines)


def joined_warnings(warnings: Mapping[str, Sequence[str]], of: str = "organs") -> list[str]:
    """Join warnings of organs that differ in numbers alone: one line for each kind, the commonest first.

    >>> joined_warnings({"liver": ["2 holes"], "aorta": ["2 holes"], "heart": ["1 hole", "open"]})
    ['2 holes: 3 organs (liver, aorta, heart; numbers of the first)', 'open: heart']
    """
    kinds: dict[str, list[tuple[str, str]]] = {}
    for organ, line in ((organ, line) for organ, lines in warnings.items() for line in lines):
        kind = re.sub(r"[\d.,-]+|(ies|[ys]|is|are)\b| in total", "", line)  # singular and plural are one
        kinds.setdefault(kind, []).append((organ, line))
    joined: list[str] = []
    for found in sorted(kinds.values(), key=len, reverse=True):
        organs = list(dict.fromkeys(organ for organ, _ in found))
        names = ", ".join(organs[:NAMED]) + (", ..." if len(organs) > NAMED else "")
        names += "; numbers of the first" * (len(organs) > 1 and len({line for _, line in found}) > 1)
        joined.append(f"{found[0][1]}: " + (f"{len(organs)} {of} ({names})" if len(organs) > 1 else names))
    return joined


class OrganLines:
    """Lines about a label map where no terminal shows a bar, as in a cluster's log; one in a while is enough.

    Parameters
    ----------
    sizes : mapping of int to int
        Of each organ, by number: the time that it takes, in any unit.
    stream : text stream, optional
    clock : callable
        Gives seconds.
    """

    def __init__(
        self,
        sizes: Mapping[int, int],
        stream: TextIO | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.sizes, self.stream, self.clock = sizes, stream or sys.stderr, clock
        self.begin = self.last = clock()
        self.ready: list[int] = []

    def begins(self, what: str) -> None:
        """Tell what begins, such as an organ by its name."""
        count = len(self.sizes)
        done, total = sum(self.sizes[number] for number in self.ready), max(sum(self.sizes.values()), 1)
        now = self.clock()
        soon = now - self.last < LINES_APART
        if done == total and self.last > self.begin:
            soon = False  # what follows the organs' own surfaces takes as long as they
        if self.stream.isatty() or soon:
            return
        self.last, left = now, ""
        if FORESEEN * total <= done < total:
            left = f"; about {duration((now - self.begin) / done * (total - done))} left for surfaces"
        self.stream.write(f"[{len(self.ready):>{len(str(count))}}/{count}] {what} ...{left}\n")
        self.stream.flush()

    def done(self, number: int) -> None:
        """Count an organ."""
        self.ready.append(number)
