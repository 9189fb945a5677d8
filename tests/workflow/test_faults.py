"""What goes wrong around a run, row by row of docs/reliability.md: one clear line, no half file, no loss."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import nibabel
import numpy as np
import pytest
import SimpleITK
from support import ROOT

from cccd import store
from cccd.errors import InputError
from cccd_workflow import stage_files

BOUNDARIES = [f"results/tiny/{organ}/boundaries.h5" for organ in ("sphere", "two_spheres")]

#: Loaded by every Python: each rule's first job gets a signal just before its output gets its name.
STRIKE_ONCE = """
import os, pathlib, re, sys
if re.search(r"[.]snakemake/scripts/tmp[^/]*[.]py$", " ".join(sys.orig_argv)):
    whole = pathlib.Path.replace
    def replace(self, target):
        mark = os.path.join(os.environ["STRUCK"], sys.modules["__main__"].snakemake.rule)
        try:
            mark = os.open(mark, os.O_CREAT | os.O_EXCL | os.O_WRONLY)
        except FileExistsError:
            return whole(self, target)
        os.write(mark, b"%d" % os.getpid())
        os.close(mark)
        os.kill(os.getpid(), int(os.environ["SIGNAL"]))
        return whole(self, target)
    pathlib.Path.replace = replace
"""

#: Loaded by every Python: Snakemake gets SIGTERM while it finishes its first job and holds a lock of its own.
STRIKE_SNAKEMAKE = """
import os, signal, sys
if sys.orig_argv[1:3] == ["-m", "snakemake"] and "STRUCK" in os.environ:
    import snakemake.jobs
    whole = snakemake.jobs.Job.postprocess
    async def postprocess(self, *arguments, **options):
        try:
            os.close(os.open(os.environ["STRUCK"], os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            return await whole(self, *arguments, **options)
        os.kill(os.getpid(), signal.SIGTERM)
        return await whole(self, *arguments, **options)
    snakemake.jobs.Job.postprocess = postprocess
"""

#: Loaded by every Python: jobs that import stay, with their files half written.
STAY = """
import pathlib, re, sys, time
if re.search(r"[.]snakemake/scripts/tmp[^/]*[.]py$", " ".join(sys.orig_argv)):
    whole = pathlib.Path.replace
    def replace(self, target):
        if sys.modules["__main__"].snakemake.rule == "import_structure":
            time.sleep(600)
        return whole(self, target)
    pathlib.Path.replace = replace
"""

#: What each file is written from, given the results of a finished structure as ``done``.
WRITERS = {
    "structure.h5": "store.write_structure(path, store.read_structure(done / 'structure.h5'))",
    "boundaries.h5": "files.write_boundaries(path, files.read_boundaries(done / 'boundaries.h5'))",
    "contours.h5": "files.write_contours(path, files.read_curves(done / 'contours.h5'), {})",
    "curves.h5": (
        "curves = files.read_curves(done / 'curves.h5'); from cccd.containers import FittedCurves; "
        "from cccd.chaincode import chain_codes; "
        "files.write_curves(path, FittedCurves(curves, chain_codes(curves.points, curves.offsets), "
        "*files.read_corners(done / 'curves.h5'), files.read_splines(done / 'curves.h5')))"
    ),
    "surface.h5": (
        "store.write_control_meshes(path, store.read_bodies(done / 'surface.h5'), "
        "store.read_surface_frame(done / 'surface.h5'), {})"
    ),
    "metrics.json": "store.write_json(path, {'a': 1})",
    "table.csv": "import pandas; store.write_table(path, pandas.DataFrame({'a': range(9999)}))",
    **{
        f"surface.{suffix}": (
            "from cccd.files import write_surface; from cccd.surface import surface; "
            "write_surface(path, surface.read_surface(done / 'surface.h5', done / 'surface.ply'))"
        )
        for suffix in ("ply", "stl", "vtp", "glb")
    },
    "picture.png": "from cccd_workflow.report.render import *; render_surface(done / 'surface.ply', path)",
    "model.pt": "from cccd_junctions import checkpoint; checkpoint.save_content(path, {'a': 'x' * 9999})",
}


@pytest.fixture
def small_disk(tmp_path):
    """Give a function that mounts a disk of so many kB on a folder."""
    mounted = []

    def mount(folder: Path, kilobytes: int) -> Path:
        if os.getuid() != 0:
            pytest.skip("needs root, to mount a small disk")
        folder.mkdir(parents=True, exist_ok=True)
        command = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(folder)]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            pytest.skip("a small disk cannot be mounted here")
        mounted.append(folder)
        return folder

    def release(folder: Path) -> None:
        subprocess.run(["umount", str(folder)], check=True)
        mounted.remove(folder)

    mount.release = release
    yield mount
    for folder in list(mounted):
        release(folder)


def failure_lines(run) -> list[str]:
    """Give the lines of a run that tell the user what failed."""
    return [line for line in (run.stdout + run.stderr).splitlines() if line.startswith("Error: ")]


@pytest.fixture
def strike_once(tmp_path):
    """Give surroundings in which each rule's first job gets a signal; ``folder`` lists those struck."""
    struck, site = tmp_path / "struck", tmp_path / "site"
    struck.mkdir()
    site.mkdir()
    (site / "sitecustomize.py").write_text(STRIKE_ONCE)

    def surroundings(project, number: int) -> dict:
        own = {"PYTHONPATH": str(site), "STRUCK": str(struck), "SIGNAL": str(int(number))}
        return project.surroundings()["env"] | own

    surroundings.folder = struck
    return surroundings


def test_a_worker_killed_in_any_stage_is_run_again(tiny_run, fresh_project, strike_once):
    """All that makes a structure and a network; tables and pages are made anew from these anyway."""
    targets = [f"tiny/sphere/{name}" for name in ("boundaries.h5", "metrics.json")]
    arguments = ["--retries", "1", "--", "results/gnn/model.pt", *(f"results/{name}" for name in targets)]
    fresh_project.snakemake(*arguments, env=strike_once(fresh_project, signal.SIGKILL))
    stages = {path.stem for path in (fresh_project.folder / "benchmarks").rglob("*.tsv")}
    assert {"generate_graphs", "train_gnn", "import_structure", "loft_surface", "measure_structure"} < stages
    assert {path.name for path in strike_once.folder.iterdir()} == stages
    assert not [path for path in fresh_project.results.rglob(".*") if path.is_file()]
    # the same bits as the run that nothing disturbed: nothing is lost, and nothing is drawn anew
    for name in (
        "tiny/sphere/contours.h5",
        "tiny/sphere/surface.h5",
        "tiny/sphere/surface.ply",
        "gnn/model.pt",
    ):
        ours, theirs = (project.results / name for project in (fresh_project, tiny_run))
        assert ours.read_bytes() == theirs.read_bytes(), name


def test_snakemake_ends_when_it_is_asked_to_while_it_finishes_a_job(fresh_project, tmp_path):
    target = "results/tiny/sphere/surface.ply"
    (tmp_path / "sitecustomize.py").write_text(STRIKE_SNAKEMAKE)
    own = {"PYTHONPATH": str(tmp_path), "STRUCK": str(tmp_path / "struck")}
    surroundings = fresh_project.surroundings()["env"] | own
    ended = fresh_project.snakemake(target, env=surroundings, timeout=120, check=False)
    assert ended.returncode
    assert (fresh_project.results / "tiny/sphere/structure.h5").exists()  # the job was finished
    assert not (fresh_project.folder / target).exists()
    fresh_project.snakemake(target)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_to_the_command_ends_all_its_jobs(fresh_project, tmp_path, number):
    (tmp_path / "sitecustomize.py").write_text(STAY)
    ball(tmp_path / "mask.nii.gz")
    use_masks(fresh_project, tmp_path, [("a", "mask.nii.gz"), ("b", "mask.nii.gz")])
    path = os.pathsep.join([str(tmp_path), str(fresh_project.folder / "scripts")])
    run = subprocess.Popen(
        [sys.executable, "-m", "cccd", "run", "tiny.tsv", "--cores", "2", "--", "surfaces"],
        cwd=fresh_project.folder,
        env=fresh_project.surroundings()["env"] | {"PYTHONPATH": path, "PWD": str(fresh_project.folder)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 120
    while len(list(fresh_project.results.rglob(".structure.*"))) < 2 and time.monotonic() < deadline:
        time.sleep(0.05)
    assert fresh_project.results.is_dir()
    run.send_signal(number)
    said = run.communicate(timeout=30)[1].splitlines()
    assert run.returncode == 128 + number
    assert said[-1] == "Interrupted: 0 of 2 structures are finished. Run the same command again to continue."
    assert not [line for line in said if line.startswith(("Traceback", "failed:", "Error"))]
    assert not list(fresh_project.results.rglob(".structure.*"))
    assert not processes_in(fresh_project.folder)
    assert not list((fresh_project.folder / ".snakemake" / "locks").glob("*"))


def processes_in(folder: Path) -> list[str]:
    """List the processes that work in a folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if (process / "cwd").resolve() == folder.resolve():
                found.append(process.name)
        except OSError:
            continue
    return found


def test_two_runs_in_one_folder_and_a_killed_snakemake(fresh_project, strike_once):
    target = "results/tiny/sphere/structure.h5"
    first = subprocess.Popen(
        fresh_project.command(target),
        cwd=fresh_project.folder,
        env=strike_once(fresh_project, signal.SIGSTOP),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    mark = strike_once.folder / "import_structure"
    deadline = time.monotonic() + 60
    while not (mark.exists() and mark.read_text()) and time.monotonic() < deadline:
        time.sleep(0.05)
    worker = int(mark.read_text())

    second = fresh_project.snakemake(target, check=False)
    first.kill()
    first.wait()
    assert second.returncode
    assert "cannot be locked" in second.stderr
    assert "--unlock" in second.stderr

    fresh_project.snakemake("--unlock")
    fresh_project.snakemake(target)
    finished = (fresh_project.folder / target).read_bytes()
    # the worker outlived its snakemake; what it still writes must not replace what the next run wrote
    os.kill(worker, signal.SIGCONT)
    while Path(f"/proc/{worker}").exists() and time.monotonic() < deadline + 60:
        time.sleep(0.05)
    assert (fresh_project.folder / target).read_bytes() == finished
    left = sorted(os.listdir((fresh_project.folder / target).parent))
    assert left == ["boundaries.h5", "contours.h5", "structure.h5"]


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_in_every_writer(name, tiny_run, small_disk, tmp_path):
    disk = small_disk(tmp_path / "disk", 64)
    with (disk / "filler").open("wb", buffering=0) as filler:
        assert filler.write(b"0" * 100_000) < 100_000  # as much as there is room for
    code = (
        "import sys; from pathlib import Path; from cccd import store; from cccd_workflow.job import job\n"
        "from cccd_workflow import stage_files as files\n"
        "path, done, log = map(Path, sys.argv[1:])\n"
        f"with job(log, 'tiny/sphere'):\n    {WRITERS[name]}"
    )
    arguments = [disk / name, tiny_run.results / "tiny" / "sphere", tmp_path / "log"]
    env = tiny_run.surroundings()["env"] | {"PYTHONPATH": str(ROOT / "scripts")}
    command = [sys.executable, "-c", code, *map(str, arguments)]
    run = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
    assert run.returncode == 1, run.stderr
    [line] = failure_lines(run)
    assert line.startswith(f"Error: tiny/sphere: no space left on the disk ({disk / name}")
    assert os.listdir(disk) == ["filler"]


def test_a_full_disk_in_a_run(fresh_project, small_disk):
    disk = small_disk(fresh_project.results, 8)
    refused = fresh_project.snakemake(BOUNDARIES[0], check=False)
    assert refused.returncode == 1
    [line] = failure_lines(refused)
    assert "results: 8 kB free, and this run writes" in line
    assert not os.listdir(disk)
    assert not (fresh_project.folder / "logs").exists()
    # one that fills up on the way: nothing is asked beforehand
    run = fresh_project.snakemake(BOUNDARIES[0], "--no-hooks", check=False)
    assert run.returncode
    [line] = failure_lines(run)
    assert "no space left on the disk" in line
    small_disk.release(disk)
    fresh_project.snakemake(BOUNDARIES[0])


@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("structure.h5", store.read_structure),
        ("boundaries.h5", stage_files.read_boundaries),
        ("contours.h5", stage_files.read_curves),
        ("curves.h5", stage_files.read_curves),
        ("curves.h5", stage_files.read_splines),
        ("surface.h5", store.read_bodies),
    ],
)
def test_a_torn_file_of_an_older_run_is_named(name, read, tiny_run, tmp_path):
    whole = (tiny_run.results / "tiny" / "sphere" / name).read_bytes()
    torn = tmp_path / name
    for length in (0, 8, 1000, len(whole) // 2, len(whole) - 1):
        torn.write_bytes(whole[:length])
        with pytest.raises(InputError, match="delete it and run snakemake again"):
            read(torn)


def test_a_torn_file_in_a_run_is_named_with_a_hint(tiny_copy):
    measures = "results/tiny/sphere/metrics.json"
    torn = tiny_copy.results / "tiny" / "sphere" / "structure.h5"
    torn.write_bytes(torn.read_bytes()[:5000])
    run = tiny_copy.snakemake(measures, check=False)
    [line] = failure_lines(run)
    assert str(torn.relative_to(tiny_copy.folder)) in line
    assert "delete it and run snakemake again" in line
    torn.unlink()
    tiny_copy.snakemake(measures, str(torn.relative_to(tiny_copy.folder)))
    store.read_structure(torn)


def test_a_corrupted_checkpoint_falls_back_to_the_one_before(tiny_copy):
    gnn = tiny_copy.results / "gnn"
    whole = (gnn / "model.pt").read_bytes()
    newest = sorted((gnn / "checkpoints").glob("*.pt"))[-1]
    newest.write_bytes(newest.read_bytes()[:2000])
    (gnn / "model.pt").unlink()
    tiny_copy.snakemake("results/gnn/model.pt")
    log = (tiny_copy.folder / "logs" / "gnn" / "train_gnn.log").read_text()
    assert f"{newest.name} cannot be read" in log
    assert "resuming after" in log
    assert (gnn / "model.pt").read_bytes() == whole


def ball(path: Path) -> None:
    grid = np.indices((20, 20, 12)) - np.array([10, 10, 6]).reshape(3, 1, 1, 1)
    nibabel.save(nibabel.Nifti1Image((np.hypot.reduce(grid) < 6).astype(np.uint8), np.eye(4)), path)


def use_masks(project, folder: Path, rows: list[tuple[str, str]]) -> None:
    """Make the project's sheet name these masks: (case, file)."""
    lines = ["case\torgan\tmask", *(f"{case}\tball\t{folder / file}" for case, file in rows)]
    (project.folder / "tiny.tsv").write_text("\n".join(lines) + "\n")


def test_inputs_are_only_read_and_may_have_any_name(fresh_project, tmp_path):
    folder = tmp_path / "Möller & Søn (2)" / "データ $HOME"
    folder.mkdir(parents=True)
    ball(folder / "mask 'a'.nii.gz")
    use_masks(fresh_project, folder, [("a", "mask 'a'.nii.gz")])
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    os.chmod(folder / "mask 'a'.nii.gz", 0o444)
    os.chmod(folder, 0o555)
    try:
        fresh_project.snakemake("results/a/ball/boundaries.h5")
    finally:
        os.chmod(folder, 0o755)
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


def test_changed_voxels_beside_an_untouched_header(fresh_project, tmp_path):
    ball(tmp_path / "mask.nii")
    header, voxels = tmp_path / "mask.mhd", tmp_path / "mask.raw"
    SimpleITK.WriteImage(SimpleITK.ReadImage(str(tmp_path / "mask.nii")), str(header))
    use_masks(fresh_project, tmp_path, [("a", "mask.mhd")])
    target = "results/a/ball/structure.h5"
    fresh_project.snakemake(target)
    assert fresh_project.planned(target) == {}
    provenance = store.read_structure(fresh_project.results / "a" / "ball" / "structure.h5").provenance
    assert set(provenance["files"]) == {str(header), str(voxels)}
    voxels.write_bytes(voxels.read_bytes()[::-1])
    assert fresh_project.planned(target) == {"import_structure": 1}


def test_results_may_be_a_link(fresh_project, tmp_path):
    (tmp_path / "big disk").mkdir()
    fresh_project.results.symlink_to(tmp_path / "big disk")
    fresh_project.snakemake(*BOUNDARIES)
    assert (tmp_path / "big disk" / "tiny" / "sphere" / "boundaries.h5").exists()
    assert fresh_project.results.is_symlink()
    assert fresh_project.planned(*BOUNDARIES) == {}
