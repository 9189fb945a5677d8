"""Helpers only: the cohort and the configuration, and what several rule files share. No rules here."""

import functools
import hashlib
import os
import re
import signal
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace

from snakemake.exceptions import WorkflowError

ROOT = Path(workflow.basedir)
SCRIPTS = ROOT / "scripts"
#: The library's folder stands beside the jobs in a checkout; the wheel carries the workflow within the library.
IN_CHECKOUT = (SCRIPTS / "cccd").is_dir()
if IN_CHECKOUT:
    sys.path.insert(0, str(SCRIPTS))

import cccd
from cccd.cohort import brings_maps, complete_row, read_cohort
from cccd.comparisons.registry import COMPARISONS, INPUTS, ITEMS, tables
from cccd.dependencies import imported_files
from cccd.devices import DEVICE
from cccd.dicom_objects import holds_contours
from cccd.disk_space import check_room
from cccd.sidecar_files import voxel_files
from cccd.errors import InputError
from cccd.extras import check_extra
from cccd.job import BATCH, take_placeholders_away
from cccd.remote import is_remote, read_address
from cccd.model_header import check_model, check_start, read_segmenter_plan
from cccd.settings.imports import PHANTOM_DISTANCES_MM, PHANTOM_ORGANS
from cccd.settings.junctions import NetworkSettings
from cccd.project import shipped_weights
from cccd.settings.messages import nearest
from cccd.settings.segmentation import (
    INSTALLED_SEGMENTERS,
    SEGMENTERS,
    is_installed_segmenter,
)
from cccd.settings.surface import SOLID_FORMATS, SURFACE_FORMATS, TETRAHEDRA_FORMATS
from cccd.settings.validation import validate_config

#: Formats whose writers report what they made, each with its module.
REPORTED_FORMATS = SOLID_FORMATS | TETRAHEDRA_FORMATS

#: The library's folder; its files decide which stages run again.
LIBRARY = Path(cccd.__file__).parent


os.environ[DEVICE] = config["device"]

if workflow.remote_exec:
    # a job of a cluster: its structures fail one by one, and not all because of one
    os.environ[BATCH] = "1"
elif not any(Path(".snakemake", "locks").glob("*")):
    # those of a run that was killed before it could take them away; of one that still goes on they stay
    take_placeholders_away()


def find_file(name):
    """A file that the configuration names: absolute, or relative to here, to where the command was typed,
    or to the project."""
    folders = [Path.cwd(), Path(os.environ.get("PWD", ".")), ROOT]
    found = [folder / name for folder in folders if (folder / name).is_file()]
    return found[0] if found else ROOT / name


#: What the sheet names by an address, by where it goes.
REMOTE = {}


def bring_here(row):
    """The row with local paths in place of addresses, whose files `fetch_file` brings."""
    row = dict(row)
    for column in ("image", "mask", "boundary"):
        if not is_remote(row[column]):
            continue
        if row["source"] != "files" or row["organ"] == "*":
            what = "organ *" if row["organ"] == "*" else f"source {row['source']}"
            raise InputError(
                row["location"],
                f"{what} stands beside an address",
                "download the files and name their folder",
            )
        remote = read_address(row[column], row["location"])
        REMOTE[str(remote.local)] = remote
        row[column] = os.path.relpath(remote.local, SHEET.parent)
    return row


def near(path):
    """A path relative to here when it lies below, so that a moved project reruns nothing."""
    path = Path(path).resolve()
    return str(
        path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
    )


def is_trained():
    """Whether the network is trained in this run; a configuration that asks for both ways is refused."""
    wanted, named = config["train"], config["gnn"]["pretrained"]
    if wanted is True and named:
        raise InputError(
            "config keys train and gnn.pretrained",
            f"{named} is to be taken, and a model is to be trained",
            "set train: false, or gnn.pretrained to null",
        )
    default = SHEET.resolve() == (ROOT / "config" / "cohort.tsv").resolve()
    trained = default and not named if wanted == "auto" else wanted
    if config["gnn"]["start"] and not trained:
        raise InputError(
            "config key gnn.start", "nothing is trained in this run", "set train: true"
        )
    return trained


