"""Hostile files that run nothing, rules that call no shell, and pins without known holes."""

import json
import os
import pickle
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import torch
from support import ROOT
from support.refusals import refusal

from cccd_junctions.checkpoint import load_model
from cccd_networks.model_header import read_header


class Bomb:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, mark: Path):
        self.mark = mark

    def __reduce__(self):
        return os.mkdir, (str(self.mark),)


@pytest.mark.parametrize("write", [torch.save, lambda bomb, path: path.write_bytes(pickle.dumps(bomb))])
def test_a_model_file_runs_nothing(write, tmp_path):
    write(Bomb(tmp_path / "exploded"), tmp_path / "model.pt")
    assert "not a junction model" in refusal(load_model, tmp_path / "model.pt")
    assert not (tmp_path / "exploded").exists()


def test_a_model_is_not_run_when_the_run_is_planned(tmp_path):
    with zipfile.ZipFile(tmp_path / "model.pt", "w") as archive:
        archive.writestr(
            "model/data.pkl", pickle.dumps({"sizes": {}, "network": Bomb(tmp_path / "exploded")})
        )
    assert "not a junction model" in refusal(read_header, tmp_path / "model.pt")
    assert not (tmp_path / "exploded").exists()


def test_no_rule_builds_a_shell_command():
    for source in sorted((ROOT / "workflow" / "rules").glob("*.smk")):
        assert "shell:" not in source.read_text(encoding="utf-8"), source


@pytest.mark.parametrize(
    ("answer", "status", "word"),
    [
        ({"dependencies": [{"name": "a", "version": "1", "vulns": []}]}, 0, "1 of 1"),
        ({"dependencies": [{"name": "a", "version": "1", "skip_reason": "not found"}]}, 0, "skipped"),
        (
            {
                "dependencies": [
                    {"name": "a", "version": "1", "vulns": [{"id": "CVE-1", "fix_versions": ["2"]}]}
                ]
            },
            1,
            "a 1: CVE-1, fixed in 2",
        ),
        (None, 0, "skipped"),
    ],
)
def test_the_audit_fails_on_holes_only(answer, status, word, tmp_path):
    service = tmp_path / "pip-audit"
    said = json.dumps(answer) if answer else "no network"
    service.write_text(f"#!/bin/sh\ncat <<'END'\n{said}\nEND\n")
    service.chmod(0o755)
    command = [sys.executable, ROOT / ".ci" / "audit", service]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == status
    assert word in run.stdout


@pytest.fixture
def silent_service(tmp_path):
    """A pip-audit that no service answers."""
    program = tmp_path / "pip-audit"
    program.write_text("#!/bin/sh\necho no network >&2\nexit 1\n")
    program.chmod(0o755)
    return program


@pytest.mark.parametrize(
    ("pin", "found"),
    [
        ("torch==2.5.1+cpu", "torch 2.5.1+cpu: CVE-2025-32434, fixed in 2.6.0"),
        ("Jinja2==3.1.5", "Jinja2 3.1.5: CVE-2025-27516, fixed in 3.1.6"),
        ("torch==2.6", None),
        ("torch==2.13.0", None),
    ],
)
def test_the_audit_finds_a_planted_version_without_a_service(pin, found, tmp_path, silent_service):
    pins = tmp_path / "pins.txt"
    pins.write_text(f"# pinned\nnumpy==2.4.6\n{pin}\n")
    command = [sys.executable, ROOT / ".ci" / "audit", silent_service, pins]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == (1 if found else 0)
    assert "audit skipped" in run.stdout
    if found:
        assert found in run.stdout.splitlines()
