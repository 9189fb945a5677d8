"""Batches of structures as jobs of a scheduler: a plain shell stands in for it, one process per job."""

import h5py
import nibabel
import numpy as np
import pytest

pytest.importorskip("snakemake_executor_plugin_cluster_generic", reason="needs envs/slurm.txt")

#: Prints its id, runs the job's script beside, and leaves its status in a file.
SUBMIT = """#!/bin/sh
(sh "$1" > "$1.out" 2>&1; echo $? > "$1.rc") > /dev/null 2>&1 &
echo "$1"
"""
STATUS = """#!/bin/sh
[ -f "$1.rc" ] || { echo running; exit; }
[ "$(cat "$1.rc")" = 0 ] && echo success || echo failed
"""
CASES = ("good", "bad")


def ball(path, value=1):
    grid = np.indices((20, 20, 12)) - np.array([10, 10, 6]).reshape(3, 1, 1, 1)
    mask = value * (np.hypot.reduce(grid) < 6)
    nibabel.save(nibabel.Nifti1Image(mask.astype(np.uint8), np.eye(4)), path)


def test_a_batch_survives_its_worst_structure(fresh_project):
    folder = fresh_project.folder
    for name, text in {"submit": SUBMIT, "status": STATUS}.items():
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    rows = ["case\torgan\tmask", *(f"{case}\tball\t{case}.nii.gz" for case in CASES)]
    (folder / "tiny.tsv").write_text("\n".join(rows) + "\n")
    for case in CASES:
        ball(folder / f"{case}.nii.gz", value=int(case != "bad"))
    targets = [f"results/{case}/ball/contours.h5" for case in CASES]
    options = ["--executor", "cluster-generic", "--jobs", "2", "--latency-wait", "20"]
    options += ["--cluster-generic-submit-cmd", f"{folder}/submit"]
    options += ["--cluster-generic-status-cmd", f"{folder}/status"]
    options += ["--seconds-between-status-checks", "1"]
    options += ["--group-components", "import=2", "structure=2", "--", *targets]
    run = fresh_project.snakemake(*options, check=False)
    assert run.returncode == 1, run.stderr
    assert "1 failed:" in run.stderr
    assert "tiny.tsv row 3: bad.nii.gz: the mask is empty" in run.stderr
    with h5py.File(folder / targets[0]) as file:
        assert "ordered" in file
    # nothing stands where the bad one's files would, and it alone is made again
    assert not [path for path in (folder / "results" / "bad").rglob("*") if path.is_file()]
    ball(folder / "bad.nii.gz")
    assert fresh_project.planned(*targets) == {"import_structure": 1}