try:
    # from here on every key is there, the experts' too, and numbers given on the command line are numbers
    config.update(validate_config(config).as_config())
    SHEET = find_file(config["cohort"])
    COHORT = [bring_here(row) for row in read_cohort(SHEET)]
    #: Names, colours and codes of the labels of whole maps, by case and organ; organs that share their walls, by
    #: case.
    LABELS, SHARED = {}, {}
    if (
        any(row["organ"] == "*" for row in COHORT)
        or config["surface"]["shared_walls"] is True
    ):
        from cccd.volumes.label_maps import expand_rows, shared_groups

        COHORT, LABELS, notes = expand_rows(
            COHORT, SHEET.parent, Path(".snakemake") / "labels"
        )
        for note in notes:
            print(f"Note: {note}", file=sys.stderr)
        SHARED = shared_groups(COHORT, LABELS, config["surface"]["shared_walls"])
    TRAINED = is_trained()
except InputError as error:
    sys.exit(f"Error: {error}")

ROW = {(row["case"], row["organ"]): row for row in COHORT}
#: The structures that are reconstructed, measured and reported on; rows of role train are left out.
RECONSTRUCTED = [key for key, row in ROW.items() if row["role"] != "train"]
#: Those whose region is found in the image: what was taken is worth a look.
REGIONS = [
    key
    for key in RECONSTRUCTED
    if ROW[key]["source"] == "mni152_scan"
    or (
        ROW[key]["source"] == "files"
        and not (ROW[key]["mask"] or ROW[key]["boundary"])
        and not config["segmenter"]
    )
]


def before_walls(wildcards):
    """The group of jobs before organs of a case meet: Snakemake wants no group that begins again later."""
    return "apart" if wildcards.case in SHARED else "structure"


def after_filling(_):
    """The group of jobs that read what is reported of the tetrahedra of a whole case."""
    return "measured" if fills_cases() else "structure"


def fills_cases():
    """Whether tetrahedra of whole cases are asked for."""
    return bool(set(config["surface"]["case_formats"]) & set(TETRAHEDRA_FORMATS))


#: What makes the masks of rows that have an image alone; its weights, and its labels.
SEGMENTER = config["segmenter"]


def segmenter_file():
    """The segmenter's weights, in a list that is empty for one that is installed beside.

    A network's name means the weights that this sheet's rows of role train give.
    """
    if SEGMENTER is None or is_installed_segmenter(SEGMENTER):
        return []
    if SEGMENTER in SEGMENTERS:
        if all(row["role"] != "train" for row in COHORT):
            raise InputError(
                "config key segmenter",
                f"{SEGMENTER} is to be trained, and {SHEET.name} has no row of role train",
                "add such rows, or name a file of workflow/models/segmenters",
            )
        return [f"results/segmenters/{SEGMENTER}/model.pt"]
    if not find_file(SEGMENTER).is_file():
        raise InputError(
            "config key segmenter",
            f"there is neither a network nor a file {SEGMENTER}",
            nearest(SEGMENTER, [*SEGMENTERS, *INSTALLED_SEGMENTERS]),
        )
    return [near(find_file(SEGMENTER))]


def segmenter_labels():
    """Label values of the segmenter's masks, as the sheet's column label has them."""
    if is_installed_segmenter(SEGMENTER):
        return "1"
    if SEGMENTER in SEGMENTERS:
        return ",".join(map(str, config["segmentation"]["labels"] or [1]))
    return ",".join(map(str, read_segmenter_plan(SEGMENTER_FILE[0])["labels"]))


def is_segmented(row):
    """Whether a row's mask is made here: it has an image alone, and a segmenter is named."""
    return bool(
        SEGMENTER
        and row["source"] == "files"
        and row["image"]
        and not (row["mask"] or row["boundary"])
    )


try:
    SEGMENTER_FILE = segmenter_file()
    SEGMENTED_LABELS = segmenter_labels() if SEGMENTER else ""
except InputError as error:
    sys.exit(f"Error: {error}")


#: The wildcards case and organ. Not the sheet's own names: a pattern that lists a thousand of them is searched
#: for every file of every job, and planning would take time that grows with the cohort squared.
NAME = "[A-Za-z0-9_-]+"
#: Cases whose organs share their walls, and all others.
SHARING = "|".join(map(re.escape, SHARED)) or "(?!)."
APART = f"(?!(?:{SHARING})/){NAME}" if SHARED else NAME


