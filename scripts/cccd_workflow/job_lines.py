"""What a person sees while a workflow runs: what is done, with the time left.

Snakemake's own log prints the files, reasons and resources of every job: 1,650 lines for the default cohort.
All of it stays in its log file.
"""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable, Sequence
from typing import TextIO

from cccd_labels.progress import FORESEEN, duration

#: Events of Snakemake's log that `JobLines` replaces (`snakemake_interface_logger_plugins.common.LogEvent`).
REPLACED = {
    "job_info", "group_info", "job_started", "job_finished", "job_error", "group_error", "shellcmd",
    "progress", "resources_info",
}  # fmt: skip
#: ... and how other lines begin: of its choice of jobs, of the call of a job that has said why it failed.
BESIDES = ("Select jobs to execute", "RuleException")


def is_of_jobs(record: logging.LogRecord) -> bool:
    """Whether a record of Snakemake's log is of what happens to jobs."""
    return str(getattr(record, "event", "")) in REPLACED or str(record.msg).startswith(BESIDES)


def shorten(logger: logging.Logger, is_interrupted: Callable[[], bool]) -> None:
    """Let the handlers of a console leave out what `JobLines` says in their place.

    Parameters
    ----------
    logger : logging.Logger
        Snakemake's.
    is_interrupted : callable
        Whether the run was asked to end: then jobs do not fail, and nothing but the last line is said.
    """

    def is_shown(record: logging.LogRecord) -> bool:
        return not (is_of_jobs(record) or is_interrupted())

    for handler in logger.handlers:
        if isinstance(handler, logging.StreamHandler) and not isinstance(handler, logging.FileHandler):
            handler.addFilter(is_shown)
    lines = JobLines()
    lines.addFilter(lambda record: not is_interrupted())
    logger.addHandler(lines)


class JobLines(logging.Handler):
    """Handler of Snakemake's log that writes a line for each job that has finished or failed.

    Parameters
    ----------
    stream : text stream, optional
    clock : callable
        Gives seconds.
    """

    def __init__(self, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self.stream, self.clock, self.begin = stream or sys.stderr, clock, clock()
        self.running: dict[int, tuple[str, float]] = {}
        self.finished: list[int] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Follow one record."""
        facts = vars(record)
        event = str(facts.get("event", ""))
        if event == "job_info":
            # a job of the whole run has no wildcards
            names = [facts["rule_name"], "/".join(map(str, facts["wildcards"].values()))]
            self.running[facts["jobid"]] = " ".join(filter(None, names)), self.clock()
        elif event == "job_error" and facts["jobid"] in self.running:
            name, _ = self.running.pop(facts["jobid"])
            self._failed(name, [*(facts.get("log") or []), *(facts.get("aux_logs") or [])])
        elif event == "group_error":  # its jobs follow, each with a record of its own
            self._failed(f"group of {len(facts['job_error_info'])} jobs", facts.get("aux_logs") or [])
        elif event == "job_finished":
            self.finished.append(facts["job_id"])
        elif event == "progress":
            self._progress(facts["done"], facts["total"])

    def _progress(self, done: int, total: int) -> None:
        """Write the jobs that have finished since the last time, with the time that the others take."""
        now = self.clock()
        left = ""
        if FORESEEN * total <= done < total:
            left = f"; about {duration((now - self.begin) / done * (total - done))} left"
        for job in self.finished:
            name, begun = self.running.pop(job, ("", now))
            if name:
                self._write(f"[{done:>{len(str(total))}}/{total}] {name}: {duration(now - begun)}{left}")
        self.finished.clear()

    def _failed(self, name: str, logs: Sequence[object]) -> None:
        self._write(f"failed: {name}" + (f" (see {', '.join(map(str, logs))})" if logs else ""))

    def _write(self, line: str) -> None:
        self.stream.write(line + "\n")
        self.stream.flush()
