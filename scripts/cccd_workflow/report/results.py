"""What a run left in ``results/``, read for the page; whatever is not there is None."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from cccd import store
from cccd_networks.graphs import GraphSplit, read_graph_facts, read_graphs
from cccd_viewers.page_files import SliceFigure, read_figure, read_view
from cccd_workflow import stage_files
from cccd_workflow.report.registry import Comparison, Item

if TYPE_CHECKING:
    import pandas as pd

Found = TypeVar("Found")


def _if_there(read: Callable[[Path], Found], file: Path) -> Found | None:
    return read(file) if file.is_file() else None


def _read_from(name: str, read: Callable[[Path], Found]):
    """Make a method that reads a file of a structure."""

    def method(self: StructureFiles) -> Found | None:
        return _if_there(read, self.folder / name)

    return method


class StructureFiles:
    """The files of one structure, ``results/{case}/{organ}/``."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.picture = folder / "picture.png"

    metrics = _read_from("metrics.json", store.read_json)
    structure = _read_from("structure.h5", store.read_structure)
    facts = _read_from("structure.h5", stage_files.read_structure_facts)
    boundaries = _read_from("boundaries.h5", stage_files.read_boundaries)
    curves = _read_from("curves.h5", stage_files.read_curves)
    splines = _read_from("curves.h5", stage_files.read_splines)
    corners = _read_from("curves.h5", stage_files.read_corners)
    bodies = _read_from("surface.h5", store.read_bodies)  # none where walls are shared
    view = _read_from("view.h5", read_view)

    def figure(self, comparison: str, key: str) -> SliceFigure | None:
        """Read what a comparison left for a figure."""
        file = self.folder / "comparisons" / f"{comparison}.h5"
        return _if_there(lambda path: read_figure(path, key), file)


class Results:
    """A run's results, each table read once.

    Parameters
    ----------
    folder : path
        ``results/``.
    structures : sequence of (case, organ)
    tables : mapping, optional
        In place of the files in ``tables/``: those of the structures that are finished, after failures.
    """

    def __init__(
        self,
        folder: Path,
        structures: Sequence[tuple[str, str]],
        tables: Mapping[str, pd.DataFrame] | None = None,
    ):
        self.folder = folder
        self.structures = structures
        self._tables: dict[str, pd.DataFrame | None] = dict(tables or {})

    @property
    def history(self) -> pd.DataFrame | None:
        """Read the scores of each epoch of the junctions' network."""
        return store.read_table(self.folder / "gnn" / "history.csv")

    def files(self, case: str, organ: str) -> StructureFiles:
        """Find one structure's files."""
        return StructureFiles(self.folder / case / organ)

    def table(self, stem: str) -> pd.DataFrame | None:
        """Read ``tables/<stem>.csv``."""
        if stem not in self._tables:
            self._tables[stem] = store.read_table(self.folder / "tables" / f"{stem}.csv")
        found = self._tables[stem]
        return None if found is None or found.empty else found

    def rows(self, comparison: Comparison) -> pd.DataFrame | None:
        """Read the rows of a comparison of all structures; None also where its columns are not all there."""
        from cccd_workflow.report.summary import read_cohort  # slow, and a structure's page has no tables

        folders = (self.folder.joinpath(*key, "comparisons") for key in self.structures)
        frame = read_cohort(folder / f"{comparison.name}.csv" for folder in folders).rows(comparison.name)
        return frame if len(frame) and set(comparison.columns).issubset(frame.columns) else None

    def graphs(self) -> tuple[dict[str, int], dict] | None:
        """Read how many graphs the network was trained on, and what they hold."""
        return _if_there(read_graph_facts, self.folder / "gnn" / "graphs.h5")

    def training_graphs(self) -> GraphSplit | None:
        """Read the frozen training graphs."""
        return _if_there(lambda path: read_graphs(path, "training"), self.folder / "gnn" / "graphs.h5")

    def shown(self, item: Item) -> tuple[str, str, SliceFigure] | None:
        """Choose the structure of which an item shows a slice: a liver, as in the paper, or the first."""
        for case, organ in sorted(self.structures, key=lambda key: key[1] != "liver"):
            if (figure := self.figure(item, case, organ)) is not None:
                return case, organ, figure
        return None

    def figure(self, item: Item, case: str, organ: str) -> SliceFigure | None:
        """Read what the item's comparison left to draw of one structure."""
        return self.files(case, organ).figure(item.rows[0].name, item.key)
