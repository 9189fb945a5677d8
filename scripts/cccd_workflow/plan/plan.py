"""One run of the workflow, planned: what its rules ask for by name."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, cast

from cccd.errors import InputError
from cccd.plugins import band_formats, folders, formats, table
from cccd.project import PROJECT
from cccd.settings.root import Settings, validate_config
from cccd_segmentation.networks import networks
from cccd_workflow.cohort import IMAGES_ALONE
from cccd_workflow.plan.cohort import OfCase, OfStructure, PlannedCohort, StructureName, near
from cccd_workflow.plan.networks import MODEL, JunctionPlan, SegmenterPlan, find_file
from cccd_workflow.plan.resources import digest, digest_files
from cccd_workflow.report.registry import Comparison, comparisons, inputs, items, registered

#: Files of a case whose organs share their walls.
SCENE = ("scene.glb", "segmentation.seg.nrrd", "scene.json", "scene.html")

#: Folders of results, and of logs, that are of no case.
OF_NO_CASE = ("downloads", "gnn", "phantoms", "segmenters", "shapes", "tables")


@dataclass(frozen=True)
class Plan:
    """What the rules know of a run.

    Attributes
    ----------
    config : dict
        The configuration with every key, as plain values: what rules hand to jobs.
    settings : Settings
        The same, typed.
    root : path
        The folder of the Snakefile.
    cohort : PlannedCohort
        The structures.
    junctions : JunctionPlan
        The network that orders boundary pixels.
    segmenter : SegmenterPlan
        What makes masks of images.
    calibration : list of str
        The file that ``surface.calibration`` names, if any: surfaces are lofted again when it changes.
    materials : list of str
        The table that ``surface.tetrahedra.materials`` names, if any: tetrahedra are made again likewise.
    """

    config: dict[str, Any]
    settings: Settings
    root: Path
    cohort: PlannedCohort
    junctions: JunctionPlan
    segmenter: SegmenterPlan
    calibration: list[str]
    materials: list[str]

    @classmethod
    def make(cls, config: Mapping[str, Any], root: Path, omit_missing: bool = False) -> Plan:
        """Plan a run.

        Parameters
        ----------
        config : mapping
            What Snakemake read and merged.
        root : path
            The folder of the Snakefile.
        omit_missing : bool
            Leave rows out whose files are not there (`PlannedCohort.missing`).

        Raises
        ------
        InputError
            Anything wrong with the configuration, the sheet or the models.
        """
        settings = validate_config(config)
        sheet = find_file(settings.cohort, root)
        ordered = settings.curves.ordering == "gnn"
        cohort = PlannedCohort.read(sheet, settings.surface.shared_walls, ordered, omit_missing)
        junctions = JunctionPlan.choose(settings, cohort, root)
        segmenter = SegmenterPlan.choose(settings, cohort, root)
        tables = (_calibration(settings), _materials(settings))
        return cls(settings.as_config(), settings, root, cohort, junctions, segmenter, *tables)

    def check_target(self, target: str) -> None:
        """Refuse a file of a structure that the sheet does not have.

        Parameters
        ----------
        target : str
            What was asked for by name: a rule, or a file such as ``results/CASE/ORGAN/surface.ply``.

        Raises
        ------
        InputError
            The sheet has no such structure, or its row's files are not there.
        """
        folder, *names, _ = *Path(target).parts, ""
        if folder == "results" and len(names) == 3 and names[0] not in OF_NO_CASE:
            self.cohort.row(StructureName(*names[:2]))

    # Settings and code of a job: it runs again when they change, and only then.

    def pick(self, section: str, *keys: str) -> dict[str, Any]:
        """Return just these keys of a section of the configuration."""
        return {key: self.config[section][key] for key in keys if key in self.config[section]}

    def omit(self, section: str, *keys: str) -> dict[str, Any]:
        """Return a section of the configuration without these keys."""
        return self.pick(section, *(key for key in self.config[section] if key not in keys))

    def library(self, script: str, *functions: str) -> str:
        """Digest the code that ``scripts/<script>.py`` runs, and that of the functions that it is given."""
        return digest(self.root / "scripts" / f"{script}.py", folders(), functions)

    @property
    def readers(self) -> list[str]:
        """Functions of other packages that read or make what a row names, or find an organ in it."""
        made = (path for name in ("SOURCES", "LAYOUTS", "MASKS") for path in table(name).values())
        return [*(reader.read for reader in table("READERS").values()), *made]

    # Structures and cases.

    def files(self, name: str) -> list[str]:
        """Return the file ``name`` of every structure that is reconstructed."""
        return _files(self.cohort.reconstructed, name)

    def whole_case(self, name: str) -> Callable[[OfCase], list[str]]:
        """Make an input function: the file ``name`` of every organ of a case that is reconstructed."""

        def whole_case(wildcards: OfCase) -> list[str]:
            return _files(self.cohort.of_case(wildcards.case), name)

        return whole_case

    def sharing_organs(self, name: str) -> Callable[[OfCase], list[str]]:
        """Make an input function: the file ``name`` of every organ of a case that shares its walls."""

        def sharing_organs(wildcards: OfCase) -> list[str]:
            organs = self.cohort.shared.get(wildcards.case, [])
            return _files([StructureName(wildcards.case, organ) for organ in organs], name)

        return sharing_organs

    def case_labels(self, wildcards: OfCase) -> dict[str, dict[str, str]]:
        """Names, colours and codes of a case's labels, where it is a whole map."""
        return self.cohort.labels.get(wildcards.case, {})

    @property
    def sheet_folder(self) -> str:
        """The folder that the sheet's paths are relative to."""
        return near(self.cohort.sheet.parent)

    def group_after_filling(self, wildcards: OfCase) -> str:
        """Name the group of jobs that read what is reported of the tetrahedra of a whole case."""
        return "measured" if self._fills_cases else "structure"

    @property
    def _fills_cases(self) -> bool:
        return not formats("tetrahedra").keys().isdisjoint(self.settings.surface.case_formats)

    # Import and segmentation.

    def is_segmented(self, row: Mapping[str, str]) -> bool:
        """Whether a row's mask is made here: it has an image alone, and a segmenter is named."""
        alone = row["source"] == "files" and _has_image_alone(row) and not row["seed"]
        return self.segmenter.name is not None and alone

    def sheet_row(self, wildcards: OfStructure) -> dict[str, str]:
        """Return a structure's row, with the mask that a segmenter makes for it.

        Its location in the sheet and its group are left out: moving a row reruns nothing.
        """
        row = self.cohort.row(wildcards)
        if self.is_segmented(row):
            made = os.path.relpath(self.segmentation_files(wildcards)[0], self.cohort.sheet.parent)
            row = row | {"mask": made, "label": self.segmenter.labels}
        return {key: value for key, value in sorted(row.items()) if key not in ("location", "group")}

    def segmentation_files(self, wildcards: OfStructure) -> list[str]:
        """Return the mask that a segmenter makes of a row's image, and its report; none for other rows."""
        if not self.is_segmented(self.cohort.row(wildcards)):
            return []
        return [f"{_folder(wildcards)}/{name}" for name in ("segmentation.nii.gz", "segmentation.json")]

    @property
    def found_regions(self) -> list[StructureName]:
        """The structures whose region is found in an image: what was taken is worth a look."""
        return [name for name in self.cohort.reconstructed if self._is_region_found(self.cohort.rows[name])]

    def _is_region_found(self, row: Mapping[str, str]) -> bool:
        in_file = row["source"] == "files" and not (row["mask"] or row["boundary"])
        searched = row["source"] in IMAGES_ALONE or bool(row["seed"])
        return searched or (in_file and self.segmenter.name is None)

    @property
    def training_rows(self) -> list[dict[str, str]]:
        """The rows that train segmentation networks."""
        return [dict(self.cohort.rows[name]) for name in self.cohort.training]

    def contour_function(self, wildcards: OfStructure) -> str:
        """Path of the function that makes a structure's contours."""
        way = self.cohort.contour_way(wildcards)
        return table("CURVES")["pixels"] if way == "order_contours" else f"cccd_workflow.contour_ways.{way}"

    def model_files(self, wildcards: OfStructure) -> list[str]:
        """Return the network that orders a structure's boundary pixels, where one does."""
        return [MODEL] if self.cohort.contour_way(wildcards) == "order_contours" else []

    def decoding(self, wildcards: OfStructure) -> dict[str, Any]:
        """Return settings of the network's decoder, and the row's parts, for pixels that it orders."""
        if not self.model_files(wildcards):
            return {}
        parts = self.cohort.row(wildcards)["parts"]
        return self.config["gnn"]["inference"] | ({"parts": int(parts)} if parts else {})

    def import_library(self, wildcards: OfStructure) -> str:
        """Digest the code that leads to a structure's contours, with the network that orders them."""
        classes = self.junctions.code() if self.model_files(wildcards) else []
        return self.library("import_structure", self.contour_function(wildcards), *classes, *self.readers)

    # Surfaces, and files of whole cases.

    @property
    def exports(self) -> list[str]:
        """The files of a surface that the configuration asks for further; PLY is always written."""
        asked = dict.fromkeys(self.settings.surface.formats)
        return [file for name in asked for file in _export_files(name)]

    @property
    def other_exports(self) -> str:
        """Pattern of the files of a surface that are made where one asks for them by name."""
        names = (file for name in (*formats(), *band_formats()) for file in _export_files(name))
        return "|".join(re.escape(name) for name in names if name not in self.exports)

    def export_library(self, files: Iterable[str]) -> str:
        """Digest the code that writes some of a surface's files."""
        writers = dict.fromkeys(table("WRITERS")[file.partition(".")[2]].writer for file in files)
        return self.library("export_surface", *writers)

    def format_files(self) -> list[str]:
        """Return the surfaces' further files that the configuration asks for."""
        return [file for name in self.exports for file in self.files(name)]

    def case_format_files(self) -> list[str]:
        """Return the files of whole cases that the configuration asks for."""
        names = self.settings.surface.case_formats
        files = [f"{'scene' if name in formats('solids') else 'volume'}.{name}" for name in names]
        cases = dict.fromkeys(name.case for name in self.cohort.reconstructed)
        return [f"results/{case}/{file}" for case in cases for file in files]

    def distance_files(self) -> list[str]:
        """Return the distances between organs, of every case that has more than one.

        Phantoms are made each by itself: what is next to another is so by chance.
        """
        found = (name for name in self.cohort.reconstructed if self.cohort.rows[name]["source"] != "phantom")
        organs = Counter(name.case for name in found)
        return [f"results/{case}/distances.csv" for case, count in organs.items() if count > 1]

    def scenes(self) -> list[str]:
        """Return the scenes of cases whose organs share their walls."""
        return [f"results/{case}/{name}" for case in self.cohort.shared for name in SCENE]

    @property
    def solid_reports(self) -> list[str]:
        """What is reported of each structure's solids and tetrahedra, as patterns."""
        asked, reported = dict.fromkeys(self.settings.surface.formats), formats("solids", "tetrahedra")
        return [f"results/{{case}}/{{organ}}/solid_{name}.json" for name in asked if name in reported]

    def case_reports(self, wildcards: OfCase) -> list[str]:
        """Return what is reported of the tetrahedra of a structure's case, where they are asked for."""
        return [f"results/{wildcards.case}/volume.json"] if self._fills_cases else []

    # Comparisons.

    def comparison_jobs(self) -> list[tuple[list[Comparison], list[StructureName]]]:
        """Return what is compared together in one job of a structure, and of which structures.

        Comparisons for a closer look that no run makes by itself are a job of their own.
        """
        sets: dict[tuple[str, ...], list[StructureName]] = {}
        for structure in self.cohort.reconstructed:
            possible = self._possible_comparisons(structure)
            for closer in (False, True):
                found = [one.name for one in possible if self._is_closer(one, structure) == closer]
                sets.setdefault(tuple(found), []).append(structure)
        return [([comparisons()[name] for name in names], found) for names, found in sets.items() if names]

    def comparison_inputs(self, together: Sequence[Comparison]) -> dict[str, Any]:
        """Return the files of each input of some comparisons; without a network an optional one has none."""
        return {name: self._input_files(name) for comparison in together for name in comparison.inputs}

    def _input_files(self, name: str) -> list[str] | Callable[[OfStructure], list[str]]:
        """Patterns of the files of an input of comparisons."""
        asked = inputs()[name]
        if asked.shipped:
            return _shipped_segmenters
        if asked.project:
            return [near(self.root / file) for file in asked.files]
        if asked.optional and not self.junctions.used:
            return []
        folder = "results" if asked.shared else "results/{case}/{organ}"
        return [f"{folder}/{file}" for file in asked.files]

    def comparison_library(self, together: Sequence[Comparison]) -> str:
        """Digest the code of some comparisons, with the classes of the networks that they are given."""
        given = [inputs()[name] for comparison in together for name in comparison.inputs]
        shipped = any(one.shipped for one in given)
        classes = [network.build for network in networks().values()] if shipped else []
        if any("gnn/model.pt" in one.files for one in given):
            classes += self.junctions.code()
        if any(one.project for one in given):
            classes += self.junctions.code(paper=True)
        functions = dict.fromkeys(function for comparison in together for function in comparison.functions)
        return self.library("compare_structure", *functions, *classes)

    def comparison_call(self, comparison: Comparison) -> dict[str, Any]:
        """Return what a job calls for a comparison, and with what."""
        return {
            "run": comparison.run,
            "figures": comparison.figures,
            "readers": {name: inputs()[name].read for name in comparison.inputs},
            "settings": self.comparison_settings(comparison),
            "sections": comparison.settings,
            "seed": {"seed": self.config["seed"]} if comparison.seeded else {},
        }

    def comparison_settings(self, comparison: Comparison) -> dict[str, Any]:
        """Return the sections of the configuration that a comparison names, in their places, and no other."""
        settings: dict[str, Any] = {}
        for section in comparison.settings.values():
            *parents, name = section.split(".")
            here, there = settings, self.config
            for parent in parents:
                here, there = here.setdefault(parent, {}), there[parent]
            here[name] = _without(there[name], section, comparison.unused)
        return settings

    def comparison_files(self, wildcards: OfStructure) -> list[str]:
        """Return what a structure's comparisons leave that the report shows.

        None are made unless ``compare`` asks for them, and ones for a closer look only where it is true: else
        the report shows those of them that are there (`Comparison.further`).
        """
        return [
            file
            for comparison in self._possible_comparisons(wildcards)
            for file in files_of_comparison(_folder(wildcards), comparison)
            if self._is_shown(comparison, wildcards, file)
        ]

    def _is_shown(self, comparison: Comparison, wildcards: OfStructure, file: str) -> bool:
        asked = self.cohort.is_asked(self.settings.compare, self.root)
        there = self.settings.compare == "auto" and comparison.further and Path(file).exists()
        return (asked and not self._is_closer(comparison, wildcards)) or bool(there)

    def _is_closer(self, comparison: Comparison, wildcards: OfStructure) -> bool:
        """Whether a comparison is for a closer look, for which no run makes it by itself."""
        first = comparison.further == "others" and self._first_known == (wildcards.case, wildcards.organ)
        return bool(comparison.further) and self.settings.compare is not True and not first

    @cached_property
    def _first_known(self) -> StructureName | None:
        """The first structure whose true surface is known."""
        names = self.cohort.reconstructed
        return next((name for name in names if self.cohort.rows[name]["source"] == "phantom"), None)

    def evidence_files(self) -> list[str]:
        """Return what the comparisons for a closer look leave, of all structures."""
        return [
            file
            for name in self.cohort.reconstructed
            for comparison in self._possible_comparisons(name)
            if comparison.further
            for file in files_of_comparison(_folder(name), comparison)
        ]

    def _possible_comparisons(self, wildcards: OfStructure) -> list[Comparison]:
        """Return the comparisons that a structure's data allow.

        One of role measure is in none, nor one whose mask a segmenter made, which is no ground truth.
        """
        row = self.cohort.row(wildcards)
        if row["role"] == "measure" or self.is_segmented(row):
            return []
        maps = self.cohort.kind(wildcards) == "boundary maps"
        made = {
            "structures": True,
            "outlines": not maps,
            "traced masks": self.junctions.used and self.cohort.contour_way(wildcards) == "trace_contours",
            "maps": maps,
            "phantoms": row["source"] == "phantom" and bool(_shipped_segmenters(wildcards)),
        }
        return [comparison for comparison in comparisons().values() if made[comparison.of]]

    def all_comparison_files(self, wildcards: object = None) -> list[str]:
        """Return what the comparisons of all structures leave."""
        return [file for name in self.cohort.reconstructed for file in self.comparison_files(name)]

    def all_comparison_rows(self, wildcards: object = None) -> list[str]:
        """Return the tables of all structures' comparisons."""
        return [file for file in self.all_comparison_files() if file.endswith(".csv")]

    # The report.

    def reported_files(self, wildcards: object = None) -> list[str]:
        """Return what the report waits for: the structures' pages, and what their comparisons drew."""
        return [*self.files("report.html"), *self.all_comparison_files()]

    def tables(self) -> list[str]:
        """Return stems of the tables that this run's structures and comparisons give rows for."""
        made = {Path(file).stem for file in self.all_comparison_rows()}
        given = {"structures": True, "distances": bool(self.distance_files())}
        return [
            item.table
            for item in items()
            if item.table is not None
            and item.tabulated
            and given.get(item.table, bool(made) and all(one.name in made for one in item.needed))
        ]

    @property
    def templates(self) -> str:
        """Digest of the files that pages are made from."""
        return digest_files(sorted((self.root / "workflow" / "report").glob("*.*")))

    @property
    def table_code(self) -> list[str]:
        """Functions that the tables are made by."""
        return [*(item.tabulate for item in items() if item.tabulate), *registered()]

    @property
    def report_code(self) -> list[str]:
        """Functions that the report is made by: those of the tables and the plots."""
        return [*self.table_code, *(item.plots for item in items() if item.plots)]


