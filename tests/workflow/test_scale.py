"""A thousand structures: planning their fourteen thousand jobs takes time in proportion and little memory."""

import subprocess
import sys

MEGABYTES = 1000
#: 22 s on a machine of one's own (docs/scale.md); a third more where threads share a core.
SECONDS = 30

#: Snakemake's own main, and what it used.
PLAN = """
import resource, sys
from snakemake.cli import main
try:
    main()
finally:
    used = resource.getrusage(resource.RUSAGE_SELF)
    # ru_maxrss would carry the peak of the process that forked this one.
    peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
    print("USED", used.ru_utime + used.ru_stime, int(peak.split()[1]) / 1024, file=sys.stderr)
"""


def plan(project, structures):
    """Jobs, seconds of the processor and peak memory in MB of a dry run."""
    roles = ["both"] * 5 + ["reconstruct"] * (structures - 5)
    rows = [f"c{number}\tsphere\tphantom\t{role}" for number, role in enumerate(roles)]
    sheet = "\n".join(["case\torgan\tsource\trole", *rows])
    (project.folder / "tiny.tsv").write_text(sheet + "\n")
    arguments = project.command("--dry-run", "--quiet", "rules")[3:]
    command = [sys.executable, "-c", PLAN, *arguments]
    run = subprocess.run(command, **project.surroundings(), check=False)
    assert run.returncode == 0, run.stderr[-2000:]
    jobs = next(int(line.split()[1]) for line in run.stdout.splitlines() if line.startswith("total "))
    used = next(line.split() for line in run.stderr.splitlines() if line.startswith("USED"))
    return jobs, float(used[1]), float(used[2])


def test_planning_a_thousand_structures(fresh_project):
    few, short, _ = plan(fresh_project, 100)
    many, long, megabytes = plan(fresh_project, 1000)
    assert few > 8 * 100
    assert many > 8 * 1000
    assert long < SECONDS  # of the processor, so that a busy machine does not count
    assert long < 12 * short
    assert megabytes < MEGABYTES
