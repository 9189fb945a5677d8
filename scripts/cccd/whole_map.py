"""All labels of a map: read one by one, lofted in several processes, and given out when each is ready."""

from __future__ import annotations

import time
from collections.abc import Callable, Container, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from cccd.api import Surface, read_organ, reconstruct_structure, refuse_image
from cccd.containers import Structure
from cccd.errors import InputError
from cccd.extras import needing
from cccd.inputs.annotation import AUTO, with_undrawn_filled
from cccd.inputs.label_maps import MapLabel, list_map
from cccd.inputs.load import existing
from cccd.inputs.row_files import RowFiles
from cccd.processes import worker_processes
from cccd.reconstruction import Loft
from cccd.settings.root import Settings
from cccd.solids.shared_walls import Organ, share_walls, touching_groups
from cccd.surface.checks import check_walls
from cccd.surface.loft import loft_before_walls, loft_surface

__all__ = ["LabelSurface", "WholeMap", "reconstruct_labels"]

#: A process starts and loads its code in the time of some eight small organs.
ORGANS_OF_A_PROCESS = 8


def _nothing(_: object) -> None:
    """Tell nobody."""


class LabelSurface(NamedTuple):
    """The surface of one label of a map."""

    number: int  # of the label, in the order of the map, from 1
    label: MapLabel
    surface: Surface
    seconds: float  # that it took alone