def row_of(wildcards):
    """The sheet's row of a structure; for `snakemake results/CASE/ORGAN/...` with a name that is not there."""
    key = wildcards.case, wildcards.organ
    if key not in ROW:
        known = nearest(
            f"{key[0]}/{key[1]}", [f"{case}/{organ}" for case, organ in ROW]
        )
        raise WorkflowError(f"{SHEET.name} has no structure {key[0]}/{key[1]}; {known}")
    return ROW[key]


@functools.cache
def is_drawn(mask):
    """Whether the mask that the sheet names is drawn contours; its first bytes are read, once per plan."""
    return bool(mask) and holds_contours(SHEET.parent / mask)


def is_ordered(row):
    """Whether the boundary pixels of a row's structure are ordered by the network.

    So are boundary maps; masks, those that a threshold finds in a file included, if ``curves: ordering: gnn``
    asks for it.
    """
    asked = config["curves"]["ordering"] == "gnn"
    return brings_maps(row) or (asked and not is_drawn(row["mask"]))


def way_of(wildcards):
    """The way to a structure's contours, by its script: what the data are decides it, before any job starts."""
    row = row_of(wildcards)
    if is_ordered(row):
        return "order_contours"
    return "take_contours" if is_drawn(row["mask"]) else "trace_contours"


#: Priorities: first what the longest chain of jobs begins with, as structures wait for the trained network; then
#: the way to each surface, which comparisons wait for; comparisons, by their length; and all else.
FIRST, ON_THE_WAY = 100, 50

#: The model in use; the one that comes with the project; and the one that is taken where none is trained.
MODEL = "results/gnn/model.pt"
SHIPPED = near(ROOT / "workflow" / "models" / "junctions.pt")
SHIPPED_PAPER = near(ROOT / "workflow" / "models" / "paper.pt")
PRETRAINED = config["gnn"]["pretrained"]
ORDERS = config["gnn"]["network"]
READY = (
    near(find_file(PRETRAINED))
    if PRETRAINED
    else {"ours": SHIPPED, "paper": SHIPPED_PAPER}[ORDERS]
)
START = [near(find_file(name)) for name in [config["gnn"]["start"]] if name]

try:
    # a job that starts loses its outputs: what it would refuse is refused here, and no trained model with it
    for key in ("start", "pretrained"):
        name = config["gnn"][key]
        if name and not find_file(name).is_file():
            # a model that lies where this one would go would be taken for it
            raise InputError(
                f"config key gnn.{key}",
                f"there is no file {name}",
                "name a model.pt, from here or from the project's folder",
            )
    for path in START:
        check_start(path, NetworkSettings(**config["gnn"]))
    if not TRAINED:
        check_model(READY, ORDERS)
except InputError as error:
    sys.exit(f"Error: {error}")

#: Whether this run uses a network: it trains one, or names one, or needs one to order contours. What compares
#: networks is planned only then.
NETWORKED = (
    TRAINED or bool(PRETRAINED) or any(is_ordered(ROW[key]) for key in RECONSTRUCTED)
)


def contour_sources(wildcards):
    """What the structure's way reads: its boundary pixels and the network only where they must be ordered."""
    names = ["structure"] + ["boundaries"] * (way_of(wildcards) == "order_contours")
    files = {
        name: f"results/{wildcards.case}/{wildcards.organ}/{name}.h5" for name in names
    }
    return files | ({"model": MODEL} if "boundaries" in files else {})


def ordering_settings(wildcards):
    """Settings of the network's decoder, for the structures whose boundary pixels it orders; a row's parts."""
    if way_of(wildcards) != "order_contours":
        return {}
    parts = row_of(wildcards)["parts"]
    return config["gnn"]["inference"] | ({"parts": int(parts)} if parts else {})


def for_structures(name, keys=None):
    """The file ``name`` of every structure that is reconstructed (or of ``keys``)."""
    return [
        f"results/{case}/{organ}/{name}"
        for case, organ in (RECONSTRUCTED if keys is None else keys)
    ]


def of_case(wildcards, name):
    """The file ``name`` of every organ of a case that shares its walls."""
    organs = SHARED.get(wildcards.case, [])
    return for_structures(name, [(wildcards.case, organ) for organ in organs])


