"""A thousand structures: planning their thousands of jobs takes seconds and little memory."""

import subprocess
import sys

import pytest

STRUCTURES = 1000
MEGABYTES = 1000
SURFACES = ("metrics.json", "picture.png", "comparisons/isosurfaces.csv", "comparisons/thick_slices.csv")

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


# 14 s and 22 s on a machine of one's own (docs/scale.md); a third more where threads share a core
@pytest.mark.parametrize(("wanted", "per_structure", "seconds"), [(SURFACES, 8, 20), ((), 13, 30)])
def test_planning_a_thousand_structures(fresh_project, wanted, per_structure, seconds):
    roles = ["both"] * 5 + ["reconstruct"] * (STRUCTURES - 5)
    rows = [f"c{number}\tsphere\tphantom\t{role}" for number, role in enumerate(roles)]
    sheet = "\n".join(["case\torgan\tsource\trole", *rows])
    (fresh_project.folder / "tiny.tsv").write_text(sheet + "\n")
    targets = [f"results/c{n}/sphere/{name}" for n in range(STRUCTURES) for name in wanted]
    arguments = fresh_project.command("--dry-run", "--quiet", "rules", "--", *targets)[3:]
    command = [sys.executable, "-c", PLAN, *arguments]
    run = subprocess.run(command, **fresh_project.surroundings(), check=False)
    assert run.returncode == 0, run.stderr[-2000:]
    jobs = next(int(line.split()[1]) for line in run.stdout.splitlines() if line.startswith("total "))
    assert jobs >= per_structure * STRUCTURES
    used = next(line.split() for line in run.stderr.splitlines() if line.startswith("USED"))
    assert float(used[1]) < seconds  # of the processor, so that a busy machine does not count
    assert float(used[2]) < MEGABYTES
