"""What the planned jobs would be refused for, found before the first of them starts and loses its outputs."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cccd.errors import InputError
from cccd.extras import check_extra
from cccd.plugins import formats
from cccd_workflow.disk_space import check_room
from cccd_workflow.plan.cohort import StructureName
from cccd_workflow.plan.plan import Plan

#: Rules that need an extra whatever they work on; `extras_of` knows the others.
_NEEDS = {
    "generate_graphs": "gnn",
    "train_gnn": "gnn",
    "adopt_gnn": "gnn",
    "evaluate_gnn": "gnn",
    "train_segmenter": "segment",
}


#: A controller that is busy answers within a minute.
SLURM_ANSWERS_S = 60


@dataclass(frozen=True)
class PlannedJob:
    """A job that a run is going to start."""

    rule: str
    wildcards: Mapping[str, str]
    outputs: Sequence[str]


def extras_of(job: PlannedJob, plan: Plan) -> set[str]:
    """Name the extras that a job cannot do without; most need none."""
    suffixes = {Path(file).name.partition(".")[2] for file in job.outputs}
    asked = {
        "fe": not suffixes.isdisjoint(formats("tetrahedra")),
        "cad": not suffixes.isdisjoint(formats("solids")),
        _NEEDS.get(job.rule, ""): job.rule in _NEEDS,
    }
    if job.rule == "fetch_file":
        asked["s3"] = plan.cohort.remote[job.outputs[0]].address.startswith("s3:")
    if job.rule.startswith("import_"):
        name = StructureName(job.wildcards["case"], job.wildcards["organ"])
        asked["gnn"] = bool(plan.model_files(name))
    if job.rule == "segment_structure":
        asked["segment"] = not plan.segmenter.is_installed
    return {extra for extra, needed in asked.items() if needed}


def check_jobs(jobs: Sequence[PlannedJob], plan: Plan, programs_are_here: bool) -> None:
    """Refuse what the jobs would be refused for.

    Parameters
    ----------
    jobs : sequence of PlannedJob
        Those that are going to start.
    plan : Plan
        The run.
    programs_are_here : bool
        Whether jobs run with what is installed here. An environment that is made for them has its own extras:
        then only the disk is looked at.

    Raises
    ------
    InputError
        An extra that is not installed, or a disk without room.
    """
    if programs_are_here:
        needing = {extra: job for job in jobs for extra in extras_of(job, plan)}
        for extra in sorted(needing):
            job = needing[extra]
            check_extra(extra, f"{job.rule} {'/'.join(job.wildcards.values())}")
    check_room(Path("results"), [file for job in jobs for file in job.outputs])


def check_slurm() -> None:
    """Refuse a run on Slurm where no Slurm answers: Snakemake would wait for it and hear no signal."""
    asked = ["sinfo", "--noheader", "--format=%P"]
    try:
        subprocess.run(asked, capture_output=True, check=True, timeout=SLURM_ANSWERS_S)
    except (OSError, subprocess.SubprocessError):
        hint = "start the run where sinfo lists partitions, or leave out --profile slurm"
        raise InputError("slurm", "no Slurm answers here", hint) from None
