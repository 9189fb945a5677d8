import errno
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from cccd.errors import InputError
from cccd.job import job

SCRIPTS = Path(__file__).parents[2] / "scripts"


def run_job(body, log):
    code = textwrap.dedent(
        f"""
        import errno
        from cccd.errors import InputError
        from cccd.job import job
        with job({str(log)!r}, "case/organ"):
            {body}
        """
    )
    return subprocess.run(
        [sys.executable, "-c", code],
        env={"PYTHONPATH": str(SCRIPTS), "PATH": ""},
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
    assert log.with_name("job.log.failed").read_text().startswith("case/organ: died without a word")


def test_disk_full_in_a_library_call_is_named(tmp_path):
    with pytest.raises(SystemExit) as error, job(tmp_path / "job.log", "x"):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert error.value.code == 1


def test_an_input_error_survives_pickling():
    import pickle

    error = InputError("location", "problem", "hint")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