def of_whole_case(wildcards, name):
    """The file ``name`` of every organ of a case that is reconstructed."""
    keys = [key for key in RECONSTRUCTED if key[0] == wildcards.case]
    if not keys:
        raise WorkflowError(f"{SHEET.name} has no case {wildcards.case}")
    return for_structures(name, keys)


def for_cases():
    """The scenes of cases whose organs share their walls."""
    files = ["scene.glb", "segmentation.seg.nrrd", "scene.json", "scene.html"]
    return [f"results/{case}/{name}" for case in SHARED for name in files]


def for_formats():
    """The surfaces' further files that the configuration asks for; PLY is always written."""
    return [
        file
        for name in config["surface"]["formats"]
        if name != "ply"
        for file in for_structures(f"surface.{name}")
    ]


def for_case_formats():
    """The files of whole cases that the configuration asks for."""
    names = config["surface"]["case_formats"]
    files = [
        f"{'scene' if name in SOLID_FORMATS else 'volume'}.{name}" for name in names
    ]
    cases = dict.fromkeys(case for case, _ in RECONSTRUCTED)
    return [f"results/{case}/{file}" for case in cases for file in files]


def case_reports(wildcards):
    """What is reported of the tetrahedra of a structure's case, where they are asked for."""
    return [f"results/{wildcards.case}/volume.json"] if fills_cases() else []


def for_pages():
    """The structures' own pages, to which the report of a large cohort links."""
    large = len(RECONSTRUCTED) > config["report"]["pages_above"]
    return for_structures("report.html") if large else []


def comparison_inputs(comparison):
    """What the comparison's function asks for -> the files it is read from; none where it may do without."""
    return {
        name: (
            shipped_files
            if INPUTS[name].shipped
            else [
                (
                    f"results/{file}"
                    if INPUTS[name].shared
                    else f"results/{{case}}/{{organ}}/{file}"
                )
                for file in INPUTS[name].files
                if NETWORKED or not INPUTS[name].optional
            ]
        )
        for name in comparison.inputs
    }


def shipped_files(wildcards):
    """Weights of the segmentation networks that come along for the structure's organ."""
    return [near(path) for path in shipped_weights(wildcards.organ)]


def comparison_settings(comparison):
    """The sections of the configuration that the comparison names, in their places, and no other."""
    settings = {}
    for section in comparison.settings.values():
        *parents, name = section.split(".")
        here, there = settings, config
        for parent in parents:
            here, there = here.setdefault(parent, {}), there[parent]
        value = there[name]
        if isinstance(value, dict):
            value = {
                key: part
                for key, part in value.items()
                if f"{section}.{key}" not in comparison.unused
            }
        here[name] = value
    return settings


def comparison_files(wildcards):
    """What a structure's comparisons leave: which of them are made of it, what the data are decides.

    One of role measure is in none, nor one whose mask a segmenter made, which is no truth to compare with.
    """
    if row_of(wildcards)["role"] == "measure" or is_segmented(row_of(wildcards)):
        return []
    maps = brings_maps(row_of(wildcards))
    traced = NETWORKED and way_of(wildcards) == "trace_contours"
    source, organ = row_of(wildcards)["source"], wildcards.organ
    phantom = source == "phantom" and bool(shipped_weights(organ))
    made = {
        "outlines": not maps,
        "traced masks": traced,
        "maps": maps,
        "phantoms": phantom,
    }
    folder = f"results/{wildcards.case}/{wildcards.organ}/comparisons"
    return [
        f"{folder}/{name}.{suffix}"
        for name, comparison in COMPARISONS.items()
        if made[comparison.of]
        for suffix in ["csv"] + ["h5"] * (comparison.figures is not None)
    ]


def all_comparison_files(_):
    """What the comparisons of all structures leave."""
    keys = [SimpleNamespace(case=case, organ=organ) for case, organ in RECONSTRUCTED]
    return [file for key in keys for file in comparison_files(key)]


def all_comparison_rows(_):
    """The tables of all structures' comparisons."""
    return [file for file in all_comparison_files(_) if file.endswith(".csv")]


