"""What the report has of tables and figures: one entry each.

An `Item` says what it is called, which comparison of each structure it stands on, what makes its table over
the cohort, and what draws it. The rules of the workflow, the tables, the report and its
contents read this list. The product's own table is that of the structures; other packages add theirs, with
the sections that show them (`cccd.plugins`).

Functions are named by their dotted path and looked up when they are called: the workflow reads this module
each time it starts.
"""

from __future__ import annotations

from collections import ChainMap
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Literal

from cccd.plugins import table


@dataclass(frozen=True)
class Input:
    """Something of a structure that a comparison asks for: its files, and what reads them.

    ``files`` stand in the structure's folder; with ``shared`` they stand in ``results/``. In a run without a
    network what is ``optional`` is read from no files. ``shipped`` are the segmentation networks that come
    along for the structure's organ. Files with ``project`` come with the project, in its folder.
    """

    files: tuple[str, ...]
    read: str
    shared: bool = False
    optional: bool = False
    shipped: bool = False
    project: bool = False


@dataclass(frozen=True)
class Comparison:
    """An experiment on one structure, which leaves ``comparisons/<name>.csv``.

    Attributes
    ----------
    name : str
        Of its files.
    run : str
        Function that returns the rows. It gets ``inputs`` and ``settings`` by name, and ``seed`` when it is
        seeded.
    inputs : tuple of str
        Keys of `inputs`.
    settings : dict of str to str
        Sections of the configuration, dotted, by the parameter that gets them, as their typed models.
    unused : tuple of str
        Keys of these sections, dotted, that change nothing, so that they bring nothing back.
    seeded : bool
        Whether the function draws at random.
    figures : str or None
        Function that returns what the report draws of this structure, by figure; it gets those of
        ``run``'s arguments that it has parameters for. It leaves ``comparisons/<name>.h5``.
    columns : tuple of str
        Columns that the rows have at least, ``case`` and ``organ`` aside.
    memory_mb : (int, int)
        Base, and per MB of input.
    minutes : int
    of : {"structures", "outlines", "traced masks", "maps", "phantoms"}
        Which structures it is made of. ``structures``: all. ``outlines``: those with a mask or drawn
        contours, from which it starts. ``traced masks``: those whose mask was traced, in a run that uses a
        network: it says how that would have done, and an item stands without it. ``maps``: those whose
        boundary pixels need ordering. ``phantoms``: phantoms for whose organ segmentation networks are
        shipped.
    further : {"", "others", "all"}
        For a closer look: ``snakemake evidence`` makes it, and the next report shows it; a run makes it with
        the rest only where ``compare`` is true. ``others``: of all but the first phantom.
    """

    name: str
    run: str
    inputs: tuple[str, ...]
    settings: dict[str, str] = field(default_factory=dict)
    unused: tuple[str, ...] = ()
    seeded: bool = False
    figures: str | None = None
    columns: tuple[str, ...] = ()
    memory_mb: tuple[int, int] = (1500, 20)
    minutes: int = 20
    of: str = "outlines"
    further: Literal["", "others", "all"] = ""

    @property
    def functions(self) -> tuple[str, ...]:
        """Every function that the job calls: a change of their modules runs it again."""
        known = inputs()
        readers = (known[name].read for name in self.inputs)
        return (self.run, *([self.figures] if self.figures else []), *readers)


@dataclass(frozen=True)
class Item:
    """A table or figure of the paper, or a table of ours.

    Attributes
    ----------
    key : str
        Its anchor in the page.
    title : str
        What it is about.
    text : str
        What the paper shows there, with its numbers; for ours, what is measured.
    name : str
        As printed in the paper; empty for ours.
    section : str
        Where the page shows it: a key of `sections`, or ``summary``.
    rows : tuple of Comparison
        The experiments on each structure that it stands on.
    table : str or None
        Stem of its CSV in ``tables/``.
    columns : tuple of str
        Columns that the table has at least.
    tabulate : str or None
        Function of `cccd_workflow.report.summary.Cohort` that returns the table; without one the table is the
        rows of all structures, one below the other.
    plots : str or None
        Function of `cccd_workflow.report.results.Results` and the item that returns the plots.
    captions : tuple of str
        Of the plots, in their order.
    network : bool
        Whether it needs the trained network; it is absent from a run without one.
    """

    key: str
    title: str
    text: str
    name: str = ""
    section: str = "experiments"
    rows: tuple[Comparison, ...] = ()
    table: str | None = None
    columns: tuple[str, ...] = ()
    tabulate: str | None = None
    plots: str | None = None
    captions: tuple[str, ...] = ()
    network: bool = False

    @property
    def needed(self) -> tuple[Comparison, ...]:
        """The experiments without which there is no table: all but those of traced masks."""
        return tuple(comparison for comparison in self.rows if comparison.of != "traced masks")

    @property
    def tabulated(self) -> bool:
        """Whether ``build_tables`` makes its table (another rule does otherwise)."""
        return self.table is not None and (self.tabulate is not None or len(self.rows) > 0)


#: The product's own tables.
STRUCTURES = Item(
    "structures",
    "Results",
    "Measurements of every structure's surface and curves.",
    section="summary",
    table="structures",
    columns=("case", "organ", "dice_3d", "assd_mm", "volume_bias", "control_bytes", "warnings"),
    tabulate="cccd_workflow.report.summary.structures",
)

#: Distances between organs of a case.
DISTANCES = Item(
    "distances",
    "Distances",
    "Least distance between the surfaces of two organs of a case, with its interval.",
    section="summary",
    table="distances",
    columns=("case", "organ", "other_organ", "distance_mm", "low_mm", "high_mm"),
    tabulate="cccd_workflow.report.summary.distances",
)


def items() -> list[Item]:
    """Every table and figure, in the page's order."""
    return [STRUCTURES, DISTANCES, *(item for items in _added("ITEMS") for item in items)]


def comparisons() -> dict[str, Comparison]:
    """Every experiment by its name, in the order of the items that stand on them."""
    return {comparison.name: comparison for item in items() for comparison in item.rows}


def inputs() -> dict[str, Input]:
    """Everything that a comparison's function may ask for, by the name of its parameter."""
    return dict(ChainMap(*_added("INPUTS")))


def sections() -> dict[str, tuple[str, str]]:
    """Sections of the page that list items: title and introduction."""
    return {key: section for sections in _added("SECTIONS") for key, section in sections.items()}


def _added(name: str) -> list[Any]:
    """One of the three lists of every package that has a part of the report."""
    return [getattr(import_module(module), name) for module in table("REPORT").values()]


def registered() -> list[str]:
    """Paths of what packages add to the report and to the configuration: tables and pages go by it."""
    return [*(f"{module}.ITEMS" for module in table("REPORT").values()), *table("SETTINGS").values()]
