"""The pipeline on a real scheduler: nothing is lost when a node, a job or the controller is."""

import re
import subprocess

import nibabel
import numpy as np
import pytest

STRUCTURES = ("sphere", "two_spheres")
BOUNDARIES = [f"results/tiny/{organ}/boundaries.h5" for organ in STRUCTURES]


def new_jobs(cluster, before):
    known = {job["JobId"] for job in before}
    return [job for job in cluster.history() if job["JobId"] not in known]


def away(cluster, run, seconds):
    """Take the controller away from a run for a while."""
    cluster.stop("slurmctld")
    try:
        with pytest.raises(subprocess.TimeoutExpired):
            run.process.wait(seconds)
    finally:
        cluster.start("slurmctld")


def test_the_whole_cohort(cluster, submit, fresh_project):
    before = cluster.history()
    submit("slurm", watchdog=True).done(900)
    assert (fresh_project.results / "report.html").exists()
    jobs = new_jobs(cluster, before)
    assert {job["JobState"] for job in jobs} == {"COMPLETED"}
    assert {job["NodeList"] for job in jobs} == {"n1", "n2"}


def test_a_node_is_lost(cluster, submit, fresh_project):
    before = cluster.history()
    run = submit("slurm", "--", *BOUNDARIES)
    cluster.wait_for_jobs("--nodelist=n1")
    cluster.lose("n1")
    try:
        run.done(300)
    finally:
        cluster.start("slurmd-n1")
    states = [job["JobState"] for job in new_jobs(cluster, before)]
    assert "NODE_FAIL" in states
    assert all((fresh_project.folder / target).exists() for target in BOUNDARIES)


def test_more_memory_after_too_little(cluster, submit, fresh_project):
    before = cluster.history()
    run = submit("slurm", "--set-resources", "import_structure:mem_mb=100*attempt**4", "--", *BOUNDARIES[:1])
    run.done(300)
    asked = [(job["MinMemoryNode"], job["JobState"]) for job in new_jobs(cluster, before)]
    assert asked[:2] == [("100M", "FAILED"), ("1600M", "COMPLETED")]


def test_a_cancelled_job_is_reported_and_run_again(cluster, submit, fresh_project):
    before = cluster.history()
    run = submit("slurm", "--", *BOUNDARIES[:1])
    job = cluster.wait_for_jobs()[0]
    subprocess.run(["scancel", job], check=True)
    run.done(300)
    assert re.search(rf"failed: .*see .*{job}\.log\)", run.said)
    states = [entry["JobState"] for entry in new_jobs(cluster, before)]
    assert states[:2] == ["CANCELLED", "COMPLETED"]


def test_a_batch_survives_its_worst_structure(cluster, submit, fresh_project):
    edges = np.zeros((24, 24, 6), np.uint8)
    edges[4:20, 12] = 1  # a line in each slice, which closes nowhere
    nibabel.save(nibabel.Nifti1Image(edges, np.eye(4)), fresh_project.folder / "lines.nii")
    rows = ["case\torgan\tsource\tboundary", "tiny\tsphere\tphantom\t", "bad\tlines\tfiles\tlines.nii"]
    (fresh_project.folder / "tiny.tsv").write_text("\n".join(rows) + "\n")
    config = fresh_project.folder / "tiny.yaml"
    config.write_text(config.read_text().replace("train: true", "train: false"))
    good, bad = (fresh_project.results / key / "curves.h5" for key in ("tiny/sphere", "bad/lines"))
    options = ["--retries=0", "--group-components", "import=2", "structure=2"]
    targets = [str(path.relative_to(fresh_project.folder)) for path in (good, bad)]
    run = submit("slurm", *options, "--", *targets)
    assert run.process.wait(300) == 1
    assert "bad/lines: tiny.tsv row 3: no slice has a closed boundary" in run.said
    assert good.exists()
    assert not bad.exists()


def test_the_watchdog_ends_a_hang(cluster, submit, fresh_project):
    run = submit("slurm", "--slurm-status-attempts=2", "--", *BOUNDARIES, watchdog=True, quiet_s=30)
    cluster.wait_for_jobs()
    away(cluster, run, 20)  # without accounting, the plugin now forgets its jobs
    run.done(400)
    assert "submit: no job left" in run.said


def test_the_generic_profile_outlives_the_controller(cluster, submit, fresh_project):
    run = submit("generic", "--", *BOUNDARIES)
    cluster.wait_for_jobs()
    away(cluster, run, 20)
    run.done(300)
    assert all((fresh_project.folder / target).exists() for target in BOUNDARIES)


def test_job_arrays_are_refused(fresh_project):
    command = ["workflow/profiles/slurm/submit", "--slurm-array-jobs=all"]
    run = subprocess.run(command, cwd=fresh_project.folder, capture_output=True, text=True, check=False)
    assert run.returncode != 0
    assert "--group-components" in run.stderr
