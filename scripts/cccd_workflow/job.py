"""What every job of the workflow does around its work: a log, and errors in one line.

In a batch (several structures in one job of a cluster) Snakemake ends all when one fails, and takes away what
the others made. There, a job that fails leaves placeholders instead of its outputs and ends well; jobs that
would read them do the same; and the end of the run takes the placeholders away, lists what failed and ends
with an error (`workflow/rules/common.smk`).
"""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import signal
import sys
import traceback
from collections.abc import Iterable, Iterator
from pathlib import Path

from cccd.console import interruptible
from cccd.errors import InputError
from cccd.extras import missing_extra

#: Stands in the environment of the jobs of a batch.
BATCH = "CCCD_BATCH"

#: How the line of a job ends that did not fail, but was asked to end.
INTERRUPTED = "interrupted"

#: What stands in a file in place of an output, and where the placeholders of a run are listed.
_PLACEHOLDER = b"CCCD: what this file is made of failed\n"
_LISTS = Path("logs") / "placeholders"


@contextlib.contextmanager
def job(
    log: str | Path, name: str, inputs: Iterable[str | Path] = (), outputs: Iterable[str | Path] = ()
) -> Iterator[logging.Logger]:
    """Run a job's body: log to ``log``, and end with one clear line when the input is at fault.

    Parameters
    ----------
    log : path
        The rule's log file. Beside it, ``<log>.failed`` holds the one line of a failure for the
        summary at the end of the run, and is removed when the job succeeds. It stands there from the
        start, for what ends the process at once: a kill, or a crash in a library.
    name : str
        What the user calls the work, e.g. ``"mni152/brain"``.
    inputs, outputs : iterable of path
        The job's files.

    Raises
    ------
    SystemExit
        With status 1 after any error, 130 after SIGINT and SIGTERM; the traceback of an unexpected error goes
        to the log only. In a batch with status 0, after an error that another attempt would meet again, and
        where an input is a placeholder.
    """
    log, made = Path(log), [Path(path) for path in outputs]
    in_batch = BATCH in os.environ and bool(made)
    if any(map(_is_placeholder, inputs)):
        if in_batch:
            _leave_placeholders(log, made)
        else:
            print(f"{name}: skipped, because a structure that it needs failed", file=sys.stderr)
        sys.exit(0 if in_batch else 1)
    log.parent.mkdir(parents=True, exist_ok=True)
    failed = log.with_name(f"{log.name}.failed")

    def tell(line: str) -> None:
        with contextlib.suppress(OSError):
            failed.write_text(" ".join(line.split()) + "\n", encoding="utf-8")

    tell(f"{name}: ended without a message (killed, out of memory, or a crash on a damaged file); see {log}")
    logging.basicConfig(
        filename=log, filemode="w", level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s"
    )
    logging.captureWarnings(True)
    logger = logging.getLogger("cccd")
    try:
        with interruptible():
            yield logger
    except KeyboardInterrupt:
        logger.error("interrupted")
        tell(f"{name}: {INTERRUPTED}")
        sys.exit(128 + signal.SIGINT)
    except Exception as error:
        if isinstance(error, InputError):
            line = f"{name}: {error}"
        elif isinstance(error, ModuleNotFoundError):
            line = str(missing_extra(error, name))
        elif isinstance(error, MemoryError):
            line = f"{name}: out of memory; run fewer jobs at once or give the job more"
        elif isinstance(error, OSError) and error.errno == errno.ENOSPC:
            line = f"{name}: no space left on the disk ({error.filename}); free some space and run again"
        else:
            line = f"{name}: {type(error).__name__}: {error}; see {log}"
        logger.error("%s\n%s", line, traceback.format_exc())
        tell(line)
        print(f"Error: {line}", file=sys.stderr)
        if in_batch and not isinstance(error, (MemoryError, ModuleNotFoundError, OSError)):
            _leave_placeholders(log, made)
            sys.exit(0)
        sys.exit(1)
    failed.unlink(missing_ok=True)


def _is_placeholder(path: str | Path) -> bool:
    try:
        return (
            os.path.getsize(path) == len(_PLACEHOLDER)
            and os.path.isfile(path)
            and Path(path).read_bytes() == _PLACEHOLDER
        )
    except OSError:
        return False


def _leave_placeholders(log: Path, outputs: list[Path]) -> None:
    """Write placeholders, and first list them: the next run takes away what a killed one left."""
    _LISTS.mkdir(parents=True, exist_ok=True)
    lines = "".join(f"{path}\n" for path in outputs)
    (_LISTS / log.as_posix().replace("/", "_")).write_text(lines, encoding="utf-8")
    for path in outputs:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(_PLACEHOLDER)


def take_placeholders_away() -> bool:
    """Remove the placeholders that batches left, so that their jobs run again; say whether there were any.

    Called where the workflow runs, when none of its jobs does.
    """
    lists = sorted(_LISTS.glob("*")) if _LISTS.is_dir() else []
    found = False
    for file in lists:
        for path in map(Path, file.read_text(encoding="utf-8").splitlines()):
            if _is_placeholder(path):
                path.unlink()
                found = True
        file.unlink()
    return found
