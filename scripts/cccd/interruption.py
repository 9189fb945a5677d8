"""Let what asks a process to end (timeout, docker, Slurm) do what Ctrl-C does: half-written files go."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interruptible() -> Iterator[None]:
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
