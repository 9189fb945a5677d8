"""Worker processes that do not outlive the process that started them."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import active_children, get_context, parent_process
from threading import Thread


@contextmanager
def worker_processes(count: int) -> Iterator[ProcessPoolExecutor]:
    """Give processes that end with this one, and at once where this one is interrupted.

    Parameters
    ----------
    count : int
        How many work at once.
    """
    others = set(active_children())
    # spawned: a fork of a process with threads may hang
    with ProcessPoolExecutor(count, get_context("spawn"), _end_with_parent) as pool:
        try:
            yield pool
        except BaseException:
            for process in set(active_children()) - others:
                process.terminate()
            raise


def _end_with_parent() -> None:
    """Leave Ctrl-C to the parent, and end this process when the parent has ended, however it did."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    Thread(target=watch, daemon=True).start()
