"""The comparisons that a job makes on one structure: their rows, and what the report draws of them."""

from operator import attrgetter

from cccd.plugins import call, find
from cccd.settings.root import whole_settings
from cccd.store import write_table
from cccd_viewers.page_files import write_figures
from cccd_workflow.job import job

case, organ = snakemake.wildcards.case, snakemake.wildcards.organ
inputs = {}
for name, wanted in snakemake.params.calls.items():
    with job(snakemake.log[0], f"{case}/{organ}, {name}", snakemake.input, snakemake.output):
        for key in wanted["readers"].keys() - inputs.keys():
            inputs[key] = find(wanted["readers"][key])(*snakemake.input.get(key))
        arguments = {key: inputs[key] for key in wanted["readers"]}
        settings = whole_settings()(**wanted["settings"])
        arguments |= {key: attrgetter(section)(settings) for key, section in wanted["sections"].items()}
        arguments |= wanted["seed"]
        rows = find(wanted["run"])(**arguments).assign(case=case, organ=organ)
        names = ["case", "organ"] if len(rows) else []
        table, *drawn = snakemake.output.get(name)
        write_table(table, rows[[*names, *rows.columns.drop(["case", "organ"])]])
        for file in drawn:
            write_figures(file, call(wanted["figures"], arguments))
