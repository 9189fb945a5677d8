"""What every job of the workflow does around its work: a log, and errors in one line."""

from __future__ import annotations

import contextlib
import errno
import logging
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path

from cccd.errors import InputError
from cccd.extras import missing_extra

__all__ = ["job"]


@contextlib.contextmanager
def job(log: str | Path, name: str) -> Iterator[logging.Logger]:
    """Run a job's body: log to ``log``, and end with one clear line when the input is at fault.

    Parameters
    ----------
    log : path
        The rule's log file. Beside it, ``<log>.failed`` holds the one line of a failure for the
        summary at the end of the run, and is removed when the job succeeds. It stands there from the
        start, for what ends the process at once: a kill, or a crash in a library.
    name : str
        What the user calls the work, e.g. ``"mni152/brain"``.

    Raises
    ------
    SystemExit
        With status 1 after any error; the traceback of an unexpected one goes to the log only.
    """
    log = Path(log)
    log.parent.mkdir(parents=True, exist_ok=True)
    failed = log.with_name(f"{log.name}.failed")

    def tell(line: str) -> None:
        with contextlib.suppress(OSError):
            failed.write_text(" ".join(line.split()) + "\n", encoding="utf-8")

    tell(f"{name}: died without a word (killed, out of memory, or a crash over a damaged file); see {log}")
    logging.basicConfig(
        filename=log, filemode="w", level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s"
    )
    logging.captureWarnings(True)
    logger = logging.getLogger("cccd")
    try:
        yield logger
    except Exception as error:
        if isinstance(error, InputError):
            line = f"{name}: {error}"
        elif isinstance(error, ModuleNotFoundError):
            line = str(missing_extra(error, name))
        elif isinstance(error, MemoryError):
            line = f"{name}: out of memory; run fewer jobs at once or give the job more"
        elif isinstance(error, OSError) and error.errno == errno.ENOSPC:
            line = f"{name}: no space left on the disk ({error.filename}); free some and run again"
        else:
            line = f"{name}: {type(error).__name__}: {error}; see {log}"
        logger.error("%s\n%s", line, traceback.format_exc())
        tell(line)
        print(f"Error: {line}", file=sys.stderr)
        sys.exit(1)
    failed.unlink(missing_ok=True)
