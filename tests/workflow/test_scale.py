"""Four hundred structures: planning their five thousand jobs takes time in proportion and little memory."""

import subprocess
import sys

STRUCTURES = 400
#: Snakemake keeps some 20 KB of each job, and needs some 130 MB without any.
MEGABYTES = 300
#: The plan costs at most so many times that of as many structures with fourteen bare jobs each (1.4
#: measured). Seconds by themselves say little: a plan took 22 of the processor here and 38 there.
TIMES_BARE = 1.8

#: Fourteen rules in a row for each structure: the peer, planned in the same run.
BARE = f"""
rule all:
    input: [f"results/c{{number}}/14" for number in range({STRUCTURES})]
for step in range(1, 15):
    rule:
        name: f"step{{step}}"
        input: f"results/{{{{case}}}}/{{step - 1}}" if step > 1 else []
        output: f"results/{{{{case}}}}/{{step}}"
        threads: 1
        resources: mem_mb=1000, runtime=10
        shell: "touch {{output}}"
"""

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
    return used_by(subprocess.run(command, **project.surroundings(), check=False))


def plan_bare(folder):
    """The same of the peer."""
    (folder / "Snakefile").write_text(BARE)
    command = [sys.executable, "-c", PLAN, "--dry-run", "--quiet", "rules", "--cores", "2"]
    return used_by(subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False))


def used_by(run):
    """Jobs, seconds of the processor and peak memory in MB that a plan printed."""
    assert run.returncode == 0, run.stderr[-2000:]
    jobs = next(int(line.split()[1]) for line in run.stdout.splitlines() if line.startswith("total "))
    used = next(line.split() for line in run.stderr.splitlines() if line.startswith("USED"))
    return jobs, float(used[1]), float(used[2])


def test_planning_hundreds_of_structures(fresh_project, tmp_path):
    few, short, _ = plan(fresh_project, 100)
    many, long, megabytes = plan(fresh_project, STRUCTURES)
    assert few > 5 * 100
    assert many > 5 * STRUCTURES
    _, bare, _ = plan_bare(tmp_path)
    # of the processor, so that a busy machine does not count
    assert long < TIMES_BARE * bare
    assert long < 5 * short
    assert megabytes < MEGABYTES
