"""How numbers and errors are put for people, what they see while a long call runs, and how they end it."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Generator
from contextlib import contextmanager


def print_error(line: str, code: int = 1) -> int:
    """Say in one line what is wrong; give the exit code."""
    print(f"Error: {' '.join(line.split())}", file=sys.stderr)
    return code


@contextmanager
def clock(text: str) -> Generator[None]:
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


@contextmanager
def interruptible() -> Generator[None]:
    """Raise `KeyboardInterrupt` with the signal's number at SIGINT and SIGTERM; in the main thread alone."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(number: int, _: object) -> None:
        raise KeyboardInterrupt(number)

    def heard(ignored: sys.UnraisableHookArgs) -> None:
        if isinstance(ignored.exc_value, KeyboardInterrupt):  # C called back, as LLVM does: it asks again
            threading.Timer(0.1, os.kill, (os.getpid(), (*ignored.exc_value.args, signal.SIGINT)[0])).start()
        else:
            hook(ignored)

    hook, sys.unraisablehook = sys.unraisablehook, heard
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        for number, handler in before.items():
            if handler != signal.SIG_IGN:  # nohup
                signal.signal(number, interrupt)
        yield
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)
