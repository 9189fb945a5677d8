"""Hostile input: names, model files, scans and texts that would run, escape or show up as something else."""

import json
import os
from html.parser import HTMLParser
from pathlib import Path

import h5py
import nibabel
import numpy as np
import pandas as pd
import pytest
import torch

from cccd_workflow.report.page import build_report

ROOT = Path(__file__).parents[2]
SCRIPT = "<script>steal()</script>"
IMAGE = "<img src=x onerror=steal()>"


class Bomb:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, mark: Path):
        self.mark = mark

    def __reduce__(self):
        return os.mkdir, (str(self.mark),)


def test_names_in_the_sheet(fresh_project):
    name = "../../x;$(touch x)"
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
    output = tiny_copy.folder / "hostile.html"
    build_report(
        results=tiny_copy.results,
        structures=[("tiny", "sphere")],
        failures=[f"tiny/sphere: {SCRIPT} {IMAGE}"],
        config={"cohort": SCRIPT},
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
