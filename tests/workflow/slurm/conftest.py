"""A real Slurm of two nodes on this machine, and the pipeline submitted to it."""

import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import psutil
import pytest

PROFILES = Path("workflow/profiles")
#: The watchdog's patience (s): longer than the plugin's own 180 s between two looks at its jobs.
QUIET_S = 240
#: Where this cluster differs from a site's: one disk, and a queue that is nobody else's.
QUICK = {
    "slurm": [
        "--slurm-no-account",
        "--slurm-status-command=squeue",
        "--slurm-init-seconds-before-status-checks=2",
    ],
    "generic": ["--seconds-between-status-checks=1"],
}


def kill_tree(pid: int) -> None:
    """End a process and all that it started, at once and without a word."""
    try:
        parent = psutil.Process(pid)
        for process in [parent, *parent.children(recursive=True)]:
            process.send_signal(signal.SIGKILL)
    except psutil.NoSuchProcess:
        pass


@dataclass
class Cluster:
    """Slurm's daemons, by their pid files."""

    folder: Path

    def _pid(self, daemon: str) -> int:
        return int((self.folder / "run" / f"{daemon}.pid").read_text())

    def stop(self, daemon: str) -> None:
        process = psutil.Process(self._pid(daemon))
        process.terminate()
        process.wait(20)

    def start(self, daemon: str) -> None:
        name, _, node = daemon.partition("-")
        command = [name, "-f", str(self.folder / "slurm.conf"), *(["-N", node] if node else [])]
        subprocess.run(command, check=True)

    def jobs(self, *options: str) -> list[str]:
        """Ids of the jobs that run now."""
        query = ["squeue", "--noheader", "--format=%i", "--states=RUNNING", *options]
        return subprocess.run(query, capture_output=True, text=True, check=False).stdout.split()

    def wait_for_jobs(self, *options: str) -> list[str]:
        """Wait until some job runs."""
        end = time.monotonic() + 90
        while not (jobs := self.jobs(*options)):
            assert time.monotonic() < end, "no job within 90 s"
            time.sleep(0.3)
        return jobs

    def history(self) -> list[dict[str, str]]:
        """What Slurm says about every job it remembers, in the order of their submission."""
        said = subprocess.run(
            ["scontrol", "show", "job", "-o"], capture_output=True, text=True, check=True
        ).stdout
        return [dict(re.findall(r"(\w+)=(\S*)", line)) for line in said.splitlines() if "=" in line]

    def lose(self, node: str) -> None:
        """End a node's daemon and its jobs, as a power cut does."""
        jobs = self.jobs(f"--nodelist={node}")
        kill_tree(self._pid(f"slurmd-{node}"))
        for process in psutil.process_iter(["cmdline"]):
            title = " ".join(process.info["cmdline"] or [])
            if any(title.startswith(f"slurmstepd: [{job}.") for job in jobs):
                kill_tree(process.pid)


@dataclass
class Submission:
    """A run of the pipeline on the cluster."""

    project: object
    command: list[str]
    quiet_s: int
    process: subprocess.Popen = field(init=False)

    def __post_init__(self):
        self.process = subprocess.Popen(
            self.command,
            cwd=self.project.folder,
            env=self.project.surroundings()["env"] | {"CCCD_QUIET_S": str(self.quiet_s)},
            stdout=(self.project.folder / "said.txt").open("w"),
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

    @property
    def said(self) -> str:
        return (self.project.folder / "said.txt").read_text()

    def done(self, seconds: float) -> None:
        """Wait for its end; it must be a good one."""
        status = self.process.wait(seconds)
        assert status == 0, "\n".join(self.said.splitlines()[-60:])


@pytest.fixture(scope="session")
def cluster():
    if "CCCD_SLURM" not in os.environ:
        pytest.skip("tests/workflow/slurm/run starts a Slurm and then these tests")
    return Cluster(Path(os.environ["CCCD_SLURM"]))


@pytest.fixture
def submit(cluster, fresh_project):
    """Start the pipeline: ``submit("slurm", *options)``. Whatever still runs at the end is ended."""
    started = []

    def start(profile: str, *options: str, watchdog: bool = False, quiet_s: int = QUIET_S) -> Submission:
        base = [sys.executable, "-m", "snakemake", "--workflow-profile", PROFILES / profile]
        if watchdog:
            base = [sys.executable, PROFILES / profile / "submit"]
        own = ["--cores=2", "--jobs=8", "--latency-wait=10", "--configfile=tiny.yaml"]
        own += QUICK[profile]
        started.append(Submission(fresh_project, [*map(str, base), *own, *options], quiet_s))
        return started[-1]

    yield start
    for submission in started:
        kill_tree(submission.process.pid)
        submission.process.wait()
    subprocess.run(["scancel", "--user", str(os.getuid())], check=False)
