"""How numbers and warnings are put for people, and what they see while a long call runs."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

#: Share of the jobs after which the time left is worth saying.
FORESEEN = 0.1


def print_error(line: str, code: int = 1) -> int:
    """Say in one line what is wrong; give the exit code."""
    print(f"Error: {' '.join(line.split())}", file=sys.stderr)
    return code


@contextmanager
def clock(text: str) -> Iterator[None]:
    """Show on a terminal what is being made and for how long: for what has no steps to count."""
    from tqdm import tqdm

    ended = threading.Event()
    with tqdm(desc=text, disable=None, leave=False, bar_format="{desc} {elapsed}") as line:
        ticking = threading.Thread(target=lambda: [line.refresh() for _ in iter(lambda: ended.wait(1), True)])
        ticking.start()
        try:
            yield
        finally:
            ended.set()
            ticking.join()


def duration(seconds: float) -> str:
    """Say how long, in the largest unit that fits.

    >>> duration(7.4), duration(100), duration(7000)
    ('7 s', '2 min', '1 h 57 min')
    """
    if seconds < 60:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def millilitres(volume: float) -> str:
    """Write a volume (ml) with four digits, or all those before its point and one behind.

    >>> millilitres(14876.32), millilitres(254.81), millilitres(0.0004321)
    ('14876.3 ml', '254.8 ml', '0.0004321 ml')
    """
    return f"{volume:.1f} ml" if volume >= 1000 else f"{volume:.4g} ml"
