"""Plans are made in a folder of their own."""

import pytest


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    """The folder of the run."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PWD", str(tmp_path))