class _Lofted(NamedTuple):
    surface: Surface
    seconds: float


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
    """

    labels: dict[int, MapLabel]
    structures: dict[int, Structure]
    settings: Settings
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
        whole = cls(dict(enumerate(list_map(source, table), 1)), {}, settings)
        files = RowFiles.shared()
        for number, label in whole.labels.items():
            if label.left_out:
                why = f"{label.left_out}: too small for a surface; it is left out"
                whole.failures.append(f"label {label.label}: {why}")
                continue
            try:
                organ = read_organ(path, label.label, settings, files, image=image, annotated=annotated)
            except InputError as error:
                whole.failures.append(f"label {label.label}: {error}")
            else:
                whole.structures[number] = replace(organ, organ=label.organ)
        return whole

    @property
    def voxels(self) -> dict[int, int]:
        """How many voxels, or points of drawn contours, each structure has: the time that it takes."""
        return {number: _size(structure) for number, structure in self.structures.items()}

    def surfaces(
        self, n_jobs: int, tell: Callable[[str], None], done: Callable[[int], object] = _nothing
    ) -> Iterator[LabelSurface]:
        """Make the surfaces, those of many voxels first; organs that touch are ready together.

        Parameters
        ----------
        n_jobs : int
            Processes that work at once.
        tell : callable
            Called with the name of each organ as its surface begins, and before walls are shared.
        done : callable
            Called with an organ's number when its own surface is made, before its walls are shared.
        """
        group_of = {number: group for group in self._groups() for number in group}
        sharing = {number for number, group in group_of.items() if len(group) > 1}
        if any(structure.annotation is not None for structure in self.structures.values()):
            sharing = set()  # which touch is known once they are lofted
        lofted: dict[int, _Lofted] = {}
        finished: set[int] = set()
        for number, result in self._lofted(n_jobs, sharing, tell):
            finished.add(number)
            done(number)
            if isinstance(result, InputError):
                self.failures.append(f"label {self.labels[number].label}: {result}")
            else:
                lofted[number] = result
            group = group_of[number]
            if finished.issuperset(group):
                ready = {n: lofted.pop(n) for n in group if n in lofted}
                if len(ready) < len(group):
                    ready |= self._left_alone(ready)
                yield from self._with_walls(ready, tell)

    def _groups(self) -> list[list[int]]:
        """Numbers of the organs that have to wait for each other."""
        parts = self.structures.values()
        if self.settings.surface.shared_walls is False or any(part.mask is None for part in parts):
            return [[number] for number in self.structures]
        if any(part.annotation is not None for part in parts):
            return [list(self.structures)]  # what lies between annotated slices is not known yet
        return touching_groups(self.structures) if self.structures else []

    def _lofted(
        self, n_jobs: int, sharing: Container[int], tell: Callable[[str], None]
    ) -> Iterator[tuple[int, _Lofted | InputError]]:
        """Give each organ's own surface when it is ready, or why it has none; ``sharing`` get no spline."""
        voxels = self.voxels
        ways = {n: loft_before_walls if n in sharing else loft_surface for n in self.structures}
        order = iter(sorted(self.structures, key=lambda number: -voxels[number]))
        processes = min(n_jobs, -(-len(self.structures) // ORGANS_OF_A_PROCESS))
        if processes <= 1:
            for number in order:
                tell(self.labels[number].organ)
                yield number, _loft(self.structures[number], self.settings, ways[number])
            return
        running: dict[Future[_Lofted | InputError], int] = {}
        with worker_processes(processes) as pool:
            while True:
                for number in islice(order, processes - len(running)):
                    tell(self.labels[number].organ)
                    job = pool.submit(_loft, self.structures[number], self.settings, ways[number])
                    running[job] = number
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), future.result()

    def _left_alone(self, lofted: Mapping[int, _Lofted]) -> dict[int, _Lofted]:
        """Loft organs again, with splines, whose neighbours have no surface to share walls with."""
        groups = touching_groups({number: self.structures[number] for number in lofted}) if lofted else []
        alone = [group[0] for group in groups if len(group) == 1 and not lofted[group[0]].surface.bodies]
        again = {number: _loft(self.structures[number], self.settings, loft_surface) for number in alone}
        return {number: result for number, result in again.items() if isinstance(result, _Lofted)}

    @threadpool_limits.wrap(limits=1)
    def _shared(self, lofted: Mapping[int, _Lofted]) -> tuple[dict[int, Surface], list[str]]:
        """Give organs that touch their shared walls, and say which have nothing left."""
        surfaces = {number: one.surface for number, one in lofted.items()}
        organs: dict[int, Organ] = {}
        for number, surface in surfaces.items():
            mesh = surface.lofted.mesh
            organs[number] = Organ(surface.name, with_undrawn_filled(self.structures[number], mesh), mesh)
        walls = share_walls(organs)
        failures = [line for number in surfaces for line in walls.warnings.get(number, [])]
        joined: dict[int, Surface] = {}
        for number in surfaces.keys() - walls.warnings.keys():
            own = surfaces[number]
            mesh, band = walls.surface.mesh_of(number), own.lofted.band
            band = band and band.moved_to(own.vertices, mesh.vertices)
            # what touches no other is the spline's mesh as before
            bodies = own.bodies if np.array_equal(mesh.vertices, own.vertices) else []
            wrong = () if bodies else check_walls(mesh, self.structures[number])
            together = replace(own.lofted, mesh=mesh, bodies=bodies, band=band)
            joined[number] = replace(own, lofted=together, warnings=(*own.warnings, *wrong))
        return joined, failures

    def _with_walls(
        self, lofted: Mapping[int, _Lofted], tell: Callable[[str], None]
    ) -> Iterator[LabelSurface]:
        """Give the final surfaces of organs of which all neighbours have their own."""
        surfaces = {number: one.surface for number, one in lofted.items()}
        if len(lofted) > 1:
            tell("shared walls")
            surfaces, failures = self._shared(lofted)
            self.failures.extend(failures)
        for number in sorted(surfaces):
            seconds = lofted[number].seconds
            yield LabelSurface(number, self.labels[number], surfaces[number], seconds)


@threadpool_limits.wrap(limits=1)
def _loft(structure: Structure, settings: Settings, way: Loft) -> _Lofted | InputError:
    """Make one organ's own surface, in this process or another."""
    began = time.perf_counter()
    try:
        surface = reconstruct_structure(structure, settings, loft=way)
    except InputError as error:
        return error
    return _Lofted(surface, time.perf_counter() - began)


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
