"""Hostile input: names, model files, scans and texts that would run, escape or show up as something else."""

import ast
import json
import os
import pickle
import subprocess
import sys
import zipfile
from html.parser import HTMLParser
from pathlib import Path

import h5py
import nibabel
import numpy as np
import pandas as pd
import pytest
import torch

from cccd.errors import InputError
from cccd.junctions.checkpoint import load_model
from cccd.model_header import read_header
from cccd.report.page import build_report

ROOT = Path(__file__).parents[2]
SOURCES = sorted((ROOT / "scripts").rglob("*.py"))
SCRIPT = "<script>steal()</script>"
IMAGE = "<img src=x onerror=steal()>"


class Bomb:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, mark: Path):
        self.mark = mark

    def __reduce__(self):
        return os.mkdir, (str(self.mark),)


@pytest.mark.parametrize("name", ["$(touch x)", "../../x", "x;touch x"])
def test_names_in_the_sheet(name, fresh_project):
    (fresh_project.folder / "tiny.tsv").write_text(f"case\torgan\tsource\n{name}\tsphere\tphantom\n")
    before = set(fresh_project.folder.rglob("*"))
    run = fresh_project.snakemake("--dry-run", "--quiet", check=False)
    assert run.returncode
    assert "tiny.tsv row 2" in run.stderr
    assert {path for path in fresh_project.folder.rglob("*") if ".snakemake" not in path.parts} == before


@pytest.mark.parametrize("target", ["results/../../x/structure.h5", "results/$(touch x)/y/structure.h5"])
def test_targets_outside_the_sheet(target, fresh_project):
    assert fresh_project.snakemake("--dry-run", target, check=False).returncode
    assert not (fresh_project.folder / "x").exists()


def test_a_scan_named_like_a_command(fresh_project):
    name = "$(touch hacked); touch hacked #.nii"
    mask = np.zeros((12, 12, 8), np.uint8)
    mask[3:9, 3:9, 2:6] = 1
    nibabel.save(nibabel.Nifti1Image(mask, np.eye(4)), fresh_project.folder / name)
    (fresh_project.folder / "tiny.tsv").write_text(f"case\torgan\tmask\na\tcube\t{name}\n")
    fresh_project.snakemake("results/a/cube/structure.h5")
    assert not list(fresh_project.folder.rglob("hacked"))


@pytest.mark.parametrize("write", [torch.save, lambda bomb, path: path.write_bytes(pickle.dumps(bomb))])
def test_a_model_file_runs_nothing(write, tmp_path):
    write(Bomb(tmp_path / "exploded"), tmp_path / "model.pt")
    with pytest.raises(InputError, match="not a junction model"):
        load_model(tmp_path / "model.pt")
    assert not (tmp_path / "exploded").exists()


def test_a_hostile_checkpoint_is_not_resumed(tiny_copy):
    gnn = tiny_copy.results / "gnn"
    newest = sorted((gnn / "checkpoints").glob("*.pt"))[-1]
    torch.save(Bomb(tiny_copy.folder / "exploded"), newest)
    (gnn / "model.pt").unlink()
    tiny_copy.snakemake("results/gnn/model.pt")
    assert not (tiny_copy.folder / "exploded").exists()


class Tags(HTMLParser):
    """Collect every attribute that runs something, and the text of every script."""

    def __init__(self):
        super().__init__()
        self.handlers, self.scripts, self.inside = [], [], False

    def handle_starttag(self, tag, attrs):
        self.inside = tag == "script"
        self.handlers += [
            (tag, key) for key, value in attrs if "steal" in (value or "") and key.startswith("on")
        ]

    def handle_endtag(self, tag):
        self.inside = False

    def handle_data(self, data):
        if self.inside:
            self.scripts.append(data)


