"""For all tests, those in docstrings too: the cores are shared out, and what needs an absent extra skips."""

import doctest
import os
from importlib.util import find_spec
from pathlib import Path

import pytest

# one thread each, read when NumPy is imported: the workers fill the cores
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

#: Memory in GB for a worker and what its tests start: 1 once all is imported.
WORKER_GB = 2


def pytest_addoption(parser):
    """Let `.ci/run` ask for what skips."""
    parser.addoption(
        "--skipped", metavar="FILE", help="write what skips here: pytest @FILE runs it elsewhere"
    )


def pytest_configure(config):
    """Keep what skips, in the process that hears of all workers."""
    file = config.getoption("skipped")
    if file and not hasattr(config, "workerinput"):
        config.pluginmanager.register(Skipped(Path(file)))


def pytest_xdist_auto_num_workers(config):
    """Take every core that has memory, and no more workers than files are named; one file needs none."""
    if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ:
        return None
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    workers = min(os.cpu_count() or 1, memory // (WORKER_GB << 30))
    paths = {Path(argument.split("::")[0]) for argument in config.args}
    if all(path.is_file() for path in paths):
        workers = min(workers, len(paths))
    return workers if workers > 1 else 0


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Skip a docstring's example that needs an extra which is not installed; tests say so themselves."""
    try:
        return (yield)
    except doctest.UnexpectedException as failure:
        absent = absent_extra(failure.exc_info[1])
        if absent is None:
            raise
        pytest.skip(f"{absent} is not installed")


def absent_extra(error):
    """Name the module of an extra that is not installed, by the error that it caused; else ``None``."""
    from cccd.extras import EXTRAS  # once coverage listens

    known = {module for modules in EXTRAS.values() for module in modules}
    while error is not None:
        if isinstance(error, ModuleNotFoundError):
            module = (error.name or "").split(".")[0]
            return module if module in known and find_spec(module) is None else None
        error = error.__cause__ or error.__context__
    return None


class Skipped:
    """Names of tests, and of whole files, that skip: one a line."""

    def __init__(self, file):
        self.file, self.names = file, {}

    def pytest_runtest_logreport(self, report):
        """Keep the name of a test."""
        if report.skipped and not hasattr(report, "wasxfail"):
            self.names[report.nodeid] = True

    def pytest_collectreport(self, report):
        """Keep the name of a file."""
        self.pytest_runtest_logreport(report)

    def pytest_sessionfinish(self):
        """Write the names."""
        self.file.write_text("".join(f"{name}\n" for name in self.names), encoding="utf-8")
