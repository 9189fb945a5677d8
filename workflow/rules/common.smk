"""The plan that all rules share, and what a run does before and after its jobs. No rules here."""

import gc
import logging
import os
import re
import signal
import sys
import threading
from pathlib import Path, PurePosixPath

# A plan's millions of objects live until the end: Python looks through them for garbage less often
gc.set_threshold(50_000, 20, 50)

ROOT = Path(workflow.basedir)
# the library's folder stands beside the jobs in a checkout; the wheel carries the workflow within the library
if (ROOT / "scripts" / "cccd").is_dir():
    sys.path.insert(0, str(ROOT / "scripts"))

from snakemake.cli import parse_args

from cccd_networks.devices import DEVICE
from cccd.errors import InputError
from cccd_shapes import FEWEST
from cccd_workflow.job import BATCH, take_placeholders_away
from cccd_workflow.job_lines import shorten
from cccd_workflow.plan.checks import PlannedJob, check_jobs, check_slurm
from cccd_workflow.plan.cohort import near
from cccd_workflow.plan.networks import MODEL
from cccd_workflow.plan.outcome import (
    report_failed_run,
    report_good_run,
    report_interrupted_run,
)
from cccd_workflow.plan.plan import Plan, files_of_comparison
from cccd_workflow.plan.resources import memory, minutes
from cccd_workflow.report.registry import registered
from cccd_segmentation.networks import networks
from cccd.plugins import formats
from cccd.settings.surface import EXPORT_KEYS, FILE_KEYS
from cccd_datasets import PHANTOM_DISTANCES_MM, PHANTOM_ORGANS
from cccd.errors import nearest

#: Made in a run with rows whose files are missing and removed at its end, so that there is always a job to run:
#: Snakemake ends well, and calls none of its handlers, where there is nothing to do.
MISSING_ROWS = Path("results", "missing_rows")


def take_stand_ins_away():
    """Remove what stands in for missing rows and for outputs of failed jobs; say whether there were such jobs."""
    MISSING_ROWS.unlink(missing_ok=True)
    return take_placeholders_away()


if workflow.remote_exec:
    # a job of a cluster: its structures fail one by one, and not all because of one
    os.environ[BATCH] = "1"
elif not any(Path(".snakemake", "locks").glob("*")):
    # those of a run that was killed before it could take them away; of one that still goes on they stay
    take_stand_ins_away()

try:
    plan = Plan.make(config, ROOT, omit_missing=True)
except InputError as error:
    sys.exit(f"Error: {error}")
for name, error in plan.cohort.missing.items():
    print(f"Error: {'/'.join(name)}: {error}", file=sys.stderr)
for note in plan.cohort.notes:
    print(f"Note: {note}", file=sys.stderr)
# from here on every key is there, and numbers given on the command line are numbers
config.update(plan.config)
os.environ[DEVICE] = config["device"]

cohort, library, pick, omit = plan.cohort, plan.library, plan.pick, plan.omit

#: The wildcards case and organ. Not the sheet's own names: a pattern that lists a thousand of them is searched
#: for every file of every job, and planning would take time that grows with the cohort squared.
NAME = "[A-Za-z0-9_-]+"
#: A case; `results/tables` holds the tables of all.
CASE = f"(?!tables/){NAME}"
#: Priorities: first what the longest chain of jobs begins with, as structures wait for the trained network; then
#: the way to each surface, which comparisons wait for; comparisons, by their length; and all else.
FIRST, ON_THE_WAY = 100, 50


def listed(names):
    """Make a pattern of structures or cases, each a tuple of its wildcards."""
    return "|".join(f"{PurePosixPath(*name)}/" for name in names)


def only(names):
    """Constrain the wildcard case to some structures or cases."""
    if set(names) == set(cohort.reconstructed):
        return CASE  # a pattern that lists a thousand takes longer to search
    return f"(?={listed(names) or '(?!)'}){CASE}"


def besides(names):
    """Constrain the wildcard case to all but some structures or cases."""
    return f"(?!{listed(names)}){CASE}" if names else CASE


