"""Plans of small cohorts; what a sheet names need not be there to be planned."""

from pathlib import Path

from cccd_workflow.plan.cohort import StructureName
from cccd_workflow.plan.plan import Plan
from support import ROOT


def write_sheet(rows, name="sheet.tsv"):
    """Write a sheet of such rows here, as mappings of columns, and return its path."""
    columns = list(dict.fromkeys(column for row in rows for column in row))
    lines = ["\t".join(columns), *("\t".join(row.get(column, "") for column in columns) for row in rows)]
    path = Path(name).absolute()
    path.write_text("\n".join(lines) + "\n")
    return path


def plan_of(*rows, **config):
    """Plan a cohort of such rows."""
    return Plan.make({"cohort": str(write_sheet(rows)), **config}, ROOT)


def named(text):
    """Wildcards of ``case/organ``."""
    return StructureName(*text.split("/"))
