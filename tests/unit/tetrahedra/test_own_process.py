"""A library that hears no signal: what interrupts the program ends the library's work."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from threading import Timer

import pytest
from support.solids import sphere

from cccd.interruption import interruptible
from cccd.settings.surface import TetrahedraSettings
from cccd_tetrahedra.filling import fill_organs
from cccd_tetrahedra.own_process import call

WAITING = "import signal; from cccd_tetrahedra.own_process import call; call(signal.pause)"


def test_a_signal_ends_the_filling_at_once():
    pytest.importorskip("pytetwild", reason="the extra fe is not installed")
    asked = TetrahedraSettings(edge_mm=1, tolerance_mm=0.01, most=10_000_000)  # some minutes
    signalled = Timer(4, os.kill, (os.getpid(), signal.SIGTERM))
    signalled.start()
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt) as caught, interruptible():
        fill_organs({"ball": sphere(20.0, subdivisions=5)}, asked)
    assert caught.value.args == (signal.SIGTERM,)
    assert time.monotonic() - began < 15


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere it ends when the library does")
def test_the_call_ends_with_a_killed_parent():
    parent = subprocess.Popen([sys.executable, "-c", WAITING])
    children = Path(f"/proc/{parent.pid}/task/{parent.pid}/children")
    while not (found := children.read_text().split()):
        time.sleep(0.1)
    time.sleep(1)
    parent.kill()
    parent.wait()
    for _ in range(100):
        if not Path(f"/proc/{found[0]}").exists() or "Z" in Path(f"/proc/{found[0]}/stat").read_text():
            return
        time.sleep(0.1)
    pytest.fail("it still runs")


def test_what_the_library_raises_is_said():
    with pytest.raises(RuntimeError, match="not a real file"):
        call(os.stat, path="not a real file")
