import subprocess
import sys
import textwrap

import pytest
from support import SCRIPTS

from cccd.errors import InputError
from cccd_workflow.job import BATCH, take_placeholders_away


def run_job(body, log, files="", **batch):
    code = textwrap.dedent(
        f"""
        import errno
        from cccd.errors import InputError
        from cccd_workflow.job import job
        with job({str(log)!r}, "case/organ"{files}):
            {body}
        """
    )
    return subprocess.run(
        [sys.executable, "-c", code],
        env={"PYTHONPATH": str(SCRIPTS), "PATH": ""} | batch,
        cwd=log.parent if batch else None,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("raise InputError('a.nii row 2', 'is\\n empty', 'give one')", "a.nii row 2: is empty; give one"),
        ("raise OSError(errno.ENOSPC, 'x', 'out.h5')", "no space left on the disk"),
        ("raise MemoryError", "out of memory"),
        ("1 / 0", "ZeroDivisionError"),
    ],
)
def test_every_failure_is_one_line_and_a_nonzero_exit(tmp_path, body, words):
    log = tmp_path / "deep" / "job.log"
    run = run_job(body, log)
    assert run.returncode == 1
    assert run.stderr.count("\n") == 1
    assert run.stderr.startswith("Error: case/organ: ")
    assert words in run.stderr
    assert "Traceback" in log.read_text()
    assert words in log.with_name("job.log.failed").read_text()


def test_success_clears_an_earlier_failure(tmp_path):
    log = tmp_path / "job.log"
    run_job("1 / 0", log)
    assert run_job("pass", log).returncode == 0
    assert not log.with_name("job.log.failed").exists()


def test_a_job_that_is_killed_leaves_its_line(tmp_path):
    log = tmp_path / "job.log"
    assert run_job("import os; os.kill(os.getpid(), 9)", log).returncode == -9
    assert log.with_name("job.log.failed").read_text().startswith("case/organ: ended without a message")


def test_an_input_error_survives_pickling():
    import pickle

    error = InputError("location", "problem", "hint")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_a_batch_goes_on_without_the_structure_that_failed(tmp_path, monkeypatch):
    first, second = tmp_path / "contours.h5", tmp_path / "curves.h5"
    log, later = tmp_path / "make_contours.log", tmp_path / "fit_curves.log"
    batch = {BATCH: "1"}
    files = f", [], [{str(first)!r}]"
    run = run_job("raise InputError('a.nii', 'is empty', 'give one')", log, files, **batch)
    assert run.returncode == 0
    assert "a.nii: is empty" in log.with_name("make_contours.log.failed").read_text()
    # what is made of it is not begun, and adds no line of its own
    files = f", [{str(first)!r}], [{str(second)!r}]"
    assert run_job("raise AssertionError", later, files, **batch).returncode == 0
    assert second.read_bytes() == first.read_bytes()
    assert not later.with_name("fit_curves.log.failed").exists()
    # outside a batch, a table of the whole cohort ends with an error
    run = run_job("raise AssertionError", later, files)
    assert run.returncode == 1
    assert "skipped, because" in run.stderr
    # what a better attempt has written since stays
    second.write_bytes(b"curves")
    monkeypatch.chdir(tmp_path)
    assert take_placeholders_away()
    assert not first.exists()
    assert second.read_bytes() == b"curves"
    assert not take_placeholders_away()


@pytest.mark.parametrize("body", ["raise MemoryError", "raise OSError(errno.ENOSPC, 'x', 'out.h5')"])
def test_what_another_attempt_may_mend_ends_a_batch(tmp_path, body):
    output = tmp_path / "out.h5"
    run = run_job(body, tmp_path / "job.log", f", [], [{str(output)!r}]", **{BATCH: "1"})
    assert run.returncode == 1
    assert not output.exists()