def test_texts_in_the_report(tiny_copy):
    folder = tiny_copy.results / "tiny" / "sphere"
    with h5py.File(folder / "structure.h5", "a") as file:
        provenance = json.loads(file.attrs["provenance"])
        provenance |= {"source": SCRIPT, "files": [{"path": f"{IMAGE}.nii", "sha256": SCRIPT}]}
        file.attrs["provenance"] = json.dumps(provenance)
        file.attrs["warnings"] = json.dumps([SCRIPT, IMAGE, "</script>" + SCRIPT])
    for path in (tiny_copy.results / "tables").glob("*.csv"):
        table = pd.read_csv(path)
        texts = [name for name in table if not pd.api.types.is_numeric_dtype(table[name])]
        table.loc[len(table) - 1, texts] = SCRIPT
        table.to_csv(path, index=False)
    (tiny_copy.results / "tables" / "notes.json").write_text(json.dumps({"table1": SCRIPT, "figure9": IMAGE}))
    output = tiny_copy.folder / "hostile.html"
    build_report(
        results=tiny_copy.results,
        structures=[("tiny", "sphere")],
        failures=[f"tiny/sphere: {SCRIPT} {IMAGE}"],
        config={"report": {"pages_above": 12, "viewer_triangles": 1000}, "cohort": SCRIPT},
        output=output,
        benchmarks=None,
        template_dir=ROOT / "workflow" / "report",
    )
    page = output.read_text(encoding="utf-8")
    assert "&lt;script&gt;steal()" in page  # it is shown, as text
    assert SCRIPT not in page
    assert IMAGE not in page
    tags = Tags()
    tags.feed(page)
    assert not tags.handlers
    assert not [script for script in tags.scripts if script.strip().startswith("steal()")]


def calls(source: Path):
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            yield ast.unparse(node.func), {word.arg: ast.unparse(word.value) for word in node.keywords}, node


#: Read what models and nnU-Net say of themselves, by unpicklers that know plain values only.
UNPICKLERS = {
    ROOT / "scripts" / "cccd" / "model_header.py": {"pickle", "zipfile"},
    ROOT / "scripts" / "cccd" / "volumes" / "nnunet.py": {"pickle"},
}


def test_a_model_is_not_run_when_the_run_is_planned(tmp_path):
    with zipfile.ZipFile(tmp_path / "model.pt", "w") as archive:
        archive.writestr(
            "model/data.pkl", pickle.dumps({"sizes": {}, "network": Bomb(tmp_path / "exploded")})
        )
    with pytest.raises(InputError, match="not a junction model"):
        read_header(tmp_path / "model.pt")
    assert not (tmp_path / "exploded").exists()


def test_nothing_is_unpickled_unpacked_or_given_to_a_shell():
    forbidden = {"eval", "exec", "os.system", "os.popen", "yaml.load", "shutil.unpack_archive"}
    for source in SOURCES:
        for name, words, node in calls(source):
            place = f"{source.relative_to(ROOT)}:{node.lineno} {name}"
            assert name not in forbidden, place
            assert words.get("shell", "False") == "False", place
            assert words.get("allow_pickle", "False") == "False", place
            if name == "torch.load":
                assert words.get("weights_only") == "True", place
        modules = {
            alias.name.partition(".")[0]
            for node in ast.walk(ast.parse(source.read_text(encoding="utf-8")))
            if isinstance(node, (ast.Import, ast.ImportFrom))
            for alias in ([ast.alias(node.module or "")] if isinstance(node, ast.ImportFrom) else node.names)
        }
        assert (modules - UNPICKLERS.get(source, set())).isdisjoint(
            {"pickle", "marshal", "shelve", "joblib", "zipfile", "tarfile"}
        ), source


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
                    {"name": "a", "version": "1", "vulns": [{"id": "CVE-1", "fix_versions": ["2"]}]},
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


def test_what_is_pinned_has_no_hole_that_the_file_knows(silent_service):
    command = [sys.executable, ROOT / ".ci" / "audit", silent_service]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout
    assert "advisories.tsv: 0 known holes" in run.stdout
