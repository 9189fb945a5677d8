import json

import numpy as np
import pytest
from support.shapes import drawn

from cccd.cli import main
from cccd.containers import Frame
from cccd.contours import trace_stack

SHAPE = (420, 420, 12)


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder in which commands are typed."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def refused(capsys):
    """Types a command that ends with one line, which it returns."""

    def type_command(*words):
        capsys.readouterr()
        assert main([str(word) for word in words]) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("Error: ")
        return line

    return type_command


@pytest.fixture
def answer(capsys):
    """Types a command with ``--json``, and returns what it prints."""

    def type_command(*words):
        capsys.readouterr()
        assert main([*map(str, words), "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return type_command


@pytest.fixture
def frame():
    return Frame(np.eye(4), 2, SHAPE)


@pytest.fixture
def curves_of():
    """Curves from polygons (n, 2), one slice each unless slices are given."""
    return lambda *polygons, slices=None: drawn(polygons, slices, SHAPE)


@pytest.fixture
def blob(frame):
    """Traced slices of a smooth organ-like region: lobes of a few waves round a centre."""

    def build(seed, radius=60.0, slices=2, waves=0.12):
        rng = np.random.default_rng(seed)
        i, j = np.meshgrid(np.arange(200) - 100, np.arange(200) - 100, indexing="ij")
        angle, distance = np.arctan2(i, j), np.hypot(i, j)
        stack = []
        for _ in range(slices):
            border = np.full(angle.shape, radius)
            for wave in range(2, 6):
                border += radius * waves / wave * rng.normal() * np.cos(wave * angle + rng.uniform(0, 6.3))
            stack.append(distance < border)
        mask = np.array(stack)
        return mask, trace_stack(mask, (0, 0, 0), frame)

    return build
