"""How numbers and warnings are put for people, and what they see while a long call runs."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager


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


def millilitres(volume: float) -> str:
    """Write a volume (ml) with four digits, or all those before its point and one behind.

    >>> millilitres(14876.32), millilitres(254.81), millilitres(0.0004321)
    ('14876.3 ml', '254.8 ml', '0.0004321 ml')
    """
    return f"{volume:.1f} ml" if volume >= 1000 else f"{volume:.4g} ml"
