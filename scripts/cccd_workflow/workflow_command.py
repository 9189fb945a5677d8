"""The workflow from anywhere: the command line with which Snakemake runs it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import yaml

from cccd.errors import InputError, choices
from cccd.project import PROJECT

#: What asks a run to end: Ctrl-C; timeout, docker and Slurm; a terminal that is closed.
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

_SHEETS = (".tsv", ".txt")


def snakemake_command(
    sheet: Path,
    folder: Path,
    cores: int,
    profile: str | None = None,
    configfile: Path | None = None,
    further: Sequence[str] = (),
) -> list[str]:
    """Make the command that runs the workflow on a cohort sheet.

    Parameters
    ----------
    sheet : path
        The cohort sheet.
    folder : path
        Where ``results`` goes.
    cores : int
        Jobs that run at once.
    profile : str, optional
        ``slurm`` or ``generic``, or the folder of another one.
    configfile : path, optional
        Settings that replace the defaults.
    further : sequence of str
        What Snakemake gets besides: targets, ``--dry-run``, ``--config key=value``.

    Raises
    ------
    InputError
        No such sheet, settings or profile, something else in a sheet's place, a profile without its plugin.
    """
    if not sheet.is_file():
        raise InputError(str(sheet), "no such cohort sheet", "give a sheet (.tsv) or a BIDS data set")
    if sheet.suffix.lower() not in _SHEETS:
        raise InputError(str(sheet), "not a cohort sheet", "give a table (.tsv); cccd surface takes one mask")
    if configfile is not None and not configfile.is_file():
        raise InputError(str(configfile), "no such file of settings", "correct the path")
    values, rest = _split_config(further)
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(PROJECT / "Snakefile")]
    command += ["--directory", str(folder.absolute()), "--config", f"cohort={sheet.absolute()}", *values]
    if configfile is not None:
        command += ["--configfile", str(configfile.absolute())]
    if profile is not None:
        command += ["--workflow-profile", str(_profile(profile))]
    return [*command, "--cores", str(cores), *rest]


def run_command(command: Sequence[str]) -> int:
    """Run Snakemake until it ends, and end its jobs with it when this process is asked to end.

    Parameters
    ----------
    command : sequence of str
        From `snakemake_command`.

    Returns
    -------
    int
        Snakemake's exit code, or 128 and the number of the signal. A second signal kills at once.
    """
    # a group of its own: what a terminal sends to all at once reaches Snakemake before its jobs
    process = subprocess.Popen(command, start_new_session=True)
    received: list[int] = []

    def end(number: int, _: object) -> None:
        received.append(number)
        if process.poll() is not None:
            return
        if len(received) > 1:
            os.killpg(process.pid, signal.SIGKILL)
            return
        process.send_signal(signal.SIGINT)  # it ends its jobs: `answer_signals`

    before = {number: signal.getsignal(number) for number in _ENDING}
    try:
        for number, handler in before.items():
            if handler != signal.SIG_IGN:  # nohup
                signal.signal(number, end)
        status = process.wait()
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    return 128 + received[0] if received else status


def _split_config(further: Sequence[str]) -> tuple[list[str], list[str]]:
    """Separate the values of ``--config``, which Snakemake takes once only, from the rest."""
    values, rest, inside = [], [], False
    for part in further:
        inside = part == "--config" or (inside and "=" in part and not part.startswith("-"))
        if inside and part != "--config":
            values.append(part)
        elif not inside:
            rest.append(part)
    return values, rest


def _profile(name: str) -> Path:
    """Find a profile: one of those that come along, or a folder."""
    shipped = PROJECT / "workflow" / "profiles"
    for folder in (Path(name), shipped / name):
        for file in (folder / "profile.yaml", folder / "config.yaml"):
            if file.is_file():
                _check_executor(name, file)
                return folder.absolute()
    known = sorted(path.name for path in shipped.iterdir() if path.is_dir())
    raise InputError(name, "no such profile", choices(known))


def _check_executor(name: str, profile: Path) -> None:
    """Refuse a profile whose executor's plugin is not installed."""
    executor = (yaml.safe_load(profile.read_text(encoding="utf-8")) or {}).get("executor")
    if executor in (None, "local", "dryrun", "touch"):
        return
    plugin = f"snakemake-executor-plugin-{executor}"
    if find_spec(plugin.replace("-", "_")) is None:
        raise InputError(f"--profile {name}", f"{plugin} is not installed", f"run pip install {plugin}")
