"""Smooth spline surfaces of organs from stacks of slices: the whole workflow on one page.

snakemake --cores 2                              the default cohort: training, surfaces, tables, report
snakemake --cores 2 --config cohort=sheet.tsv    your own structures
snakemake --cores 2 surfaces                     surfaces only, without measures, comparisons or report
snakemake --cores 2 evidence                     comparisons for a closer look; the next report shows them
snakemake --cores 2 results/CASE/ORGAN/surface.ply
snakemake --cores 2 segmenters                   segmentation networks, trained on the sheet's rows of role train
snakemake --cores 2 shapes                       one spline for all cases of an organ: mean, modes, groups
snakemake --cores 2 phantoms                     scans and true surfaces, as files for a benchmark

The console shows a line for each finished job; --verbose shows all of Snakemake's own log.
"""

from snakemake.utils import min_version

min_version("9.27")


configfile: f"{workflow.basedir}/config/config.yaml"


include: "workflow/rules/common.smk"


wildcard_constraints:
    case=CASE,
    organ=NAME,


include: "workflow/rules/segmentation.smk"
include: "workflow/rules/structures.smk"
include: "workflow/rules/junctions.smk"
include: "workflow/rules/curves.smk"
include: "workflow/rules/surfaces.smk"
include: "workflow/rules/comparisons.smk"
include: "workflow/rules/cases.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/phantoms.smk"
include: "workflow/rules/shapes.smk"


rule missing_rows:
    """Stand in for rows whose files are missing: a run with nothing else to do is then no good run either."""
    output:
        touch(MISSING_ROWS),
    localrule: True


rule surfaces:
    """Every surface in every format that is asked for, and nothing else."""
    input:
        plan.files("surface.ply"),
        plan.format_files(),
        plan.case_format_files(),
        rules.missing_rows.output if cohort.missing else [],
    localrule: True


rule evidence:
    """Comparisons for a closer look: thick slices, the whole chain's times, surfaces of the paper's corners, and other
    methods and networks on every structure.
    """
    input:
        plan.evidence_files(),
        rules.missing_rows.output if cohort.missing else [],
    localrule: True


rule all:
    """Everything: a surface per structure, every table, and the report."""
    default_target: True
    input:
        "results/report.html",
        rules.surfaces.input,
        plan.scenes(),
    localrule: True


check_targets()


onstart:
    check_before_jobs()
    look_for_jobs_when_one_ends()
    answer_signals()
    shorten_console()


onsuccess:
    tell_where_results_are()


onerror:
    list_failures()
