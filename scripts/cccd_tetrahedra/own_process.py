"""A call in a process of its own, of a library that hears no signal and lets Python do nothing meanwhile."""

import ctypes
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable
from typing import Any


def call(function: Callable[..., Any], **arguments: object) -> Any:
    """Return what the function of a library does; whatever ends this process ends the call."""
    command = [sys.executable, "-P", __file__, str(os.getpid())]
    asked = pickle.dumps((function, arguments))
    ended = subprocess.run(command, input=asked, capture_output=True, check=False)
    if ended.returncode == -signal.SIGKILL:
        raise MemoryError
    if ended.returncode:
        why = ended.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise RuntimeError(f"{function.__module__} ended with {ended.returncode}: {' '.join(why)}")
    return pickle.loads(ended.stdout)  # noqa: S301  # of our own process


if __name__ == "__main__":
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: the parent may be killed
    if os.getppid() != int(sys.argv[1]):
        sys.exit("the parent was killed before")
    with os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)  # what the library prints is no answer
        function, arguments = pickle.load(sys.stdin.buffer)  # noqa: S301  # of our own process
        pickle.dump(function(**arguments), answer)