def source_files(wildcards):
    """The row's own files, the voxels beside their headers, and the files that its cohort's layout implies, so that
    a changed scan comes in again.

    Left out is what the job itself reports, a missing file or a name against the layout, and what is dated in
    the future (a clock ran ahead somewhere), than which every output would be older, an error to Snakemake.
    """
    row = row_of(wildcards)
    try:
        row, _ = complete_row(row, SHEET.parent)
    except InputError:
        pass
    named = [
        SHEET.parent / row[column]
        for column in ("image", "mask", "boundary")
        if row[column]
    ]
    paths = named + [voxels for path in named for voxels in voxel_files(path)]
    named_here = {near(path) for path in named}
    return sorted(
        {
            near(path)
            for path in paths
            if path.exists() and path.stat().st_mtime <= time.time()
        }
        | (named_here & REMOTE.keys())
    )


def remote_file(wildcards):
    """What `fetch_file` brings to a path; one that the sheet names no more is refused."""
    path = f"downloads/{wildcards.key}/{wildcards.file}"
    if path not in REMOTE:
        raise WorkflowError(f"{SHEET.name} names no address of {path}")
    return REMOTE[path]


#: Rows that train the segmentation networks.
TRAINING = [key for key, row in ROW.items() if row["role"] == "train"]


def training_files(_):
    """Scans and masks of the rows that train; a sheet without such rows is refused."""
    if not TRAINING:
        raise WorkflowError(
            f"{SHEET.name} has no row of role train to train a segmenter on"
        )
    keys = [SimpleNamespace(case=case, organ=organ) for case, organ in TRAINING]
    return sorted({file for key in keys for file in source_files(key)})


def sheet_row(wildcards):
    """The row as plain values; its location in the sheet is left out so that moving a row reruns nothing.

    Where a segmenter makes the mask, the row names it.
    """
    row = row_of(wildcards)
    if is_segmented(row):
        mask, _ = segmentation_files(wildcards)
        made = {
            "mask": os.path.relpath(mask, SHEET.parent),
            "label": SEGMENTED_LABELS,
        }
        row = {**row, **made}
    return {key: value for key, value in sorted(row.items()) if key != "location"}


def segmentation_files(wildcards):
    """The mask that a segmenter makes of a row's image, and its report; none for other rows."""
    if not is_segmented(row_of(wildcards)):
        return []
    folder = f"results/{wildcards.case}/{wildcards.organ}"
    return [f"{folder}/segmentation.nii.gz", f"{folder}/segmentation.json"]


@functools.cache
def library(script, *functions):
    """SHA-256 of the library files that ``scripts/<script>.py`` imports, and those of the functions that it is
    given to call, so that editing one runs its stage again. One parameter, because twenty files among the
    inputs of every job treble the time to plan.
    """
    modules = [function.rpartition(".")[0] for function in functions]
    files = imported_files(SCRIPTS / f"{script}.py", LIBRARY, modules)
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in files)).hexdigest()


def pick(section, *keys):
    """Just these keys of a section of the configuration, so that a job depends on no other."""
    return {key: config[section][key] for key in keys if key in config[section]}


def leave(section, *keys):
    """A section of the configuration without these keys."""
    return pick(section, *(key for key in config[section] if key not in keys))


def memory(base_mb, per_input_mb=0):
    """A ``mem_mb`` function: grows with the inputs' size and with every attempt."""

    def mem_mb(wildcards, input, attempt):
        # not input.size_mb, which asks for every file in an event loop: a sixth of the time to plan.
        # What an earlier job of a group is yet to write counts nothing: an error here would leave the
        # group without this job's request
        size_mb = (
            sum(os.path.getsize(file) for file in input if os.path.exists(file)) / 2**20
        )
        return int((base_mb + per_input_mb * size_mb) * 1.5 ** (attempt - 1))

    return mem_mb


def minutes(base):
    """A ``runtime`` function: every attempt gets the base time again."""
    return lambda wildcards, attempt: base * attempt


#: Rules that need an extra whatever they work on; `extra_of` knows the others.
NEEDS = {
    "generate_graphs": "gnn",
    "train_gnn": "gnn",
    "train_paper_network": "gnn",
    "adopt_gnn": "gnn",
    "evaluate_gnn": "gnn",
    "train_segmenter": "segment",
    "export_scene": "cad",
    "render_surface": "view",
    "build_tables": "report",
    "build_structure_page": "report",
    "build_report": "report",
}


