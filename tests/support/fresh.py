"""Programs in an interpreter of their own, which has loaded nothing yet."""

import os
import subprocess
import sys

from support import SCRIPTS


def python(code, *arguments, cwd=None, **environment):
    """What a program prints; it knows the checkout's packages. An error of its own fails the test."""
    command = [sys.executable, "-c", code, *map(str, arguments)]
    env = os.environ | {"PYTHONPATH": str(SCRIPTS)} | environment
    run = subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout
