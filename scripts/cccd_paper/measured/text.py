"""Tables and numbers as Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import pandas as pd

__all__ = ["Tables", "listed", "markdown_table", "place", "written"]

Tables = Mapping[str, pd.DataFrame]


def markdown_table(rows: Sequence[Mapping[str, str]]) -> str:
    """Write rows of text as a Markdown table; the first row's keys are the header."""
    header = list(rows[0])
    lines = [header, ["---"] * len(header), *([row[name] for name in header] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def listed(parts: Sequence[str]) -> str:
    """Join parts of a sentence."""
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def written(value: float, form: str = ".2f", missing: str = "–") -> str:
    """Write a number in a format; what is missing as a dash."""
    return missing if pd.isna(value) else format(value, form)


def place(row: pd.Series) -> str:
    """Name a row's structure."""
    return f"{row['case']}/{row['organ']}"
