"""Tables in the pages: a fenced block named ``table`` says which rows and columns of a CSV file it shows.

MkDocs loads this file as a hook. A block holds the arguments of `table` in YAML.
"""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd
import yaml

_BLOCK = re.compile(r"^```table\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def on_page_markdown(markdown: str, page, **_) -> str:
    """Put tables in the place of a page's blocks."""
    return with_tables(markdown, Path(page.file.abs_src_path).parent)


def with_tables(markdown: str, folder: Path) -> str:
    """Put tables in the place of blocks, whose files stand in a folder."""
    return _BLOCK.sub(lambda block: table(folder, **yaml.safe_load(block[1])), markdown)


def table(
    folder: Path,
    file: str,
    columns: str,
    rows: str = "index >= 0",
    medians_by: str = "",
    across: str | None = None,
) -> str:
    """Write a Markdown table of a CSV file.

    Parameters
    ----------
    folder : path
    file : str
        Within the folder.
    columns : str
        Their names in order, with commas.
    rows : str
        Expression of `pandas.DataFrame.query`.
    medians_by : str
        Columns by which rows are grouped; the others are medians.
    across : str, optional
        Another such column, whose values are headings.
    """
    found, names = pd.read_csv(folder / file).query(rows), _names(columns)
    if found.empty:
        raise ValueError(f"{file} has no rows with {rows}")
    if medians_by:
        by = _names(medians_by)
        groups = found.groupby([*by, *([across] if across else [])], sort=False)
        medians = groups[names].median()
        if across:
            medians = medians.unstack(across)
            medians.columns = [f"{across} {value}" for _, value in medians.columns]
        found = medians.reset_index()
        names = list(found.columns)
    lines = [names, ["---"] * len(names), *([_cell(row[name]) for name in names] for row in _records(found))]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",")]


def _records(found: pd.DataFrame) -> list[dict[str, object]]:
    return found.astype(object).to_dict("records")


def _cell(value: object) -> str:
    if pd.isna(value):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        return f"{value:,.0f}" if value == round(value) or abs(value) >= 1e4 else f"{value:.4g}"
    return str(value).replace("|", "\\|")
