"""All labels of a map: read one by one, lofted in several processes, and given out when each is ready."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from cccd.api import Surface, reconstruct_structure, surface_of
from cccd.containers import Structure
from cccd.errors import InputError
from cccd.extras import needing
from cccd.inputs import read_request
from cccd.inputs.annotation import AUTO
from cccd.inputs.file_requests import refuse_image, request_for
from cccd.inputs.load import existing
from cccd.inputs.row_files import reading_once
from cccd.settings.root import Settings
from cccd_labels.label_fields import LabelFields, LevelBlock, bytes_needed, level_blocks
from cccd_labels.label_maps import MapLabel, list_map
from cccd_labels.processes import worker_processes
from cccd_labels.shared_walls import meet, on_one_grid, touching_groups

_Result = TypeVar("_Result")

#: A process starts and loads its code in the time of some eight small organs.
ORGANS_OF_A_PROCESS = 8
#: Memory of a process beside the first, and what is worth a line.
PROCESS_BYTES, MUCH_BYTES = 0.6e9, 2e9


class LabelSurface(NamedTuple):
    """The surface of one label of a map."""

    number: int  # of the label, in the order of the map, from 1
    label: MapLabel
    surface: Surface
    seconds: float  # that it took alone


@dataclass(frozen=True, eq=False)
class WholeMap:
    """The organs of a map, before they have surfaces.

    Attributes
    ----------
    labels : dict of int to MapLabel
        By number, from 1 in the order of the map.
    structures : dict of int to Structure
        Of the labels that can be read and are large enough.
    failures : list of str
        A line for each label without a surface; `surfaces` adds to it.
    settings : Settings
    path : Path
        The map.
    """

    labels: dict[int, MapLabel]
    structures: dict[int, Structure]
    settings: Settings
    path: Path
    failures: list[str] = field(default_factory=list[str])

    @classmethod
    def read(
        cls,
        path: str | Path,
        table: Path | None,
        image: str | Path | None,
        annotated: str,
        settings: Settings,
    ) -> WholeMap:
        """Read all labels; see `cccd.reconstruct_labels` for what is taken.

        Raises
        ------
        InputError
            The file is not readable, has no label, or its masks lie on several grids.
        """
        source = existing(Path(path).absolute(), "mask")
        refuse_image(source)
        whole = cls(dict(enumerate(list_map(source, table), 1)), {}, settings, source)
        files = reading_once()
        for number, label in whole.labels.items():
            if label.left_out:
                why = f"{label.left_out}: too small for a surface; it is left out"
                whole.failures.append(f"label {label.label}: {why}")
                continue
            try:
                request = request_for(path, label.label, image=image, annotated=annotated)
                organ = read_request(request, settings.import_, settings.seed, files)
            except InputError as error:
                whole.failures.append(f"label {label.label}: {error}")
            else:
                whole.structures[number] = replace(organ, organ=label.organ)
        return whole

    @property
    def voxels(self) -> dict[int, int]:
        """How many voxels, or points of drawn contours, each structure has: the time that it takes."""
        return {number: _size(structure) for number, structure in self.structures.items()}

    def without(self, finished: Collection[int]) -> WholeMap:
        """Leave out organs that are finished; of those that touch, all or none."""
        groups = [group for group in self._groups() if not {*group} <= {*finished}]
        return replace(self, structures={n: self.structures[n] for group in groups for n in group})

    def check_memory(self, n_jobs: int) -> str:
        """Say how much memory the surfaces need where that is much; empty where it is not.

        Raises
        ------
        InputError
            The machine has less.
        """
        groups = [group for group in self._groups() if len(group) > 1]
        if not groups:
            return ""
        most = max(bytes_needed({n: self.structures[n] for n in group}) for group in groups)
        processes = min(n_jobs, -(-len(self.structures) // ORGANS_OF_A_PROCESS))
        needed = most + (processes * PROCESS_BYTES if processes > 1 else 0)
        said = f"{len(self.structures)} labels need about {needed / 1e9:.1f} GB of memory"
        if needed > (there := _memory_there()):
            hint = "give --cores 1, fewer labels, a coarser map (cccd relabel), or shared_walls: false"
            raise InputError(self.path.name, f"{said}; there are {there / 1e9:.1f} GB", hint)
        return said if needed > MUCH_BYTES else ""

    def surfaces(
        self, n_jobs: int, tell: Callable[[str], None], done: Callable[[int], object] = lambda number: None
    ) -> Iterator[LabelSurface]:
        """Make the surfaces: organs that touch no other first, then those that do, group by group.

        Parameters
        ----------
        n_jobs : int
            Processes that work at once.
        tell : callable
            Called with the name of each organ as its work begins, and before walls are shared.
        done : callable
            Called with an organ's number when its own part is done, before its walls are shared.
        """
        groups = self._groups()
        yield from self._alone([group[0] for group in groups if len(group) == 1], n_jobs, tell, done)
        for group in groups:
            if len(group) > 1:
                yield from self._with_walls(group, n_jobs, tell, done)

    def _groups(self) -> list[list[int]]:
        """Numbers of the organs that have to wait for each other."""
        parts = self.structures.values()
        if self.settings.surface.shared_walls is False or any(part.mask is None for part in parts):
            return [[number] for number in self.structures]
        if any(part.annotation is not None for part in parts):
            return [list(self.structures)]  # what lies between annotated slices is not known yet
        return touching_groups(self.structures) if self.structures else []

    def _alone(
        self, numbers: Sequence[int], n_jobs: int, tell: Callable[[str], None], done: Callable[[int], object]
    ) -> Iterator[LabelSurface]:
        """Give organs that touch no other their splines."""
        voxels = self.voxels
        jobs = {number: self.structures[number] for number in sorted(numbers, key=lambda n: -voxels[n])}
        for number, result in self._worked(_loft, jobs, n_jobs, tell):
            done(number)
            if isinstance(result, InputError):
                self.failures.append(f"label {self.labels[number].label}: {result}")
            else:
                yield LabelSurface(number, self.labels[number], *result)

    def _with_walls(
        self, group: Sequence[int], n_jobs: int, tell: Callable[[str], None], done: Callable[[int], object]
    ) -> Iterator[LabelSurface]:
        """Give organs that touch their shared walls; what turns out to touch no other gets a spline."""
        began, voxels = time.perf_counter(), self.voxels
        structures = on_one_grid({number: self.structures[number] for number in group})
        fields = LabelFields.empty(list(structures.values()))
        order = sorted(range(1, len(group) + 1), key=lambda n: -voxels[group[n - 1]])
        jobs = {0: fields.together()} | {number: fields.structures[number] for number in order}
        for number, result in self._worked(_interpolate, jobs, n_jobs, tell):
            if isinstance(result, InputError):
                raise result
            fields.add(number, result)
            if number:
                done(group[number - 1])
        tell("shared walls")
        with threadpool_limits(1):
            walls = meet(fields, group, self.settings.surface)
        del fields
        seconds = (time.perf_counter() - began) / len(group)
        for number in sorted(walls.surface.names):
            try:
                with threadpool_limits(1):
                    lofted = walls.organ(number, structures[number], self.settings.surface)
            except InputError as error:
                self.failures.append(f"label {self.labels[number].label}: {error}")
            else:
                surface = surface_of(self.structures[number], lofted)
                yield LabelSurface(number, self.labels[number], surface, seconds)
        rest = [number for number in group if number not in walls.surface.names]
        yield from self._alone(rest, n_jobs, tell, lambda number: None)

    def _worked(
        self,
        work: Callable[[Structure, Settings], _Result | InputError],
        jobs: Mapping[int, Structure],
        n_jobs: int,
        tell: Callable[[str], None],
    ) -> Iterator[tuple[int, _Result | InputError]]:
        """Do work on structures, in processes of their own where there are many; what is ready first."""
        order = iter(jobs.items())
        processes = min(n_jobs, -(-len(jobs) // ORGANS_OF_A_PROCESS))
        if processes <= 1:
            for number, structure in order:
                tell(structure.organ)
                yield number, work(structure, self.settings)
            return
        running: dict[Future[_Result | InputError], int] = {}
        with worker_processes(processes) as pool:
            while True:
                for number, structure in islice(order, processes - len(running)):
                    tell(structure.organ)
                    running[pool.submit(work, structure, self.settings)] = number
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), future.result()


@threadpool_limits.wrap(limits=1)
def _loft(structure: Structure, settings: Settings) -> tuple[Surface, float] | InputError:
    """Make one organ's own surface, in this process or another."""
    began = time.perf_counter()
    try:
        surface = reconstruct_structure(structure, settings)
    except InputError as error:
        return error
    return surface, time.perf_counter() - began


