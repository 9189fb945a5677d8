"""Run the benchmarks, all or some, with a table and a figure of the results.

    python bench/run.py [--sizes 2] [--out FOLDER] [junctions network curves surface pipeline]

Every method is timed beside its peers in the same process, on one thread, at sizes that double. Time is
processor time, the least of three runs, so that other people's load does not count; memory is the peak
above what the process held before. The slope is d log time / d log size. What is timed beside what:
stages.py.
"""

import argparse
import contextlib
import ctypes
import gc
import os
import platform
import sys
import time
from pathlib import Path

for library in ("OMP", "OPENBLAS", "MKL", "NUMBA"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "scripts"), str(Path(__file__).parent)]

import matplotlib  # noqa: E402

matplotlib.use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
from stages import STAGES  # noqa: E402

from cccd.settings.root import Settings  # noqa: E402

SIZES = (8, 16, 32, 64)
REPEATS = 3
COLUMNS = ("benchmark", "method", "slices", "seconds", "peak_mb")


def resident_mb(key: str) -> float:
    """Memory of this process in MB: ``VmRSS`` now, ``VmHWM`` at its highest. NaN where /proc is missing."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(int(line.split()[1]) / 1024 for line in lines if line.startswith(key))
    except (OSError, StopIteration):
        return float("nan")


def measure(method) -> tuple[float, float]:
    """Processor time in s, the least of `REPEATS` runs, and peak memory in MB above the level before."""
    gc.collect()
    with contextlib.suppress(OSError, AttributeError):  # Linux and glibc; elsewhere memory is less exact
        ctypes.CDLL("libc.so.6").malloc_trim(0)  # gives back what is free, else it would be used unseen
        Path("/proc/self/clear_refs").write_text("5")  # lets VmHWM begin anew
    before, times = resident_mb("VmRSS"), []
    for _ in range(REPEATS):
        start = time.process_time()
        method()
        times.append(time.process_time() - start)
    return min(times), max(resident_mb("VmHWM") - before, 0)


def machine() -> str:
    """Name the machine: processor, cores, system, Python."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        processor = next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        processor = platform.processor() or platform.machine()
    return f"{processor}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"


def run(name: str, count: int | None, settings: Settings) -> list[dict]:
    """Time every method of one benchmark at its first ``count`` sizes."""
    prepare, rows = STAGES[name], []
    for method in prepare(SIZES[0], settings).values():
        method()  # compiles, and fills caches
    for size in SIZES[:count]:
        for label, method in prepare(size, settings).items():
            values = (name, label, size, *measure(method))
            rows.append(dict(zip(COLUMNS, values, strict=True)))
            print("{:10} {:32} {:4} slices {:9.4f} s {:7.1f} MB".format(*values), flush=True)
    return rows


def add_slopes(table: pd.DataFrame) -> pd.DataFrame:
    """Add d log time / d log size of every method over all its sizes."""

    def slope(part: pd.DataFrame) -> float:
        if len(part) < 2:
            return float("nan")
        seconds = np.maximum(part["seconds"], 1e-6)
        return float(np.polyfit(np.log(part["slices"]), np.log(seconds), 1)[0])

    keys = ["benchmark", "method"]
    slopes = {key: slope(part) for key, part in table.groupby(keys)}
    return table.assign(slope=[slopes[key] for key in zip(*(table[key] for key in keys), strict=True)])


def draw(table: pd.DataFrame, path: Path) -> None:
    """Time and memory against size, both logarithmic, one column per benchmark."""
    titles = list(dict.fromkeys(table["benchmark"]))
    figure, axes = plt.subplots(
        2, len(titles), figsize=(4.2 * len(titles), 7.2), squeeze=False, sharex="col", layout="constrained"
    )
    for column, title in enumerate(titles):
        part = table[table["benchmark"] == title]
        for label, lines in part.groupby("method", sort=False):
            own = f"{label} ({lines['slope'].iloc[0]:.2f})"
            axes[0, column].plot(lines["slices"], lines["seconds"], marker="o", label=own)
            axes[1, column].plot(lines["slices"], np.maximum(lines["peak_mb"], 0.1), marker="o")
        axes[0, column].set(xscale="log", yscale="log", ylabel="processor time (s)")
        axes[1, column].set(xlabel="slices", xscale="log", yscale="log", ylabel="peak memory (MB)")
        axes[1, column].set_xticks(sorted(set(part["slices"])), labels=sorted(set(part["slices"])))
        axes[1, column].minorticks_off()
        above = {"loc": "lower left", "bbox_to_anchor": (0, 1), "frameon": False}
        axes[0, column].legend(title=f"{title}: method (slope)", alignment="left", fontsize=8, **above)
    figure.suptitle(machine(), fontsize=9)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def main() -> None:
    """Read the command line, run, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="name", help=f"of {', '.join(STAGES)}; none: all")
    parser.add_argument("--sizes", type=int, help="only so many sizes, the smallest first")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "benchmarks", help="results' folder")
    arguments = parser.parse_args()
    if unknown := set(arguments.names) - set(STAGES):
        parser.error(f"no benchmark {', '.join(sorted(unknown))}; there are {', '.join(STAGES)}")
    rows = [row for name in arguments.names or STAGES for row in run(name, arguments.sizes, Settings())]
    table = add_slopes(pd.DataFrame(rows)).assign(machine=machine())
    arguments.out.mkdir(parents=True, exist_ok=True)
    table.to_csv(arguments.out / "benchmarks.csv", index=False, float_format="%.4g")
    draw(table, arguments.out / "benchmarks.png")
    print(f"{arguments.out / 'benchmarks.csv'}\n{arguments.out / 'benchmarks.png'}")


if __name__ == "__main__":
    main()
