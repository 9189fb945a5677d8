"""One comparison on one structure: its rows, and what the report draws of it."""

from operator import attrgetter

from cccd.job import job
from cccd.lookup import call, find
from cccd.settings.root import whole_settings
from cccd.store import write_figures, write_table

case, organ = snakemake.wildcards.case, snakemake.wildcards.organ
with job(snakemake.log[0], f"{case}/{organ}", snakemake.input, snakemake.output):
    arguments = {
        name: find(read)(*snakemake.input.get(name)) for name, read in snakemake.params.readers.items()
    }
    settings = whole_settings()(**snakemake.params.settings)
    arguments |= {name: attrgetter(section)(settings) for name, section in snakemake.params.sections.items()}
    arguments |= snakemake.params.seed
    rows = find(snakemake.params.run)(**arguments).assign(case=case, organ=organ)
    names = ["case", "organ"] if len(rows) else []
    write_table(snakemake.output.rows, rows[[*names, *rows.columns.drop(["case", "organ"])]])
    if snakemake.params.figures:
        write_figures(snakemake.output.figures, call(snakemake.params.figures, arguments))
