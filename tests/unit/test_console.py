"""Lines for people while a workflow runs."""

import io
import logging

import pytest

from cccd_labels.progress import OrganLines, duration
from cccd_workflow.job_lines import REPLACED, JobLines, is_of_jobs


def record(event=None, message="", **fields):
    return logging.makeLogRecord({"msg": message, "event": event, **fields})


@pytest.fixture
def lines():
    now = [0.0]
    handler = JobLines(io.StringIO(), lambda: now[0])

    def run(seconds, *records):
        now[0] += seconds
        for one in records:
            handler.emit(one)
        return handler.stream.getvalue().splitlines()

    return run


def job(number, rule="loft_surface", **wildcards):
    return record("job_info", jobid=number, rule_name=rule, wildcards=wildcards)


def done(number, count, total):
    return record("job_finished", job_id=number), record("progress", done=count, total=total)


def test_a_job_is_one_line_with_its_time_and_that_of_the_others(lines):
    lines(0, job(3, case="anna", organ="liver"), job(4, "build_report"))
    (line,) = lines(30, *done(3, 1, 4))
    assert line == "[1/4] loft_surface anna/liver: 30 s; about 2 min left"
    assert lines(90, *done(4, 4, 4))[1:] == ["[4/4] build_report: 2 min"]


def test_the_time_left_is_not_guessed_from_the_first_of_many(lines):
    lines(0, job(1))
    assert lines(5, *done(1, 1, 100)) == ["[  1/100] loft_surface: 5 s"]


def test_a_failure_names_its_log(lines):
    lines(0, job(1, case="a", organ="b"))
    failure = record("job_error", jobid=1, log=["logs/a/b/loft_surface.log"])
    assert lines(1, failure, failure) == ["failed: loft_surface a/b (see logs/a/b/loft_surface.log)"]


def test_a_failure_on_a_cluster_names_the_schedulers_log(lines):
    lines(0, job(1, case="a", organ="b"))
    group = record("group_error", job_error_info=[{}, {}], aux_logs=["slurm/7.log"])
    failure = record("job_error", jobid=1, log=["a.log"], aux_logs=["slurm/22.log"])
    said = ["failed: group of 2 jobs (see slurm/7.log)", "failed: loft_surface a/b (see a.log, slurm/22.log)"]
    assert lines(1, group, failure) == said


def test_errors_and_the_table_of_jobs_stay():
    assert is_of_jobs(record("job_info"))
    assert is_of_jobs(record(message="Select jobs to execute..."))
    assert is_of_jobs(record("error", "RuleException: CalledProcessError in file structures.smk"))
    assert not is_of_jobs(record("run_info"))
    assert not is_of_jobs(record("error", "MissingInputException"))
    assert not is_of_jobs(record(message="Complete log(s): a.log"))


def test_snakemake_has_the_events_that_are_replaced():
    from snakemake_interface_logger_plugins.common import LogEvent

    assert {str(event) for event in LogEvent} >= REPLACED


@pytest.mark.parametrize(
    ("seconds", "said"), [(0.2, "0 s"), (59.4, "59 s"), (61, "1 min"), (3600, "1 h 0 min")]
)
def test_durations(seconds, said):
    assert duration(seconds) == said


def test_a_label_map_says_now_and_then_how_far_it_is_without_a_terminal():
    now, stream = [0.0], io.StringIO()
    lines = OrganLines({1: 300, 2: 100, 3: 100}, stream, lambda: now[0])
    for seconds, number, name in ((0, 1, "brain"), (60, 2, "left eye"), (65, 3, "right eye")):
        now[0] = seconds
        lines.begins(name)
        lines.done(number)
    now[0] = 70
    lines.begins("shared walls")
    assert stream.getvalue().splitlines() == [
        "[1/3] left eye ...; about 40 s left for surfaces",
        "[3/3] shared walls ...",
    ]


def test_a_label_map_writes_no_lines_beside_a_bar():
    now, stream = [0.0], io.StringIO()
    stream.isatty = lambda: True
    lines = OrganLines({1: 1}, stream, lambda: now[0])
    now[0] = 100
    lines.begins("shared walls")
    assert stream.getvalue() == ""