@threadpool_limits.wrap(limits=1)
def _interpolate(structure: Structure, settings: Settings) -> list[LevelBlock] | InputError:
    """Interpolate one organ between its slices, in this process or another."""
    try:
        return list(level_blocks(structure, settings.surface))
    except InputError as error:
        return error


def _memory_there() -> float:
    """Bytes that the machine has, or that a container or a batch job leaves to this process."""
    pages = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") if hasattr(os, "sysconf") else np.inf
    own = Path("/proc/self/cgroup")
    group = Path("/sys/fs/cgroup", own.read_text().strip().rpartition("::/")[2] if own.is_file() else "")
    limits = [folder / "memory.max" for folder in (group, *group.parents)]
    said = [file.read_text().strip() for file in limits if file.is_file()]
    return min([pages, *(float(text) for text in said if text.isdecimal())])


def _size(structure: Structure) -> int:
    if structure.mask is not None:
        return int(np.count_nonzero(structure.mask))
    return 1 if structure.contours is None else len(structure.contours.points)


@needing("cccd.reconstruct_labels")
def reconstruct_labels(
    path: str | Path,
    *,
    table: str | Path | None = None,
    image: str | Path | None = None,
    annotated: str = AUTO,
    settings: Settings | None = None,
    n_jobs: int = 1,
    progress: Callable[[str], None] | None = None,
) -> tuple[list[Surface], list[str]]:
    """Make smooth closed surfaces of all labels of a map; neighbours share their walls.

    Parameters
    ----------
    path : path
        A label map, a DICOM SEG or RTSTRUCT, or a folder of one-organ masks.
    table : path, optional
        Names of the labels: ``label,name`` below a header, FreeSurfer's colour table, a ``dataset.json``.
    image : path, optional
        The scan, if it is in another file or folder.
    annotated : {"auto", "nonempty", "every slice"}
        Which slices of each label are annotated, see `read`.
    settings : Settings, optional
        ``surface.shared_walls: false`` smooths each organ alone. Drawn contours are always smoothed alone.
    n_jobs : int
        Processes that work at once; each needs up to a gigabyte. With more than one, a script needs
        ``if __name__ == "__main__":`` around what it does.
    progress : callable, optional
        Called with the name of each organ as its surface begins.

    Returns
    -------
    surfaces : list of Surface
        Named after the organs.
    failures : list of str
        A line for each label that has no surface.

    Raises
    ------
    InputError
        The file is not readable or has no label.

    See Also
    --------
    reconstruct : one organ.
    """
    given = None if table is None else Path(table)
    whole = WholeMap.read(path, given, image, annotated, settings or Settings())
    found = {one.number: one.surface for one in whole.surfaces(n_jobs, progress or (lambda organ: None))}
    return [found[number] for number in sorted(found)], whole.failures