def files_of_comparison(folder: str, comparison: Comparison) -> list[str]:
    """Return what a comparison leaves in a structure's folder: its rows, and what the report draws."""
    stem = f"{folder}/comparisons/{comparison.name}"
    return [f"{stem}.csv"] + [f"{stem}.h5"] * (comparison.figures is not None)


def _export_files(name: str) -> list[str]:
    """Names of a surface's files in a format besides PLY; the error band has one for each side."""
    if name in band_formats():
        return [f"surface_{side}.{name.removeprefix('band.')}" for side in ("inner", "outer")]
    return [f"surface.{name}"] if name != "ply" else []


def _files(names: Iterable[StructureName], file: str) -> list[str]:
    return [f"{_folder(name)}/{file}" for name in names]


def _folder(wildcards: OfStructure) -> str:
    return f"results/{wildcards.case}/{wildcards.organ}"


def _has_image_alone(row: Mapping[str, str]) -> bool:
    return bool(row["image"]) and not (row["mask"] or row["boundary"])


def _shipped_segmenters(wildcards: OfStructure) -> list[str]:
    """Weights of the segmentation networks that come with the project for a phantom's organ."""
    return sorted(map(near, PROJECT.glob(f"workflow/models/segmenters/phantom_{wildcards.organ}/*.pt")))


def _without(value: Any, section: str, unused: Iterable[str]) -> Any:
    """Leave out the keys of a section, dotted, that change nothing."""
    if not isinstance(value, dict):
        return value
    keys = cast("dict[str, Any]", value)
    return {key: part for key, part in keys.items() if f"{section}.{key}" not in unused}


def _materials(settings: Settings) -> list[str]:
    """Find the table of materials that the configuration names, if any; it is read before the first job."""
    named = settings.surface.tetrahedra.materials
    if named:
        from cccd_tetrahedra.materials import read_table  # slow to import

        read_table(named)
    return [named] if named else []


def _calibration(settings: Settings) -> list[str]:
    """Find the error bands' factors that the configuration names, if any; a missing file is refused."""
    named, reader = settings.surface.calibration, settings.surface.reader_mm
    if named and not Path(named).is_file():
        hint = "make one with cccd calibrate"
        raise InputError("config key surface.calibration", f"there is no file {named}", hint)
    if reader is not None:
        from cccd.bands import Reader  # slow to import

        Reader.of(reader)
    return [name for name in (named, reader) if isinstance(name, str) and Path(name).is_file()]