def check_targets():
    """Refuse what was asked for by name and nothing makes; called after all rules."""
    known = {rule.name: rule for rule in workflow.rules}
    meant = [name for name, rule in known.items() if not rule.output]
    try:
        for target in targets_asked_for():
            plan.check_target(target)
            if target == "shapes" and not CASES:
                problem = f"no organ is in {FEWEST} cases of the sheet"
                raise InputError(target, problem, "add cases")
            made = any(rule.is_producer(target) for rule in workflow.rules)
            if not made and target not in known:
                raise InputError(target, "nothing makes that", nearest(target, meant))
    except InputError as error:
        sys.exit(f"Error: {error}")


def targets_asked_for():
    """Read the targets off the command line, as Snakemake 9.27 knows them only when all files are read."""
    words = sys.argv[1:]
    if workflow.remote_exec or not words or re.match(r"-|\d+$|[^/]*=", words[-1]):
        return []  # most runs name none: the parser takes a third of a second
    return parse_args(words)[1].targets


def check_before_jobs():
    """Refuse what the planned jobs would be refused for, before the first of them starts."""
    jobs = [
        PlannedJob(job.rule.name, dict(job.wildcards.items()), list(job.output))
        for job in workflow.dag.needrun_jobs()
    ]
    here = not workflow.deployment_settings.deployment_method
    try:
        if workflow.executor_plugin.name == "slurm":
            check_slurm()
        check_jobs(jobs, plan, programs_are_here=here)
    except InputError as error:
        sys.exit(f"Error: {error}")


def look_for_jobs_when_one_ends():
    """Let jobs here start as fast as they can.

    Of Snakemake 9.27's limit of 100 a second each look for jobs brings another one a second later, for ever: after
    a hundred jobs it looks a hundred times a second, which took a quarter of a core.
    """
    if workflow.local_exec:
        workflow.scheduler.job_rate_limiter = None


#: Set when the run was asked to end.
interrupted = threading.Event()


def answer_signals():
    """End the jobs, and then the run, at SIGINT and SIGTERM."""

    def interrupt(*_):
        if not interrupted.is_set():
            interrupted.set()
            if os.getpgrp() == os.getpid():  # the processes of the group are this run's
                os.killpg(0, signal.SIGTERM)
            raise KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, interrupt)


def shorten_console():
    """Show a line for each finished job instead of Snakemake's account of it, which its log file keeps."""
    if not (workflow.output_settings.verbose or workflow.remote_exec):
        shorten(logging.getLogger("snakemake.logging"), interrupted.is_set)


def tell_where_results_are():
    """End a good run by saying where to look; one that left structures out is none."""
    if take_stand_ins_away() or cohort.missing:
        report_failed_run(plan)
        sys.exit(1)
    asked = "shapes" in targets_asked_for()
    report_good_run(plan, expand(f"{SHAPES}/modes.html", organ=CASES) if asked else ())


def list_failures():
    """End a bad run: every failure in one line, and a report of the structures that are finished."""
    take_stand_ins_away()
    if interrupted.is_set():
        report_interrupted_run(plan)
    else:
        report_failed_run(plan)


#: What `snakemake shapes` makes of an organ.
SHAPES = "results/shapes/{organ}"
#: The cases of each organ that enough of them have, in the order of their names.
CASES = {}
for name in sorted(cohort.reconstructed):
    CASES.setdefault(name.organ, []).append(name.case)
CASES = {organ: cases for organ, cases in CASES.items() if len(cases) >= FEWEST}


def surfaces_of_organ(wildcards):
    """Return the surfaces of all cases of an organ."""
    cases = CASES[wildcards.organ]
    return [f"results/{case}/{wildcards.organ}/surface.h5" for case in cases]


def fits_of_round(wildcards, number):
    """Return the fits of a round to all cases of an organ; before the first round there are none."""
    folder = f"results/shapes/{wildcards.organ}/round_{number}"
    return [f"{folder}/{case}.h5" for case in CASES[wildcards.organ] if number]


def groups_of_organ(wildcards):
    """Return the groups of all cases of an organ."""
    names = [(case, wildcards.organ) for case in CASES[wildcards.organ]]
    return [cohort.rows[name]["group"] for name in names]
