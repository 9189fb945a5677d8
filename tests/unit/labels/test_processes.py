"""Worker processes end with the process that started them."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support import SCRIPTS

CODE = """
import os, signal, sys, time
from cccd_labels.processes import worker_processes

def stay(number):
    print(os.getpid(), flush=True)
    time.sleep(600)

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores it for what runs behind
    with worker_processes(2) as pool:
        print(list(pool.map(stay, range(2))))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
@pytest.mark.parametrize("to_all", [True, False])
def test_workers_end_with_their_parent(tmp_path, number, to_all):
    (tmp_path / "staying.py").write_text(CODE)
    parent = subprocess.Popen(
        [sys.executable, tmp_path / "staying.py"],
        env=os.environ | {"PYTHONPATH": str(SCRIPTS)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    workers = [int(parent.stdout.readline()) for _ in range(2)]
    (os.killpg if to_all else os.kill)(parent.pid, number)
    said = parent.communicate(timeout=20)[1]
    assert said.count("Traceback") == (number == signal.SIGINT)  # the parent's own
    deadline = time.monotonic() + 10
    while any(map(is_running, workers)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(is_running, workers))


def is_running(process: int) -> bool:
    try:
        return "State:\tZ" not in Path(f"/proc/{process}/status").read_text()
    except FileNotFoundError:
        return False
