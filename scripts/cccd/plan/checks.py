"""What the planned jobs would be refused for, found before the first of them starts and loses its outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cccd.disk_space import check_room
from cccd.extras import check_extra
from cccd.plan.cohort import StructureName
from cccd.plan.plan import Plan
from cccd.settings.formats import TETRAHEDRA_FORMATS

__all__ = ["PlannedJob", "check_jobs", "extra_of"]

#: Rules that need an extra whatever they work on; `extra_of` knows the others.
_NEEDS = {
    "generate_graphs": "gnn",
    "train_gnn": "gnn",
    "adopt_gnn": "gnn",
    "evaluate_gnn": "gnn",
    "train_segmenter": "segment",
    "export_solid": "cad",
    "export_scene": "cad",
}


@dataclass(frozen=True)
class PlannedJob:
    """A job that a run is going to start."""

    rule: str
    wildcards: Mapping[str, str]
    outputs: Sequence[str]

    @property
    def makes_tetrahedra(self) -> bool:
        """Whether it fills surfaces with tetrahedra."""
        return self.rule == "fill_case" or self.wildcards.get("solid_format") in TETRAHEDRA_FORMATS


def extra_of(job: PlannedJob, plan: Plan) -> str | None:
    """Name the extra that a job cannot do without; most need none."""
    if job.makes_tetrahedra:
        return "fe"
    if job.rule == "fetch_file":
        address = plan.cohort.remote[job.outputs[0]].address
        return "s3" if address.startswith("s3:") else None
    if job.rule == "make_contours":
        script = plan.cohort.contour_script(StructureName(job.wildcards["case"], job.wildcards["organ"]))
        return "gnn" if script == "order_contours" else None
    if job.rule == "segment_structure":
        return None if plan.segmenter.is_installed else "segment"
    return _NEEDS.get(job.rule)


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
        needing = {extra_of(job, plan): job for job in jobs}
        for extra in sorted(filter(None, needing)):
            job = needing[extra]
            check_extra(extra, f"{job.rule} {'/'.join(job.wildcards.values())}")
    check_room(Path("results"), [file for job in jobs for file in job.outputs])
