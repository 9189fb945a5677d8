"""Rows of a tab-separated sheet, as people and spreadsheets write them."""

from __future__ import annotations

import csv
import re
from pathlib import Path

from cccd.errors import InputError


def read_rows(path: Path, what: str, cure: str) -> tuple[str, list[str], list[tuple[str, dict[str, str]]]]:
    """Read a sheet with a header line; blank lines are left out.

    Messages call it ``what``, and name the ``cure`` where it cannot be read. Returns where the header is, as
    ``"cohort.tsv row 1"``, its columns, and for each row where it is, and its cells.

    Raises
    ------
    InputError
        Names file and row.
    """
    name = path.name
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, delimiter="\t", strict=True)
            lines = [(f"{name} row {reader.line_num}", [cell.strip() for cell in line]) for line in reader]
    except FileNotFoundError:
        raise InputError(str(path), f"no such {what}", cure) from None
    except OSError as error:
        raise InputError(str(path), f"the {what} cannot be read ({error.strerror})", cure) from None
    except UnicodeDecodeError:
        raise InputError(name, "not UTF-8 text", "save it as tab-separated UTF-8 text (.tsv)") from None
    except csv.Error as error:
        problem, hint = f"malformed line ({error})", "check its quotes and tabs"
        raise InputError(f"{name} row {reader.line_num}", problem, hint) from None
    lines = [(where, cells) for where, cells in lines if any(cells)]
    if not lines:
        raise InputError(name, f"the {what} is empty", "begin it with a line naming the columns")
    (top, header), *rows = lines
    while not header[-1]:  # spreadsheets leave tabs behind
        header.pop()
    for where, cells in lines:
        if re.search("[\n\r\0]", "".join(cells)):
            raise InputError(where, "a field contains a line break or NUL", "check its quotes")
        if any(cells[len(header) :]):
            raise InputError(where, f"{len(cells)} fields under {len(header)} columns", "check its tabs")
    return top, header, [(where, dict(zip(header, cells, strict=False))) for where, cells in rows]