#: The extra that the mesher of tetrahedra needs.
MESHER_NEEDS = {"ftetwild": "fe", "gmsh": "view", "gmsh-step": "cad"}[
    config["surface"]["tetrahedra"]["mesher"]
]


def makes_tetrahedra(job):
    """Whether a job fills surfaces with tetrahedra."""
    form = getattr(job.wildcards, "solid_format", None)
    return job.rule.name == "fill_case" or form in TETRAHEDRA_FORMATS


def extra_of(job):
    """The extra that a job cannot do without; None for most."""
    if makes_tetrahedra(job):
        return MESHER_NEEDS
    if job.rule.name == "export_solid":
        return "cad"
    if job.rule.name == "fetch_file":
        return "s3" if job.params.address.startswith("s3:") else None
    if job.rule.name == "make_contours":
        return "gnn" if way_of(job.wildcards) == "order_contours" else None
    if job.rule.name == "segment_structure":
        return None if is_installed_segmenter(SEGMENTER) else "segment"
    return NEEDS.get(job.rule.name)


def check_before_jobs():
    """Refuse what the planned jobs would be refused for, before the first of them starts and loses its outputs.

    An environment that Snakemake makes for the jobs has extras of its own: there, only the disk is looked at.
    """
    jobs = list(workflow.dag.needrun_jobs())
    extras = {extra_of(job): job for job in jobs}
    try:
        if not workflow.deployment_settings.deployment_method:
            for extra in sorted(filter(None, extras)):
                job = extras[extra]
                check_extra(extra, " ".join([job.rule.name, "/".join(job.wildcards)]))
            mesher = config["surface"]["tetrahedra"]["mesher"]
            if mesher != "ftetwild" and any(map(makes_tetrahedra, jobs)):
                from cccd.tetrahedra.gmsh_program import require_gmsh

                require_gmsh()
        check_room(Path("results"), [file for job in jobs for file in job.output])
    except InputError as error:
        sys.exit(f"Error: {error}")


def switch_timers_off():
    """Keep Snakemake 9.27 from setting a timer, a thread, for every job that has finished, and from looking for
    new work whenever one rings: thousands of times a second in a large cohort. All they serve is a limit of a
    hundred submissions a second.
    """
    workflow.scheduler.job_rate_limiter = None


def answer_sigterm_beside():
    """Answer SIGTERM in a thread of its own.

    Snakemake 9.27 takes a lock in the handler, which runs in the main thread: where that holds the lock, as while a
    job is finished, it would wait for itself for ever.
    """
    end = workflow.scheduler.exit_gracefully
    if signal.getsignal(signal.SIGTERM) == end:
        signal.signal(signal.SIGTERM, lambda *_: threading.Thread(target=end).start())


def failures():
    """The one-line errors that failed jobs of this run left beside their logs, sorted."""
    return sorted(
        {
            line
            for file in Path("logs").rglob("*.failed")
            for line in file.read_text().splitlines()
        }
    )


def tell_where_results_are():
    """End a good run by saying where to look; one whose batches left out what failed is none."""
    if take_placeholders_away():
        list_failures()
        sys.exit(1)
    for file in ("results/report.html", *for_structures("surface.ply")):
        if Path(file).exists():
            print(Path(file).resolve())


def list_failures():
    """End a bad run: every failure in one line, and a report of the structures that are finished."""
    take_placeholders_away()
    lines = failures()
    if lines:
        print(f"\n{len(lines)} failed:", *lines, sep="\n  ", file=sys.stderr)
    if any(Path(file).exists() for file in for_structures("metrics.json")):
        from cccd.report.page import build_report_of_finished

        build_report_of_finished(
            Path("results"),
            config,
            Path("results/report.html"),
            ROOT / "workflow" / "report",
            structures=RECONSTRUCTED,
            failures=lines,
            benchmarks=Path("benchmarks"),
        )
        print(
            f"\nReport of what is finished: {Path('results/report.html').resolve()}",
            file=sys.stderr,
        )
    print(
        "\nFix the input and run the same command again: finished files are kept "
        "(add --keep-going to finish the other structures first).",
        file=sys.stderr,
    )
